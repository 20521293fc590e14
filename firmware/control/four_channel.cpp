#include "firmware/control/four_channel.hpp"

#include <cmath>

namespace trocar::control {

using mechanism::Vec3;

Vec3 adaptive_damping(const AdaptiveDamping& config, const Vec3& environment_force) noexcept {
  const double force = config.per_force_s_m * environment_force.head<2>().norm();
  return config.least + Vec3(force, force, config.per_moment_s_rad * std::abs(environment_force[2]));
}

Vec3 update(const FourChannelConfig& config, SlaveState& slave, const DisplayInput& in) noexcept {
  Vec3 f_m = config.master.damping.cwiseProduct(slave.velocity - in.velocity) + config.master.stiffness.cwiseProduct(slave.pose - in.pose) -
             in.environment_force;

  // Backward Euler against the master's pose of the next tick, for v the slave's velocity there:
  //   (M_s/dt + B + B_s + dt K) v = M_s/dt v_s + B v_m + K (x_m + dt v_m - x_s) + f_h - f_e,   B = damping of C_s + B_a
  const double dt = in.dt_s;
  const Vec3 damping = config.slave.damping + adaptive_damping(config.adaptive, in.environment_force);
  const Vec3& stiffness = config.slave.stiffness;
  const Vec3 push = config.needle.mass.cwiseProduct(slave.velocity) / dt + damping.cwiseProduct(in.velocity) +
                    stiffness.cwiseProduct(in.pose + dt * in.velocity - slave.pose) + in.hand_force - in.environment_force;
  slave.velocity = push.cwiseQuotient(config.needle.mass / dt + damping + config.needle.damping + dt * stiffness);
  slave.pose += dt * slave.velocity;
  return f_m;
}

}  // namespace trocar::control
