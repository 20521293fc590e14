// Velocity from quantised positions: critically damped second-order tracking observer,
//   e = x - x_hat,  x_hat' = v_hat + 2 w e,  v_hat' = w^2 e,
// discretised exactly for x held over a step (matrix exponential of the double pole at -w), so that large w dt stays stable.
// The hold alone would read a steady velocity low by ((w dt/2) / sinh(w dt/2))^2; the output is scaled back, so that it is exact.
// A step of one encoder count disturbs the output by about w/e times the count.
#pragma once

#include <cmath>

namespace trocar::control {

struct VelocityObserverConfig {
  double bandwidth_rad_s{};
};

struct VelocityObserverState {
  double position{};
  double velocity{};
  bool started{};
};

[[nodiscard]] inline double update(const VelocityObserverConfig& config, VelocityObserverState& s, double position, double dt_s) noexcept {
  if (!s.started) {
    s = {position, 0.0, true};
    return 0.0;
  }
  // In the error coordinates e = x_hat - x, v = v_hat:  e' = v - 2 w e, v' = -w^2 e, double eigenvalue -w.
  const double w = config.bandwidth_rad_s;
  const double decay = std::exp(-w * dt_s);
  const double e = s.position - position;
  const double v = s.velocity;
  const double wt = w * dt_s;
  const double e1 = decay * (e * (1.0 - wt) + v * dt_s);
  const double v1 = decay * (v * (1.0 + wt) - w * wt * e);
  s.position = position + e1;
  s.velocity = v1;
  const double hold = wt > 0.0 ? std::sinh(wt / 2.0) / (wt / 2.0) : 1.0;
  return v1 * hold * hold;
}

}  // namespace trocar::control
