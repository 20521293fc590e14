#include "host/report/eyes.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "common/config/csv.hpp"
#include "common/config/document.hpp"

namespace trocar::report {
namespace {

using config::Csv;

// Columns of both tables: frame,t_s,row,col,u_px,v_px,x_m,y_m, and last whether it was seen.
constexpr std::size_t frame_column = 0, time_column = 1, u_column = 4, v_column = 5, x_column = 6, y_column = 7;

std::map<double, std::size_t> first_rows(const Csv& table) {
  std::map<double, std::size_t> first;
  for (std::size_t i = 0; i < table.rows(); ++i) first.try_emplace(table(i, frame_column), i);
  return first;
}

void compare(const Csv& seen, const Csv& truth, std::size_t markers, Eyes& eyes) {
  const auto there = first_rows(truth);
  TrackedError error;
  double px2 = 0.0, m2 = 0.0;
  for (std::size_t begin = 0, f = 0; begin + markers <= seen.rows(); begin += markers, ++f) {
    const auto found = there.find(seen(begin, frame_column));
    if (found == there.end() || found->second + markers > truth.rows()) continue;
    double of_frame = 0.0;
    std::size_t n = 0;
    for (std::size_t k = 0; k < markers; ++k) {
      const std::size_t i = begin + k, j = found->second + k;
      if (std::isnan(seen(i, u_column))) continue;
      const double px = std::hypot(seen(i, u_column) - truth(j, u_column), seen(i, v_column) - truth(j, v_column));
      const double m = std::hypot(seen(i, x_column) - truth(j, x_column), seen(i, y_column) - truth(j, y_column));
      of_frame += px * px;
      m2 += m * m;
      error.worst_px = std::max(error.worst_px, px);
      error.worst_m = std::max(error.worst_m, m);
      ++n;
    }
    px2 += of_frame;
    error.places += n;
    if (n > 0) eyes.course[f].error_px = std::sqrt(of_frame / static_cast<double>(n));
  }
  if (error.places == 0) return;
  error.rms_px = std::sqrt(px2 / static_cast<double>(error.places));
  error.rms_m = std::sqrt(m2 / static_cast<double>(error.places));
  eyes.error = error;
}

}  // namespace

std::optional<Eyes> read_eyes(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "markers.toml")) return std::nullopt;
  constexpr std::int64_t most = std::int64_t{1} << 50;
  const config::Document document = config::Document::load(folder / "markers.toml");
  const config::Table t = document.root();
  const char* remedy = "as trocar track --summary writes it";
  Eyes eyes;
  eyes.source = t.text("source", remedy);
  eyes.clock = t.text("clock", remedy);
  eyes.time_uncertainty_s = t.number("time_uncertainty_s", {0.0, 1e9}, remedy);
  eyes.frames = t.integer("frames", 1, most, remedy);
  eyes.lost = t.integer("frames_lost", 0, most, remedy);
  eyes.dropped = t.integer("frames_dropped", 0, most, remedy);
  eyes.markers = t.integer("markers", 1, 40000, remedy);
  eyes.not_seen = t.integer("markers_not_seen", 0, most, remedy);
  if (eyes.frames > 1) {  // the first finds the grid
    eyes.track_s_p50 = t.number("track_s_p50", {0.0, 1e9}, remedy);
    eyes.track_s_p99 = t.number("track_s_p99", {0.0, 1e9}, remedy);
  }
  const auto markers = static_cast<std::size_t>(eyes.markers);
  const Csv seen = Csv::load(folder / "markers.csv", {"frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid"}, config::NotANumber::Allowed);
  if (seen.rows() % markers != 0) seen.fail(seen.rows() - 1, "ends within a frame; track the run anew");
  std::vector<double> x0(markers, std::nan("")), y0(markers, std::nan(""));
  for (std::size_t begin = 0; begin < seen.rows(); begin += markers) {
    SeenFrame frame{.t_s = seen(begin, time_column)};
    std::size_t n = 0;
    for (std::size_t k = 0; k < markers; ++k) {
      const double x = seen(begin + k, x_column), y = seen(begin + k, y_column);
      if (std::isnan(x) || std::isnan(y)) continue;
      if (std::isnan(x0[k])) {
        x0[k] = x;
        y0[k] = y;
      }
      const double moved = std::hypot(x - x0[k], y - y0[k]);
      frame.displacement_m += moved;
      eyes.most_displacement_m = std::max(eyes.most_displacement_m, moved);
      ++n;
    }
    if (n > 0) frame.displacement_m /= static_cast<double>(n);
    eyes.course.push_back(frame);
  }
  if (std::filesystem::exists(folder / "markers_truth.csv"))
    compare(seen, Csv::load(folder / "markers_truth.csv", {"frame,t_s,row,col,u_px,v_px,x_m,y_m,visible"}), markers, eyes);
  if (std::filesystem::exists(folder / "markers.jpg")) eyes.picture = folder / "markers.jpg";
  return eyes;
}

}  // namespace trocar::report
