#include "sim_plant/mechanism/joint_friction.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::sim_plant {

namespace {
constexpr double elastic = 0.8;  // of the Coulomb torque
}

LinearFriction linearise(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_guess_rad_s,
                         double dt_s) noexcept {
  if (config.coulomb_nm <= 0.0) return {0.0, config.viscous_nm_s};
  const double load = config.stiffness_nm_per_rad * state.bristle_rad / config.coulomb_nm;
  const double part = std::clamp((1.0 - (velocity_guess_rad_s >= 0.0 ? load : -load)) / (1.0 - elastic), 0.0, 1.0);
  // At the middle of the step z has moved by z' dt/2.
  return {config.stiffness_nm_per_rad * state.bristle_rad,
          config.viscous_nm_s + part * (0.5 * dt_s * config.stiffness_nm_per_rad + config.bristle_damping_nm_s)};
}

JointFrictionState update(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_rad_s, double dt_s) noexcept {
  if (config.coulomb_nm <= 0.0 || velocity_rad_s == 0.0) return state;
  const double most = std::copysign(config.coulomb_nm / config.stiffness_nm_per_rad, velocity_rad_s);
  double load = state.bristle_rad / most;
  double travel = velocity_rad_s * dt_s / most;  // by which an elastic bristle would be loaded
  const double bends = std::clamp(elastic - load, 0.0, travel);
  load += bends;
  travel -= bends;
  return {most * (1.0 - (1.0 - load) * std::exp(-travel / (1.0 - elastic)))};
}

}  // namespace trocar::sim_plant
