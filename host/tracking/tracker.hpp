// Follows the markers of a phantom from frame to frame.
//   predict    where a marker was, plus its last velocity
//   find       by one of the two methods of locate.hpp, within its window only
//   judge      a marker that strays from the mean displacement of its neighbours by more than part of a step, or that
//              sits on another's dot, is not believed: nothing is reported that was not seen, no two change places
//   recover    what is lost is sought where its neighbours say that it is, in every frame. When most are lost, where
//              each was last; then in the grid found anew. After more than `longest_coast` frames in which most were not
//              seen a marker may have gone half a step: then the grid comes first, since counted from its border none
//              becomes another. (Not when the places were given to start().)
// But for that, nothing of the size of the image is touched after start().
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/optics/marker_grid.hpp"
#include "host/tracking/grid.hpp"
#include "host/tracking/locate.hpp"

namespace trocar::tracking {

struct Marker {
  bool valid{};
  double u_px{}, v_px{};               // NaN when not valid
  double score{};                      // of the last search, valid or not
  std::array<double, 3> covariance{};  // uu, uv, vv; px^2
};

struct TrackerOptions {
  optics::MarkerGrid grid{};
  Method method{Method::Edge};
  int threads{2};
  int neighbourhood_px{41};  // of the correlation
};

class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options);

  // Finds the grid in this frame, or takes these places (NaN: unknown) and this radius for where to look. Returns what is wrong, empty when
  // the grid is there: then markers() are those of this frame.
  [[nodiscard]] std::string start(const optics::Frame& frame);
  [[nodiscard]] std::string start(const optics::Frame& frame, std::vector<Place> places, double radius_px);
  // The next frame, of the same size and format. Numbers count up; a jump is a gap.
  std::span<const Marker> update(const optics::Frame& frame);

  [[nodiscard]] std::span<const Marker> markers() const noexcept { return marker_; }
  [[nodiscard]] std::size_t valid() const noexcept;
  [[nodiscard]] std::vector<Place> rest() const;  // of the first frame, or where each was first seen; NaN for one never seen
  [[nodiscard]] double radius_px() const noexcept { return radius_px_; }
  [[nodiscard]] const TrackerOptions& options() const noexcept { return options_; }

 private:
  struct Track {
    Place rest{};          // in the first frame
    Place last{};          // when last seen
    Place step{};          // from frame to frame, when last seen twice running
    std::uint64_t seen{};  // frame number
    double radius_px{};
    int sightings{};  // that the radius is a mean of; 0: only the grid's
    bool known{};     // was seen at least once
  };
  [[nodiscard]] Located locate(const optics::Frame& frame, const Place& start, double radius_px, bool known_size, Scratch& scratch) const;
  void search(const optics::Frame& frame);
  void find_again(const optics::Frame& frame, bool grid_too);
  void seek_in_new_grid(const optics::Frame& frame);
  [[nodiscard]] std::optional<Place> expected(std::size_t k) const;
  [[nodiscard]] std::size_t found() const noexcept;
  void judge();
  void keep_largest_whole();
  void recover(const optics::Frame& frame);
  void keep(std::uint64_t number);

  TrackerOptions options_;
  Gains gains_{};
  std::vector<Track> track_{};
  std::vector<Marker> marker_{};
  std::vector<Located> located_{};
  std::vector<Scratch> scratch_{};
  std::vector<std::size_t> sought_{};  // which markers to search,
  std::vector<Place> from_{};          // and where; of all markers
  std::vector<unsigned char> tried_{};
  bool detected_{};
  std::optional<Disc> disc_{};
  double radius_px_{}, step_px_{};
  std::uint64_t number_{};  // of the last frame in which most were seen
};

}  // namespace trocar::tracking
