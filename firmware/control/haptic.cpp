#include "firmware/control/haptic.hpp"

namespace trocar::control {

using mechanism::Vec3;

namespace {

Vec3 vector(const rig::Planar& p) noexcept { return {p.translation, p.translation, p.rotation}; }
LocalController local(const rig::Coupling& c) noexcept { return {vector(c.damping), vector(c.stiffness)}; }

}  // namespace

HapticConfig haptic_config(const rig::Rig& rig) noexcept {
  const rig::Haptic& h = rig.haptic;
  HapticConfig config;
  const VirtualSlave needle{vector(h.needle_mass), vector(h.needle_damping)};
  config.display.four_channel = {
      local(h.master), local(h.slave), {h.adaptive_per_force_s_m, h.adaptive_per_moment_s_rad, vector(h.adaptive_least)}, needle};
  config.display.admittance = {needle, local(h.tracking)};
  config.display.glide.duration_s = config.fade.duration_s = h.fade_s;
  config.guard.credit_j = config.guard.initial_j = h.guard_credit_j;
  config.guard.softest_n_m = h.guard_softest_n_m;
  config.guard.bound_j = h.guard_bound_j;
  config.guard.damping_n_s_m = h.guard_damping_n_s_m;
  config.impedance = {false,
                      vector(h.desired_mass),
                      vector(h.desired_damping),
                      vector(h.desired_stiffness),
                      {rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}};
  config.limits = output_limits(rig.limits);
  return config;
}

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
