// Distribution of a handle wrench over four drives (thesis A.4). u = H^T tau has a one-dimensional family of solutions
// (an internal force along the coupling, which no wrench shows); each function takes the one of least norm.
//   wrench  (f_x, f_y, moment) of the mechanism on its surroundings at the handle: N, N, N m
//   H       from velocity_map, of full column rank (no arm stretched)
// Friction and gear efficiency are the caller's business.
#pragma once

#include "common/mechanism/twin.hpp"

namespace trocar::mechanism {

// A.17, least |tau|: tau = H (H^T H)^-1 u, at the joints (N m).
[[nodiscard]] Vec4 joint_torque(const Mat43& H, const Vec3& wrench) noexcept;

// A.19, least |tau'|: tau' = W H (H^T W^2 H)^-1 u, at the motors (N m); joint torque tau = W tau', W = diag(gear_ratio).
[[nodiscard]] Vec4 actuator_torque(const Mat43& H, const Vec4& gear_ratio, const Vec3& wrench) noexcept;

// A.15, least norm of the two end-point forces f = (f_0, f_1), 4 numbers in N: f = J_o (J_o^T J_o)^-1 u, tau = J_e^T f
// at the joints (N m). Singular at a parallel singularity of either linkage.
[[nodiscard]] Status end_point_least_norm(const TwinModel& model, const TwinState& state, const Vec3& wrench, Vec4& torque_nm,
                                          Vec4& end_force_n) noexcept;

}  // namespace trocar::mechanism
