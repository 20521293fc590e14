// What a camera saw of a run, from the files that trocar track left beside its samples: markers.toml, markers.csv, markers.jpg; and what a
// simulation knew better, markers_truth.csv.
#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace trocar::report {

struct SeenFrame {
  double t_s{};                                               // as in markers.csv
  double displacement_m{};                                    // mean of the markers seen, from where they were first seen
  double error_px{std::numeric_limits<double>::quiet_NaN()};  // RMS against the truth
};

struct TrackedError {  // tracked place less true place
  std::size_t places{};
  double rms_px{}, worst_px{}, rms_m{}, worst_m{};
};

struct Eyes {
  std::string source{}, clock{};  // "rig": times of markers.csv are the controller's
  double time_uncertainty_s{};    // largest of a frame
  std::int64_t frames{}, lost{}, dropped{}, markers{}, not_seen{};
  double track_s_p50{}, track_s_p99{};
  double most_displacement_m{};  // of a marker
  std::vector<SeenFrame> course{};
  std::optional<TrackedError> error{};
  std::filesystem::path picture{};  // empty: none
};

// Nothing when the folder holds no markers.toml. Throws config::UserError for files that are not what they should be.
[[nodiscard]] std::optional<Eyes> read_eyes(const std::filesystem::path& folder);

}  // namespace trocar::report
