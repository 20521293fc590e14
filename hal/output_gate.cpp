#include "hal/output_gate.hpp"

#include <algorithm>
#include <cmath>

#include "hal/canopen/drive_setup.hpp"
#include "hal/canopen/objects.hpp"

namespace trocar::hal {

OutputGate::OutputGate(const rig::Rig& rig) noexcept : drives_{rig.drives()} {
  for (std::size_t i = 0; i < drives_; ++i) {
    nm_per_permille_[i] = rig.actuation.joint_torque_nm(rig.actuation.continuous_current_a, i) / 1000.0;
    // The word itself ends at 32.767 times the rated torque.
    peak_nm_[i] = std::min(rig.actuation.joint_torque_nm(rig.actuation.peak_current_a, i), 32767.0 * nm_per_permille_[i]);
  }
}

TorqueWords OutputGate::pass(const std::array<double, capacity::drives>& joint_torque_nm, bool open) noexcept {
  TorqueWords words{};
  bool finite = true;
  bool zero = true;
  for (std::size_t i = 0; i < drives_; ++i) {
    finite = finite && std::isfinite(joint_torque_nm[i]);
    zero = zero && joint_torque_nm[i] == 0.0;
  }
  if (!finite) {
    ++counters_.not_finite;
    return words;
  }
  if (!open) {
    if (!zero) ++counters_.closed;
    return words;
  }
  for (std::size_t i = 0; i < drives_; ++i) {
    const double limited = std::clamp(joint_torque_nm[i], -peak_nm_[i], peak_nm_[i]);
    if (limited != joint_torque_nm[i]) ++counters_.clamped;
    if (nm_per_permille_[i] > 0) words[i] = static_cast<std::int16_t>(std::lround(limited / nm_per_permille_[i]));
  }
  return words;
}

CanFrame torque_frame(const TorqueWords& words) noexcept {
  CanFrame frame{.id = canopen::cob_torque, .length = 8};
  for (std::size_t i = 0; i < words.size(); ++i) store(frame, 2 * i, words[i]);
  return frame;
}

}  // namespace trocar::hal
