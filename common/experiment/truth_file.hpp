// truth.csv: what only a simulation knows of a run, beside its samples.csv, so that a report can judge what the controller estimated.
// One row a tick, at the moment whose positions the tick's sample has.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "common/config/new_file.hpp"

namespace trocar::experiment {

struct Truth {
  std::uint64_t tick{};
  std::int64_t time_ns{};
  std::array<double, 3> hand_wrench{};  // N, N, N m of the hand on the handle, rig frame
  std::array<double, 3> pose{};         // x_m, y_m, theta_rad of the handle
};

// Written aside; finish() gives it its name, and without finish() nothing stays behind.
class TruthFile {
 public:
  explicit TruthFile(const std::filesystem::path& file);
  void write(const Truth& truth);
  void finish() { file_.keep(); }

 private:
  config::NewFile file_;
};

// Throws config::UserError.
[[nodiscard]] std::vector<Truth> read_truth(const std::filesystem::path& file);

}  // namespace trocar::experiment
