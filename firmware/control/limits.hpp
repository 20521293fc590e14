// Last word on a haptic law's wrench u (N, N, N m), after the passivity guard: velocity, then force, then slew.
//   velocity   what would speed the handle up is taken away in proportion from `speed` on, wholly from `full_speed` on;
//              what brakes stays
//   force      |u_xy| <= force, |u_theta| <= moment; the direction in the plane is kept
//   slew       |change of u_xy| <= force_slew dt, |change of u_theta| <= moment_slew dt
// Slew last: between two wrenches within the force limit every one is. It may leave a braking to the next ticks. The joints have
// limits of their own behind this (safety/output_gate.hpp). NaN is not caught here but there.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "common/mechanism/types.hpp"
#include "common/rig/rig.hpp"

namespace trocar::control {

struct OutputLimits {
  double force_n{};
  double moment_nm{};
  double force_slew_n_per_s{};
  double moment_slew_nm_per_s{};
  double speed_m_s{};
  double full_speed_m_s{};
  double angular_speed_rad_s{};
  double full_angular_speed_rad_s{};
};

// Of a rig: force and moment are its command limits, reached from zero in 10 ms (a step of contact, not a shock);
// speeds begin at half and end at nine tenths of those that latch a fault.
[[nodiscard]] inline OutputLimits output_limits(const rig::Limits& rig) noexcept {
  constexpr double rise_s = 0.01, begin = 0.5, end = 0.9;
  return {
      rig.command_force_n,         rig.command_moment_nm,     rig.command_force_n / rise_s,          rig.command_moment_nm / rise_s,
      begin * rig.fault_speed_m_s, end * rig.fault_speed_m_s, begin * rig.fault_angular_speed_rad_s, end * rig.fault_angular_speed_rad_s};
}

struct LimitState {
  mechanism::Vec3 last = mechanism::Vec3::Zero();  // u of the last tick
  std::uint64_t force{}, slew{}, velocity{};       // ticks in which each acted
};

// u that may be sent.
[[nodiscard]] inline mechanism::Vec3 update(const OutputLimits& limits, LimitState& state, const mechanism::Vec3& wanted,
                                            const mechanism::Vec3& velocity, double dt_s) noexcept {
  using mechanism::Vec2;
  Vec2 force = wanted.head<2>();
  double moment = wanted[2];

  const auto left = [](double speed, double from, double to) noexcept {
    return speed <= from ? 1.0 : std::clamp((to - speed) / (to - from), 0.0, 1.0);
  };
  const Vec2 v = velocity.head<2>();
  const double speed = v.norm();
  const double power = force.dot(v);
  const double keep = left(speed, limits.speed_m_s, limits.full_speed_m_s);
  const double keep_turning = left(std::abs(velocity[2]), limits.angular_speed_rad_s, limits.full_angular_speed_rad_s);
  const bool slows = keep < 1.0 && power > 0.0;
  const bool slows_turning = keep_turning < 1.0 && moment * velocity[2] > 0.0;
  if (slows) force -= (1.0 - keep) * power / (speed * speed) * v;
  if (slows_turning) moment *= keep_turning;
  state.velocity += slows || slows_turning ? 1u : 0u;

  const double size = force.norm();
  const bool too_much = size > limits.force_n || std::abs(moment) > limits.moment_nm;
  if (size > limits.force_n) force *= limits.force_n / size;
  moment = std::clamp(moment, -limits.moment_nm, limits.moment_nm);
  state.force += too_much ? 1u : 0u;

  const Vec2 change = force - state.last.head<2>();
  const double step = limits.force_slew_n_per_s * dt_s;
  const double step_turning = limits.moment_slew_nm_per_s * dt_s;
  const double size_of_change = change.norm();
  const bool too_fast = size_of_change > step || std::abs(moment - state.last[2]) > step_turning;
  if (size_of_change > step) force = state.last.head<2>() + step / size_of_change * change;
  moment = std::clamp(moment, state.last[2] - step_turning, state.last[2] + step_turning);
  state.slew += too_fast ? 1u : 0u;

  state.last = {force[0], force[1], moment};
  return state.last;
}

}  // namespace trocar::control
