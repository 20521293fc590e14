// `trocar track`: frames in, markers.csv out.
//   frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid      a row for each marker of each frame; nan where it was not seen, valid 0 or 1.
//   A frame that was lost has no rows.
// t_s: on the source's clock (host/camera/source.hpp); a camera's own clock counts from its first frame.
// x_m, y_m: in the phantom's frame (optics/marker_grid.hpp). The plane's pose comes from --pose, or from the first frame's markers.
// Written frame by frame: what is there when something breaks stays. With a DDS domain (source_options.domain) published frame by frame
// too. The summary is TOML.
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/optics/camera_file.hpp"
#include "host/camera/source.hpp"
#include "host/tracking/metric.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {

// One frame's markers.
struct TrackedFrame {
  std::uint64_t number{};
  std::int64_t time_ns{}, time_uncertainty_ns{};
  camera::Clock clock{};
  std::span<const Marker> markers{};
  std::span<const MetricMarker> metric{};
  camera::SourceCounters counters{};
  double track_ms{};  // from the frame in hand to its markers
};

struct TrackOptions {
  std::vector<std::string> source{};
  camera::SourceOptions source_options{};
  std::filesystem::path camera{};
  TrackerOptions tracker{};
  std::vector<double> corners_px{};  // u, v of (first row, first column), (first, last), (last, last), (last, first); empty: found
  bool known_diameter{};             // grid.diameter_m was given: --corners looks for dots of that size, else of a third of the spacing
  std::filesystem::path pose{};
  std::filesystem::path out{}, covariance{}, picture{}, pose_out{}, summary{};
  double picture_scale{1.0};
  bool live{};  // wait for the grid instead of ending when the first frame does not show it
  bool json{};
};

// "u,v" four times, into numbers; what is wrong, else empty.
[[nodiscard]] std::string parse_corners(const std::vector<std::string>& texts, std::vector<double>& corners_px);

// Exit code: 1 when the camera was lost. Throws config::UserError; what was written before stays, and nothing is written when the grid was
// never found.
int run_track(const TrackOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::tracking
