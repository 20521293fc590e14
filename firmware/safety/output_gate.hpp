// First gate before the motors: finite, within the drive's peak torque, within the slew limit. (The second is in hal::RigLink.)
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "common/rig/rig.hpp"

namespace trocar::safety {

using JointTorques = std::array<double, capacity::drives>;

struct GateState {
  JointTorques last_nm{};
  std::uint64_t limited{};     // ticks in which a magnitude or slew limit acted
  std::uint64_t not_finite{};  // ticks refused for a NaN or infinity
};

// Torques that may be sent. When one value is not finite, all are zero and false is returned.
[[nodiscard]] inline bool pass(const rig::Rig& rig, GateState& state, const JointTorques& wanted_nm, double dt_s,
                               JointTorques& out_nm) noexcept {
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    if (!std::isfinite(wanted_nm[i])) {
      ++state.not_finite;
      out_nm = {};
      state.last_nm = {};
      return false;
    }
  }
  bool limited = false;
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    const double peak = rig.actuation.joint_torque_nm(rig.actuation.peak_current_a, i);
    const double step = rig.limits.torque_slew_nm_per_s * dt_s;
    const double bounded = std::clamp(wanted_nm[i], -peak, peak);
    out_nm[i] = std::clamp(bounded, state.last_nm[i] - step, state.last_nm[i] + step);
    limited = limited || out_nm[i] != wanted_nm[i];
  }
  state.limited += limited ? 1u : 0u;
  state.last_nm = out_nm;
  return true;
}

}  // namespace trocar::safety
