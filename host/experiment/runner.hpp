// Runs an experiment on a rig over DDS: sequencer in the middle, one line of progress for a person.
#pragma once

#include <atomic>
#include <functional>
#include <string>

#include "common/experiment/experiment.hpp"
#include "common/experiment/experiment_file.hpp"
#include "common/rig/rig.hpp"

namespace trocar::host {

// Everything that an experiment needs to know, read and cross-checked.
struct ExperimentSetup {
  experiment::Experiment experiment;
  rig::Rig rig;
  experiment::Placement placement;
  std::filesystem::path rig_file, scene_file;
  double thesis_stiffness_n_per_m{};
};
// `speeds_m_s` and `hand` replace the file's when they are not empty.
[[nodiscard]] ExperimentSetup read_setup(const std::string& experiment, const std::vector<double>& speeds_m_s, const std::string& hand);

struct Progress {
  std::string phase;
  double fraction{};  // 0 … 1
  double remaining_s{};
  double depth_mm{};
  double force_n{};      // along the needle, of the virtual one in Haptic
  double tick_p99_us{};  // over the last second
  Mode mode{};
  std::uint64_t faults{};
};

// A run that failed comes back with completed = false and the outcome; the rig is then left in hold or in its fault reaction.
// Throws config::UserError when it cannot start (no rig, another commander).
[[nodiscard]] experiment::Run run_experiment(const ExperimentSetup& setup, std::uint32_t domain, const std::atomic<bool>& stop,
                                             const std::function<void(const Progress&)>& show);

}  // namespace trocar::host
