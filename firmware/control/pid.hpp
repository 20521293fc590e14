// PID of one axis with anti-windup (thesis A.3, figure A.5: axes independent).
//   u = Kp e + I + Kd e',  I' = Ki e, and I stays within what the output limit leaves: u saturates, I does not run away.
#pragma once

#include <algorithm>

#include "common/rig/rig.hpp"

namespace trocar::control {

struct PidState {
  double integral{};  // N or N m
};

// error, error_rate: setpoint minus measurement. limit > 0: |u| stays within it.
[[nodiscard]] inline double update(const rig::AxisGains& gains, PidState& state, double error, double error_rate, double limit,
                                   double dt_s) noexcept {
  const double without_integral = gains.proportional * error + gains.derivative * error_rate;
  const double grown = state.integral + gains.integral * error * dt_s;
  // Integrate freely inside the limit; at the limit only towards the inside.
  const double u = without_integral + grown;
  if ((u <= limit || grown < state.integral) && (u >= -limit || grown > state.integral)) state.integral = std::clamp(grown, -limit, limit);
  return std::clamp(without_integral + state.integral, -limit, limit);
}

}  // namespace trocar::control
