#include "firmware/control/passivity.hpp"

#include <algorithm>

#include "firmware/control/hysteresis.hpp"

namespace trocar::control {

using mechanism::Vec3;

Vec3 update(const PassivityConfig& config, PassivityState& state, const Vec3& pose, const Vec3& f_m, double dt_s) noexcept {
  const std::size_t delay = std::min(config.delay_ticks, most_delay_ticks);
  if (!state.started) {
    reset(state);
    state.started = true;
    state.energy_j = config.initial_j;
    state.pose = state.held = state.counted = pose;
  }
  state.pending_j -= state.sent[delay].cwiseProduct(pose - state.pose);
  state.pose = pose;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double held = hysteresis(state.held[i], pose[i], config.step[i]);
    if (held != state.held[i]) {
      state.energy_j += state.pending_j[i];
      state.counted[i] = pose[i];
    }
    if (pose[i] == state.counted[i]) state.pending_j[i] = 0.0;
    state.held[i] = held;
  }
  const Vec3& f = state.sent[delay];
  const double weighed_force = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] / (config.arm_m * config.arm_m);
  state.energy_j = std::min(state.energy_j, config.credit_j + weighed_force / (2.0 * config.softest_n_m));
  Vec3 velocity;
  for (Eigen::Index i = 0; i < 3; ++i)
    velocity[i] = update(VelocityObserverConfig{config.bandwidth_rad_s}, state.velocity[static_cast<std::size_t>(i)], state.held[i], dt_s);

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
