// One five-bar linkage: position, velocity, dynamics. Frame, angles and names as in model.hpp; SI units.
//
//   E_i = A_i + l_i u(theta_i)             elbows, A_i the motor axes, u(a) = (cos a, sin a)
//   |P - E_i| = r_i                        loop closure; w_i = P - E_i = r_i u(phi_i)
//   w_i . P' = (w_i . e_i) theta_i'        e_i = dE_i/dtheta_i = l_i u(theta_i + pi/2);  A P' = B theta', J = A^-1 B
//
// Modes. Assembly: sin(phi_1 - phi_0) > 0 (the same as cross(E_1 - E_0, P - E_0) > 0). Working: elbows outward,
// sin(theta_0 - phi_0) > 0 and sin(phi_1 - theta_1) > 0, elbow 0 left of elbow 1 (links of one plane cannot cross).
// `forward` knows the assembly mode only; `inverse` gives both.
#pragma once

#include <array>

#include "common/mechanism/model.hpp"
#include "common/mechanism/types.hpp"

namespace trocar::mechanism {

struct FiveBarPose {
  std::array<Vec2, 2> elbow{Vec2::Zero(), Vec2::Zero()};
  Vec2 end = Vec2::Zero();
  std::array<double, 2> distal_angle_rad{};  // phi_i in (-pi, pi]
};

// Unreachable: elbows further apart than the distal links together, or one circle inside of the other.
[[nodiscard]] Status forward(const FiveBarModel& model, const Vec2& theta_rad, FiveBarPose& out) noexcept;

// Each angle is returned within pi of theta_near_rad. Unreachable also when P needs another mode, so that
// forward(inverse(P)) = P whenever this says Ok.
[[nodiscard]] Status inverse(const FiveBarModel& model, const Vec2& end_m, const Vec2& theta_near_rad, Vec2& theta_rad) noexcept;

// J (2 x 2, m/rad): P' = J theta'. Forces map as tau = J^T f, f the force of the linkage on its surroundings at P.
[[nodiscard]] Status jacobian(const FiveBarModel& model, const Vec2& theta_rad, const FiveBarPose& pose, Mat2& dend_dtheta) noexcept;

// min(sin(phi_1 - phi_0), sin(theta_0 - phi_0), sin(phi_1 - theta_1)), not below 0.
//   first    0 at a parallel singularity (distal links in line: P moves with the motors locked, J unbounded)
//   others   0 at a serial singularity (an arm stretched or folded: P cannot move along it, J loses rank)
// 1 only where distal links and both elbows make right angles. 0 also beyond, in any foreign mode, and for NaN.
[[nodiscard]] double singularity_distance(const FiveBarModel& model, const Vec2& theta_rad, const FiveBarPose& pose) noexcept;

// Closed chain: D theta'' + C theta' = tau - J^T f (thesis A.2; f the force of the linkage on its surroundings).
// D (2 x 2, kg m^2) symmetric positive definite, rotor inertia included; C (kg m^2/s) holds the Christoffel symbols of
// D, so D' - 2 C is skew. Motion is in a horizontal plane: no gravity.
//   With every body's velocity Jacobian Jb(theta):  D = sum m Jb^T Jb,  C = sum m Jb^T Jb'
[[nodiscard]] Status dynamics(const FiveBarModel& model, const Vec2& theta_rad, const Vec2& theta_dot_rad_s, Mat2& D, Mat2& C) noexcept;

}  // namespace trocar::mechanism
