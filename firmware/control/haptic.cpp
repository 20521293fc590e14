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

void change(HapticState& state, Display display, const DeviceState& device) noexcept {
  change(state.display, display, device.pose);
  state.begins = true;
}

Vec3 update(const HapticConfig& config, HapticState& state, const DeviceState& device, const Vec3& environment_force,
            double dt_s) noexcept {
  const Vec3 law = update(config.display, state.display, {device.pose, device.velocity, device.hand_force, environment_force, dt_s});
  // In terms of u, because the impedance law's own part has moved on since the last tick.
  if (state.begins) begin(state.fade, display_force(config.impedance, device, state.limits.last), law);
  state.begins = false;
  const Vec3 faded = update(config.fade, state.fade, law, dt_s);
  const Vec3 guarded = update(config.guard, state.guard, device.pose, device.velocity, faded, dt_s);
  const Vec3 u = update(config.limits, state.limits, impedance_force(config.impedance, device, guarded), device.velocity, dt_s);
  state.f_m = display_force(config.impedance, device, u);
  sent(state.guard, state.f_m);
  return u;
}

}  // namespace trocar::control
