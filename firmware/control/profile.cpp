#include "firmware/control/profile.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::control {

namespace {

PathState advance(const PathState& s, double jerk, double t) noexcept {
  return {s.position + t * (s.velocity + t * (s.acceleration / 2.0 + t * jerk / 6.0)), s.velocity + t * (s.acceleration + t * jerk / 2.0),
          s.acceleration + t * jerk};
}

// Time of a velocity change from rest to `velocity` at zero acceleration on both ends.
double ramp_time(double velocity, const PathLimits& limits) noexcept {
  const double full = limits.acceleration * limits.acceleration / limits.jerk;
  return velocity <= full ? 2.0 * std::sqrt(velocity / limits.jerk) : velocity / limits.acceleration + limits.acceleration / limits.jerk;
}

}  // namespace

void Profile::append(double duration_s, double jerk) noexcept {
  if (duration_s <= 0.0) return;
  piece_[pieces_++] = {duration_s, jerk};
  end_ = advance(end_, jerk, duration_s);
  duration_s_ += duration_s;
}

// Three pieces: jerk to the peak acceleration, hold it, jerk back to zero. With d the direction of the change and a_p the peak,
// v1 - v0 = d (a_p^2 - a0^2)/(2 j) + a_p t2 + d a_p^2/(2 j).
void Profile::append_velocity_change(double v0, double a0, double v1, const PathLimits& limits) noexcept {
  const double j = limits.jerk;
  const double v_if_released = v0 + a0 * std::abs(a0) / (2.0 * j);
  const double d = v1 >= v_if_released ? 1.0 : -1.0;
  double peak = std::sqrt(std::max(0.0, d * j * (v1 - v0) + a0 * a0 / 2.0));
  double hold_s = 0.0;
  // A start beyond the limit (a brake at tighter limits) keeps its acceleration as the peak.
  const double ceiling = std::max(limits.acceleration, d * a0);
  if (peak > ceiling) {
    peak = ceiling;
    hold_s = (d * (v1 - v0) - (2.0 * peak * peak - a0 * a0) / (2.0 * j)) / peak;
  }
  append((peak - d * a0) / j, d * j);
  append(hold_s, 0.0);
  append(peak / j, -d * j);
}

Profile Profile::rest_to_rest(double distance, const PathLimits& limits) noexcept {
  Profile p;
  if (!(distance > 0.0)) return p;
  double v = limits.velocity;
  if (v * ramp_time(v, limits) > distance) {
    // Never reaches the velocity limit: v ramp_time(v) = distance, first without, then with a piece at full acceleration.
    const double a = limits.acceleration;
    const double j = limits.jerk;
    v = std::cbrt(distance * distance * j / 4.0);
    if (v > a * a / j) {
      const double b = a * a / j;
      v = (std::sqrt(b * b + 4.0 * a * distance) - b) / 2.0;
    }
  }
  p.append_velocity_change(0.0, 0.0, v, limits);
  p.append((distance - v * ramp_time(v, limits)) / v, 0.0);
  p.append_velocity_change(v, 0.0, 0.0, limits);
  p.end_ = {distance, 0.0, 0.0};
  return p;
}

Profile Profile::brake(const PathState& start, const PathLimits& limits) noexcept {
  Profile p;
  p.start_ = start;
  p.end_ = start;
  p.append_velocity_change(start.velocity, start.acceleration, 0.0, limits);
  p.end_.velocity = 0.0;
  p.end_.acceleration = 0.0;
  return p;
}

PathState Profile::at(double time_s) const noexcept {
  PathState s = start_;
  if (time_s >= duration_s_) return end_;
  for (std::size_t i = 0; i < pieces_ && time_s > 0.0; ++i) {
    const double t = std::min(time_s, piece_[i].duration_s);
    s = advance(s, piece_[i].jerk, t);
    time_s -= t;
  }
  return s;
}

}  // namespace trocar::control
