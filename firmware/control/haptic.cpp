#include "firmware/control/haptic.hpp"

namespace trocar::control {

using mechanism::Vec3;

void enter(HapticState& state, Display display, const DeviceState& device, const Vec3& u) noexcept {
  state = {};
  enter(state.display, display, device.pose, device.velocity);
  reset(state.guard);
  state.limits.last = u;
  state.begins = true;
}

void change(const HapticConfig& config, HapticState& state, Display display, const DeviceState& device) noexcept {
  change(config.display, state.display, display, device.pose, device.velocity);
  state.begins = true;
}

Vec3 update(const HapticConfig& config, HapticState& state, const DeviceState& device, const Vec3& environment_force,
            double dt_s) noexcept {
  DisplayInput in{device.pose, device.velocity, device.hand_force, environment_force, dt_s};
  if (state.begins) {
    // In terms of u, because the impedance law's own part has moved on since the last tick.
    DisplayState ahead = state.display;
    begin(state.fade, display_force(config.impedance, device, state.limits.last), update(config.display, ahead, in));
    // What fades pushes the device as a hand would; the slave feels it too, or it would run ahead. The command of an admittance
    // does not carry f_e: there the f_e of the start comes in as the old command goes.
    state.slave_push = state.fade.offset;
    if (state.display.display == Display::Admittance) state.slave_push += environment_force;
    state.begins = false;
  }
  in.hand_force += weight(config.fade, state.fade) * state.slave_push;
  const Vec3 faded = update(config.fade, state.fade, update(config.display, state.display, in), dt_s);
  const Vec3 guarded = update(config.guard, state.guard, device.pose, faded, dt_s);
  Vec3 u = update(config.limits, state.limits, impedance_force(config.impedance, device, guarded), device.velocity, dt_s);
  state.f_m = display_force(config.impedance, device, u);
  sent(state.guard, state.f_m);
  return u;
}

}  // namespace trocar::control
