// The chain of a haptic tick, in causal order:
//   display (f_m) -> fade -> passivity guard -> impedance law (u) -> velocity, force and slew limits
// Signs and units as in the parts: f_h hand on mechanism, f_e slave on environment, u motors on mechanism.
#pragma once

#include "firmware/control/display.hpp"
#include "firmware/control/fade.hpp"
#include "firmware/control/impedance.hpp"
#include "firmware/control/limits.hpp"
#include "firmware/control/passivity.hpp"

namespace trocar::control {

struct HapticConfig {
  DisplayConfig display{};
  FadeConfig fade{};
  PassivityConfig guard{};
  ImpedanceConfig impedance{};
  OutputLimits limits{};
};

// As the rig file asks for it.
[[nodiscard]] HapticConfig haptic_config(const rig::Rig& rig) noexcept;

struct HapticState {
  DisplayState display{};
  FadeState fade{};
  PassivityState guard{};
  LimitState limits{};
  bool begins{};                                         // the next update is the first of a display
  mechanism::Vec3 slave_push = mechanism::Vec3::Zero();  // fades with the offset
  mechanism::Vec3 f_m = mechanism::Vec3::Zero();         // sent, as the display's port has it
};

// From another mode whose last wrench was u: the first output is u again (within the limits). The guard starts at zero energy.
void enter(HapticState& state, Display display, const DeviceState& device, const mechanism::Vec3& u) noexcept;

// To another display while one runs.
void change(const HapticConfig& config, HapticState& state, Display display, const DeviceState& device) noexcept;

// Where to evaluate f_e for this tick.
[[nodiscard]] inline mechanism::Vec3 slave_pose(const HapticConfig& config, const HapticState& state, const DeviceState& device) noexcept {
  return slave_pose(config.display, state.display, device.pose);
}

// u of this tick.
[[nodiscard]] mechanism::Vec3 update(const HapticConfig& config, HapticState& state, const DeviceState& device,
                                     const mechanism::Vec3& environment_force, double dt_s) noexcept;

}  // namespace trocar::control
