// Shared by five_bar.cpp and twin.cpp: the inertia of one five-bar linkage in any minimal coordinates z of size N.
//
//   theta' = T z',  P' = Jp z'  (T, Jp 2 x N, with their time derivatives)
//   elbow i:      Je = e_i T_i
//   distal com i: Jc = Je + (com/r) (Jp - Je)                 on the line from elbow to end point
//   distal spin:  phi_i' = b z',  b = perp(w_i)^T (Jp - Je) / r^2
//   M += sum m J^T J,  C += sum m J^T J'
// T and Jp are gradients of functions of z, so J^T J' is exactly the Christoffel form (no further terms appear).
#pragma once

#include <cstddef>

#include "common/mechanism/five_bar.hpp"

namespace trocar::mechanism {

[[nodiscard]] inline Vec2 perp(const Vec2& v) noexcept { return {-v.y(), v.x()}; }
[[nodiscard]] inline double cross(const Vec2& a, const Vec2& b) noexcept { return a.x() * b.y() - a.y() * b.x(); }
[[nodiscard]] inline Vec2 motor_axis(const FiveBarModel& model, std::size_t side) noexcept {
  return {side == 0 ? -0.5 * model.base_m : 0.5 * model.base_m, 0.0};
}

template <int N>
struct LinkageMotion {
  using Rows = Eigen::Matrix<double, 2, N>;
  Rows T, T_dot;    // joint angles
  Rows Jp, Jp_dot;  // end point
  Vec2 theta_dot, end_dot;
};

// Vectors of one arm and their rates: proximal link, its derivative e by theta, distal link.
struct Arm {
  Vec2 link, e, e_dot, w, w_dot;
  Arm(const FiveBarModel& model, const FiveBarPose& pose, std::size_t side, double theta_dot, const Vec2& end_dot) noexcept
      : link(pose.elbow[side] - motor_axis(model, side)),
        e(perp(link)),
        e_dot(-theta_dot * link),
        w(pose.end - pose.elbow[side]),
        w_dot(end_dot - theta_dot * e) {}
};

template <int N>
void add_inertia(const FiveBarModel& model, const FiveBarPose& pose, const LinkageMotion<N>& motion, Eigen::Matrix<double, N, N>& M,
                 Eigen::Matrix<double, N, N>& C) noexcept {
  using Rows = Eigen::Matrix<double, 2, N>;
  using Row = Eigen::Matrix<double, 1, N>;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const Link& proximal = model.proximal[i];
    const Link& distal = model.distal[i];
    const Arm arm(model, pose, i, motion.theta_dot(row), motion.end_dot);
    const Row T = motion.T.row(row), T_dot = motion.T_dot.row(row);

    const double about_motor =
        proximal.inertia_kg_m2 + proximal.mass_kg * proximal.com_m * proximal.com_m + model.reflected_inertia_kg_m2[i];
    M.noalias() += about_motor * T.transpose() * T;
    C.noalias() += about_motor * T.transpose() * T_dot;

    const Rows Je = arm.e * T, Je_dot = arm.e_dot * T + arm.e * T_dot;
    const Rows Jr = motion.Jp - Je, Jr_dot = motion.Jp_dot - Je_dot;
    const double along = distal.com_m / distal.length_m;
    const Rows Jc = Je + along * Jr, Jc_dot = Je_dot + along * Jr_dot;
    M.noalias() += distal.mass_kg * Jc.transpose() * Jc;
    C.noalias() += distal.mass_kg * Jc.transpose() * Jc_dot;

    const double scale = 1.0 / (distal.length_m * distal.length_m);
    const Row b = scale * perp(arm.w).transpose() * Jr;
    const Row b_dot = scale * (perp(arm.w_dot).transpose() * Jr + perp(arm.w).transpose() * Jr_dot);
    M.noalias() += distal.inertia_kg_m2 * b.transpose() * b;
    C.noalias() += distal.inertia_kg_m2 * b.transpose() * b_dot;
  }
  M.noalias() += model.end_point_mass_kg * motion.Jp.transpose() * motion.Jp;
  C.noalias() += model.end_point_mass_kg * motion.Jp.transpose() * motion.Jp_dot;
}

}  // namespace trocar::mechanism
