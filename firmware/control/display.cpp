#include "firmware/control/display.hpp"

#include <algorithm>

namespace trocar::control {

using mechanism::Vec3;

namespace {

// Backward Euler in B_v, f_e at the pose of this tick as in four_channel.
Vec3 admittance(const AdmittanceConfig& config, SlaveState& slave, const DisplayInput& in) noexcept {
  Vec3 f_m =
      config.tracking.damping.cwiseProduct(slave.velocity - in.velocity) + config.tracking.stiffness.cwiseProduct(slave.pose - in.pose);
  const Vec3 push = config.slave.mass.cwiseProduct(slave.velocity) / in.dt_s + in.hand_force - in.environment_force;
  slave.velocity = push.cwiseQuotient(config.slave.mass / in.dt_s + config.slave.damping);
  slave.pose += in.dt_s * slave.velocity;
  return f_m;
}

}  // namespace

Vec3 slave_pose(const DisplayConfig& config, const DisplayState& state, const Vec3& pose) noexcept {
  const Vec3& slave = state.display == Display::Impedance ? pose : state.slave.pose;
  return slave + weight(config.glide, state.glide) * state.glide.offset;
}

Vec3 update(const DisplayConfig& config, DisplayState& state, const DisplayInput& in) noexcept {
  state.glide.time_s = std::min(state.glide.time_s + in.dt_s, config.glide.duration_s);
  switch (state.display) {
    case Display::Admittance:
      return admittance(config.admittance, state.slave, in);
    case Display::FourChannel:
      return update(config.four_channel, state.slave, in);
    case Display::Impedance:
      break;
  }
  return -in.environment_force;
}

}  // namespace trocar::control
