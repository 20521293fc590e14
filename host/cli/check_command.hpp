// `trocar rig check`: is the machine that this runs on fit to move motors with this rig?
#pragma once

#include <atomic>
#include <string>

namespace trocar::cli {

struct RigCheckOptions {
  std::string rig;
  double seconds = 30.0;
  int cpu = -1;
  bool load{};
  bool json{};
};

// Runs `trocar-rig --check` beside this program, prints figures and verdict. 0: fit for motors; 1: only for simulation.
int rig_check(const RigCheckOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::cli
