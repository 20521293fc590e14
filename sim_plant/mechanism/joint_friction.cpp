#include "sim_plant/mechanism/joint_friction.hpp"

#include <cmath>

namespace trocar::sim_plant {

LinearFriction linearise(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_guess_rad_s,
                         double dt_s) noexcept {
  if (config.coulomb_nm <= 0.0) return {0.0, config.viscous_nm_s};
  // z' = w (1 - s z sign(w) / g): what part of the motion bends the bristle. At the middle of the step z has moved by z' dt/2.
  const double bent = config.stiffness_nm_per_rad * state.bristle_rad / config.coulomb_nm;
  const double part = 1.0 - (velocity_guess_rad_s >= 0.0 ? bent : -bent);
  return {config.stiffness_nm_per_rad * state.bristle_rad,
          config.viscous_nm_s + part * (0.5 * dt_s * config.stiffness_nm_per_rad + config.bristle_damping_nm_s)};
}

JointFrictionState update(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_rad_s, double dt_s) noexcept {
  if (config.coulomb_nm <= 0.0 || velocity_rad_s == 0.0) return state;
  const double most = std::copysign(config.coulomb_nm / config.stiffness_nm_per_rad, velocity_rad_s);
  return {most + (state.bristle_rad - most) * std::exp(-std::abs(velocity_rad_s * dt_s / most))};
}

}  // namespace trocar::sim_plant
