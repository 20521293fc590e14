// Friction of one joint: Coulomb with a true stick phase, as a bristle that bends, then slides (elastoplastic: Dupont, Hayward,
// Armstrong, Altpeter, IEEE Trans. Automatic Control 47, 2002; our transition is linear), and viscous.
//   z' = w p(z),   torque against the motion = s z + d z' + b w
//   z bristle (rad), w joint velocity (rad/s), s stiffness (N m/rad), d bristle damping (N m s/rad), b viscous (N m s/rad).
//   r = s z sign(w) / g, g the Coulomb torque (N m):  p = 1 up to r = 0.8,  p = (1 - r) / 0.2 from there to 1
// Below 0.8 g the joint is a spring: it holds for ever and does not creep under vibration. Sliding: s z -> g sign(w).
#pragma once

namespace trocar::sim_plant {

struct JointFrictionConfig {
  double coulomb_nm{};  // 0 switches the bristle off
  double viscous_nm_s{};
  double stiffness_nm_per_rad{};
  double bristle_damping_nm_s{};
};

struct JointFrictionState {
  double bristle_rad{};
};

// The torque against the motion is offset_nm + slope_nm_s * w, w the mean velocity of the step: linear, so that an integrator
// can take it implicitly. Which way the bristle moves is taken from `velocity_guess_rad_s`.
struct LinearFriction {
  double offset_nm{};
  double slope_nm_s{};
};
[[nodiscard]] LinearFriction linearise(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_guess_rad_s,
                                       double dt_s) noexcept;

// The bristle after dt at constant velocity: exact.
[[nodiscard]] JointFrictionState update(const JointFrictionConfig& config, const JointFrictionState& state, double velocity_rad_s,
                                        double dt_s) noexcept;

}  // namespace trocar::sim_plant
