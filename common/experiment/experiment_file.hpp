// experiment.toml -> Experiment, and run.toml, which a run leaves in its folder so that a report can be made from it later.
//
//   experiment.toml: kind = "insertion" (or nothing) | "haptic", name, rig, scene, plant (of a simulated rig)
//     insertion: speeds_m_s = [...], depth_m, standoff_m, lane_spacing_m, approach_speed_m_s, touch_speed_m_s, touch_force_n,
//       withdraw_speed_m_s, dwell_s, thesis_check (or false), thesis_speed_m_s (or 0.005)
//     haptic: hand (of a simulated rig), displays = ["four_channel" | "impedance" | "admittance", ...], display_s (of each), take_s
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "common/experiment/experiment.hpp"

namespace trocar::experiment {

[[nodiscard]] Experiment read_experiment(const std::filesystem::path& file);
// What a command line says instead of the file, unless empty: insertion speeds, the hand. Throws config::UserError when the experiment is
// not of the kind that has them.
void replace(Experiment& experiment, const std::vector<double>& speeds_m_s, const std::string& hand);

struct Run {
  std::string experiment, rig, scene;
  bool haptic{};
  bool lockstep{};
  Placement placement{};
  double thesis_stiffness_n_per_m{};  // proportional gain of the gain set "thesis", 0 without one
  double simulated_s{};
  double wall_s{};
  bool completed{};
  std::string outcome;  // why not, when not completed
  std::vector<Phase> phases;
  std::vector<std::string> notes;
};

void write_run(const std::filesystem::path& folder, const Run& run);  // FOLDER/run.toml, written aside and renamed
[[nodiscard]] Run read_run(const std::filesystem::path& folder);

}  // namespace trocar::experiment
