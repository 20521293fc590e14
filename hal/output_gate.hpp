// The second gate before the motors, independent of the controller: whatever it is given, what leaves is finite, within the drives'
// peak torque, and zero unless everything is as it must be.
//   permille = 1000 joint_torque / (gear_ratio gear_efficiency rated_torque),   rated_torque = torque_constant continuous_current
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/rig/rig.hpp"
#include "hal/can/frame.hpp"

namespace trocar::hal {

using TorqueWords = std::array<std::int16_t, capacity::drives>;  // permille of the motor's rated torque

struct GateCounters {
  std::uint64_t closed{};      // a non-zero command met a closed gate
  std::uint64_t clamped{};     // values beyond the peak torque
  std::uint64_t not_finite{};  // commands with a NaN or an infinity: all drives got zero
};

class OutputGate {
 public:
  explicit OutputGate(const rig::Rig& rig) noexcept;
  [[nodiscard]] TorqueWords pass(const std::array<double, capacity::drives>& joint_torque_nm, bool open) noexcept;
  [[nodiscard]] double joint_torque_nm(std::size_t drive, std::int16_t permille) const noexcept {
    return permille * nm_per_permille_[drive];
  }
  [[nodiscard]] const GateCounters& counters() const noexcept { return counters_; }

 private:
  std::size_t drives_;
  std::array<double, capacity::drives> nm_per_permille_{};
  std::array<double, capacity::drives> peak_nm_{};
  GateCounters counters_{};
};

[[nodiscard]] CanFrame torque_frame(const TorqueWords& words) noexcept;

}  // namespace trocar::hal
