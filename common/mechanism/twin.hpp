// Two five-bar linkages on the same axes, their end points joined by a rigid coupling: x, y and unlimited rotation from
// four joints. Frame, angles and drive numbers as in model.hpp; SI units.
//
//   d = (cos theta, sin theta), n = (-sin theta, cos theta)
//   P0 = x - h d,  P1 = x + (c - h) d            x the handle, c coupling_m, h handle_m
//   P0' = x' - h n theta',  P1' = x' + (c - h) n theta'                     (P0', P1') = J_o x'   (thesis A.10)
//   q' = H x',  H = J_e^-1 J_o (4 x 3);  row of arm i: w_i^T J_o / (w_i . e_i)                    (thesis A.11)
// H needs no regular J_e: it exists at parallel singularities too. Wrenches: u = H^T tau, u what the mechanism applies
// at the handle (f_x, f_y in N, moment about the handle in N m).
#pragma once

#include <array>

#include "common/mechanism/five_bar.hpp"

namespace trocar::mechanism {

struct TwinState {
  Vec3 x = Vec3::Zero();  // x_m, y_m, theta_rad (not wrapped)
  double residual_m{};    // |P1 - P0| - coupling_m: 0 for four angles that agree
  Vec4 q = Vec4::Zero();  // joint angles, rad
  std::array<FiveBarPose, 2> linkage;
};

// Pose of the rigid coupling that fits both measured end points best: least |P0 - p0|^2 + |P1 - p1|^2, which is the
// direction P0 -> P1 about their midpoint. theta is returned within pi of theta_near_rad. The linkages stay as measured.
[[nodiscard]] Status forward(const TwinModel& model, const Vec4& q_rad, double theta_near_rad, TwinState& out) noexcept;

// Each angle within pi of q_near.
[[nodiscard]] Status inverse(const TwinModel& model, const Vec3& x, const Vec4& q_near, Vec4& q) noexcept;

// inverse, then forward: the complete state of a handle pose.
[[nodiscard]] Status at_pose(const TwinModel& model, const Vec3& x, const Vec4& q_near, TwinState& out) noexcept;

// q' = H x' (rad/m and rad/rad). Singular at an arm that is stretched or folded.
[[nodiscard]] Status velocity_map(const TwinModel& model, const TwinState& state, Mat43& H) noexcept;

// x' = F q': derivative of `forward`; F H = identity. Singular at a parallel singularity of either linkage.
[[nodiscard]] Status pose_map(const TwinModel& model, const TwinState& state, Mat34& F) noexcept;

// The lesser of the two linkages' distances (five_bar.hpp); the coupling adds no singularity of its own.
[[nodiscard]] double singularity_distance(const TwinModel& model, const TwinState& state) noexcept;

// M x'' + C x' = u + f_h, u = H^T tau, f_h the hand's wrench on the handle (thesis A.3). M (3 x 3) symmetric positive
// definite with all links, coupling, handle and reflected rotor inertia: kg, kg m, kg m^2. C: Christoffel symbols of M.
[[nodiscard]] Status dynamics(const TwinModel& model, const TwinState& state, const Vec3& x_dot, Mat3& M, Mat3& C) noexcept;

}  // namespace trocar::mechanism
