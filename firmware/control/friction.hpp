// Joint friction as a rig file describes it, made smooth: the torque against the motion is c tanh(w / s) + b w.
// At rest the true friction is anything within +-c, and this says 0: the error stays below c. Below s it is too small by design: s is
// chosen above the speed that one encoder count feigns, so that the torque does not chatter between +-c.
#pragma once

#include <cmath>

namespace trocar::control {

struct JointFriction {
  double coulomb_nm{};
  double viscous_nm_s{};
  double smoothing_rad_s{};  // s > 0, speed at which 76 % of the Coulomb torque is there; not read when coulomb_nm is 0
};

[[nodiscard]] inline double friction_torque_nm(const JointFriction& f, double velocity_rad_s) noexcept {
  const double coulomb = f.coulomb_nm > 0.0 ? f.coulomb_nm * std::tanh(velocity_rad_s / f.smoothing_rad_s) : 0.0;
  return coulomb + f.viscous_nm_s * velocity_rad_s;
}

// Steepest slope, N m s/rad: at rest.
[[nodiscard]] inline double friction_slope_nm_s(const JointFriction& f) noexcept {
  return f.viscous_nm_s + (f.coulomb_nm > 0.0 ? f.coulomb_nm / f.smoothing_rad_s : 0.0);
}

}  // namespace trocar::control
