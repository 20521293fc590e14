// The selectable haptic displays. Each turns the master's motion and the environment's force into f_m, the command of the
// impedance law (impedance.hpp); signs and units as in four_channel.hpp.
//   Impedance     f_m = -f_e(x_m)                                  two channels: position there, force back
//   Admittance    M_v x_v'' + B_v x_v' = f_h - f_e(x_v),  f_m = C_t (v_v - v_m)    two channels: force there, position back
//   FourChannel   four_channel.hpp
//
// A tick:  pose = slave_pose(...)  ->  the caller's environment gives f_e for it  ->  f_m = update(...).
// The environment's pose never jumps, also when the display changes: whatever the slave is away from the master when
// Impedance begins glides to zero.
#pragma once

#include "common/core/contracts.hpp"
#include "firmware/control/fade.hpp"
#include "firmware/control/four_channel.hpp"

namespace trocar::control {

struct AdmittanceConfig {
  VirtualSlave slave{};                                               // M_v, B_v
  LocalController tracking{{30.0, 30.0, 0.03}, {800.0, 800.0, 0.8}};  // C_t; ours
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

// From one display to another: the slave stays where it is.
inline void change(DisplayState& state, Display display, const mechanism::Vec3& pose) noexcept {
  state.display = display;
  begin(state.glide, state.slave.pose, pose);
}

// Where the environment of this tick is to be evaluated.
[[nodiscard]] mechanism::Vec3 slave_pose(const DisplayConfig& config, const DisplayState& state, const mechanism::Vec3& pose) noexcept;

// f_m of this tick.
[[nodiscard]] mechanism::Vec3 update(const DisplayConfig& config, DisplayState& state, const DisplayInput& input) noexcept;

}  // namespace trocar::control
