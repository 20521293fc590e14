#include "firmware/control/passivity.hpp"

#include <algorithm>

namespace trocar::control {

using mechanism::Vec3;

Vec3 update(const PassivityConfig& config, PassivityState& state, const Vec3& pose, const Vec3& velocity, const Vec3& f_m,
            double dt_s) noexcept {
  const std::size_t delay = std::min(config.delay_ticks, most_delay_ticks);
  if (!state.started) {
    reset(state);
    state.started = true;
    state.pose = pose;
  }
  state.energy_j = std::min(state.energy_j - state.sent[delay].dot(pose - state.pose), config.credit_j);
  state.pose = pose;

  Vec3 under_way = f_m;
  for (std::size_t i = 0; i < delay; ++i) under_way += state.sent[i];
  const double forecast_j = state.energy_j - dt_s * under_way.dot(velocity);
  const Vec3 weighed{velocity[0], velocity[1], config.arm_m * config.arm_m * velocity[2]};
  const double per_damping_j = dt_s * velocity.dot(weighed);
  state.damping_n_s_m = 0.0;
  if (!config.active || !(forecast_j < 0.0) || !(per_damping_j > 0.0)) return f_m;
  state.damping_n_s_m = std::min(-forecast_j / per_damping_j, config.damping_n_s_m);
  state.dissipated_j += state.damping_n_s_m * per_damping_j;
  ++state.acted;
  if (-forecast_j > config.damping_n_s_m * per_damping_j) ++state.limited;
  return f_m - state.damping_n_s_m * weighed;
}

void sent(PassivityState& state, const Vec3& f_m) noexcept {
  std::copy_backward(state.sent.begin(), state.sent.end() - 1, state.sent.end());
  state.sent[0] = f_m;
}

}  // namespace trocar::control
