// A coordinate under a known and an unknown acceleration, x'' = a + d: finds d and x' from samples of x. The kernel of the Nicosia
// observer (force_observer.hpp), where a is what the motors make of a known inertia and d what an external force makes of it.
//   continuous  e = x - x_hat,  x_hat' = v + 2 zeta w e,  v' = a + w^2 e      e'' + 2 zeta w e' + w^2 e = d,  d_hat = w^2 e
// zeta = 1/sqrt(2), Butterworth: w is the -3 dB bandwidth of d_hat. 90 % of a step takes 2.65/w and the lag behind a ramp is 1.41/w; a
// double pole (3.89/w) that answers as soon lags as much and makes twice the force of an encoder count.
// Discretised exactly for a and d held over a step of T: x moves by T x' + T^2/2 (a + d), and the poles of the error are those of the
// matrix exponential of the line above, z^2 - a1 z + a0 with a0 = exp(-2 zeta w T), a1 = 2 sqrt(a0) cos(sqrt(1 - zeta^2) w T), whatever w T
// is. With x_hat, v predicted to the sample and b = 1 - a1 + a0:
//   e = x - x_hat,  d_hat = b/T^2 e,  x'_hat = v + k e,  k T = 2 - a1 - b/2;   then  x_hat += (1 - a0) e,  v += b/T e
// Constant d: d_hat = d and x'_hat = x' exactly once the transient has gone, at any w T; constant speed: e = 0. (Holding x over the step
// instead, as one does with coarse integration, reads M w^2 v T/2 too much at speed v: newtons at 390 rad/s, 1 kHz and 0.1 m/s.)
// Step of d at rest, sample n, c = w n T/sqrt(2):  d_hat = d (1 - exp(-c) (cos c + sinh(c/n)/sin(c/n) sin c)); T -> 0 is the continuous
// one.
#pragma once

#include <cmath>
#include <numbers>

namespace trocar::control {

inline constexpr double observer_damping = 1.0 / std::numbers::sqrt2;  // zeta

// For one tick and all coordinates.
struct DisturbanceGains {
  double step_s{};
  double a0{}, a1{}, b{};  // as above
};

[[nodiscard]] inline DisturbanceGains disturbance_gains(double bandwidth_rad_s, double step_s) noexcept {
  const double angle = observer_damping * bandwidth_rad_s * step_s;  // decay and turn of a tick are alike at this damping
  const double size = std::exp(-angle), less = -std::expm1(-angle), half = std::sin(0.5 * angle);
  return {step_s, size * size, 2.0 * size * std::cos(angle), less * less + 4.0 * size * half * half};
}

struct DisturbanceState {
  double position{};  // x_hat, v after the last sample
  double velocity{};
  bool started{};  // by the first sample, at rest
};

struct DisturbanceEstimate {
  double error{};         // e
  double acceleration{};  // d_hat
  double velocity{};      // x'_hat, at the sample
};

// `known_acceleration` has acted for the gains' step_s > 0 until `position` was sampled.
[[nodiscard]] inline DisturbanceEstimate update(const DisturbanceGains& gains, DisturbanceState& s, double position,
                                                double known_acceleration) noexcept {
  if (!s.started) {
    s = {position, 0.0, true};
    return {};
  }
  const double T = gains.step_s;
  const double predicted = s.position + T * (s.velocity + 0.5 * T * known_acceleration);
  const double v = s.velocity + T * known_acceleration;
  const double e = position - predicted;
  s.position = predicted + (1.0 - gains.a0) * e;
  s.velocity = v + gains.b / T * e;
  return {e, gains.b / (T * T) * e, v + (2.0 - gains.a1 - 0.5 * gains.b) / T * e};
}

}  // namespace trocar::control
