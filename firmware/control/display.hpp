// The selectable haptic displays. Each turns the master's motion and the environment's force into f_m, the command of the
// impedance law (impedance.hpp); signs and units as in four_channel.hpp.
//   Impedance     f_m = -f_e(x_m)                                  two channels: position there, force back
//   Admittance    M_v x_v'' + B_v x_v' = f_h - f_e(x_v),  f_m = C_t (v_v - v_m)    two channels: force there, position back;
//                 C_t's stiffness stays in series: a spring K feels like 1 / (1 / K + 1 / C_t)
//   FourChannel   four_channel.hpp
//
// A tick:  pose = slave_pose(...)  ->  the caller's environment gives f_e for it  ->  f_m = update(...).
// When the display changes, the slave starts from the master again, and the environment's pose does not jump: what it was away
// from the master glides to zero.
#pragma once

#include "common/core/contracts.hpp"
#include "firmware/control/fade.hpp"
#include "firmware/control/four_channel.hpp"

namespace trocar::control {

using trocar::Display;

struct AdmittanceConfig {
  VirtualSlave slave{};                                               // M_v, B_v
  LocalController tracking{{30.0, 30.0, 0.03}, {400.0, 400.0, 0.4}};  // C_t; ours
};

struct DisplayConfig {
  FourChannelConfig four_channel{};
  AdmittanceConfig admittance{};
  FadeConfig glide{};
};

struct DisplayState {
  Display display{Display::Impedance};
  SlaveState slave{};
  FadeState glide{};
};

// From rest or from another mode: the slave is where the master is, and moves with it.
inline void enter(DisplayState& state, Display display, const mechanism::Vec3& pose, const mechanism::Vec3& velocity) noexcept {
  state = {display, {pose, velocity}, {}};
}

// Where the environment of this tick is to be evaluated.
[[nodiscard]] mechanism::Vec3 slave_pose(const DisplayConfig& config, const DisplayState& state, const mechanism::Vec3& pose) noexcept;

// From one display to another.
inline void change(const DisplayConfig& config, DisplayState& state, Display display, const mechanism::Vec3& pose,
                   const mechanism::Vec3& velocity) noexcept {
  const mechanism::Vec3 environment_pose = slave_pose(config, state, pose);
  enter(state, display, pose, velocity);
  begin(state.glide, environment_pose, pose);
}

// f_m of this tick.
[[nodiscard]] mechanism::Vec3 update(const DisplayConfig& config, DisplayState& state, const DisplayInput& input) noexcept;

}  // namespace trocar::control
