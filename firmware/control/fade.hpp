// Bumpless change from one law to another: the first output is the last one of before, and the difference fades to zero.
//   out = law + (last - law at the start) (1 - s(t / T)),  s(p) = p^2 (3 - 2 p)
// The new law's feedback acts whole from the first tick; only its offset is faded. A tick moves the output by at most
// 1.5 |last - law| dt / T beyond what the law moves: 0.05 N at 1 kHz and T = 0.5 s allow a difference of 16 N.
#pragma once

#include <algorithm>

#include "common/mechanism/types.hpp"

namespace trocar::control {

struct FadeConfig {
  double duration_s{0.5};  // T; 0 switches at once
};

struct FadeState {
  mechanism::Vec3 offset = mechanism::Vec3::Zero();
  double time_s{};
};

// `last`: what the output was; `law`: what the new law gives this tick.
inline void begin(FadeState& state, const mechanism::Vec3& last, const mechanism::Vec3& law) noexcept { state = {last - law, 0.0}; }

// Weight of the offset in the next update: 1 at the start, 0 from the end on.
[[nodiscard]] inline double weight(const FadeConfig& config, const FadeState& state) noexcept {
  if (!(state.time_s < config.duration_s)) return 0.0;
  const double p = state.time_s / config.duration_s;
  return 1.0 - p * p * (3.0 - 2.0 * p);
}

[[nodiscard]] inline mechanism::Vec3 update(const FadeConfig& config, FadeState& state, const mechanism::Vec3& law, double dt_s) noexcept {
  mechanism::Vec3 out = law + weight(config, state) * state.offset;
  state.time_s = std::min(state.time_s + dt_s, config.duration_s);
  return out;
}

}  // namespace trocar::control
