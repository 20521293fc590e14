#include "common/mechanism/twin.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/mechanism/linkage_terms.hpp"

namespace trocar::mechanism {
namespace {

using Rows = Eigen::Matrix<double, 2, 3>;

Vec2 direction(double angle) noexcept { return {std::cos(angle), std::sin(angle)}; }

// Signed distance of linkage k's end point from the handle, along the coupling.
double offset(const TwinModel& model, std::size_t k) noexcept { return k == 0 ? -model.handle_m : model.coupling_m - model.handle_m; }

Rows point_map(double along_m, const Vec2& n) noexcept {
  Rows J = Rows::Identity();
  J.col(2) = along_m * n;
  return J;
}

Vec2 joint_pair(const Vec4& q, std::size_t k) noexcept { return k == 0 ? q.head<2>() : q.tail<2>(); }

}  // namespace

Status forward(const TwinModel& model, const Vec4& q_rad, double theta_near_rad, TwinState& out) noexcept {
  if (!q_rad.allFinite() || !std::isfinite(theta_near_rad)) return Status::NotFinite;
  TwinState state;
  state.q = q_rad;
  for (std::size_t k = 0; k < 2; ++k) {
    if (const Status status = forward(model.linkage[k], joint_pair(q_rad, k), state.linkage[k]); status != Status::Ok) return status;
  }
  const Vec2 p0 = state.linkage[0].end, p1 = state.linkage[1].end, span = p1 - p0;
  const double length = span.norm();
  if (length < singular_sine * model.coupling_m) return Status::Singular;
  const double angle = std::atan2(span.y(), span.x());
  state.x.head<2>() = 0.5 * (p0 + p1) + (model.handle_m - 0.5 * model.coupling_m) / length * span;
  state.x(2) = theta_near_rad + std::remainder(angle - theta_near_rad, 2.0 * std::numbers::pi);
  state.residual_m = length - model.coupling_m;
  out = state;
  return Status::Ok;
}

Status inverse(const TwinModel& model, const Vec3& x, const Vec4& q_near, Vec4& q) noexcept {
  if (!x.allFinite() || !q_near.allFinite()) return Status::NotFinite;
  const Vec2 d = direction(x(2));
  Vec2 left, right;
  if (const Status status = inverse(model.linkage[0], x.head<2>() + offset(model, 0) * d, q_near.head<2>(), left); status != Status::Ok)
    return status;
  if (const Status status = inverse(model.linkage[1], x.head<2>() + offset(model, 1) * d, q_near.tail<2>(), right); status != Status::Ok)
    return status;
  q.head<2>() = left;
  q.tail<2>() = right;
  return Status::Ok;
}

Status at_pose(const TwinModel& model, const Vec3& x, const Vec4& q_near, TwinState& out) noexcept {
  Vec4 q;
  if (const Status status = inverse(model, x, q_near, q); status != Status::Ok) return status;
  return forward(model, q, x(2), out);
}

Status velocity_map(const TwinModel& model, const TwinState& state, Mat43& H) noexcept {
  if (!state.x.allFinite()) return Status::NotFinite;
  const Vec2 n = perp(direction(state.x(2)));
  Mat43 map;
  for (std::size_t k = 0; k < 2; ++k) {
    const FiveBarModel& linkage = model.linkage[k];
    const Rows Jp = point_map(offset(model, k), n);
    for (std::size_t i = 0; i < 2; ++i) {
      const Arm arm(linkage, state.linkage[k], i, 0.0, Vec2::Zero());
      const double serial = arm.w.dot(arm.e);
      if (!std::isfinite(serial)) return Status::NotFinite;
      if (std::abs(serial) < singular_sine * linkage.proximal[i].length_m * linkage.distal[i].length_m) return Status::Singular;
      map.row(static_cast<Eigen::Index>(2 * k + i)) = arm.w.transpose() * Jp / serial;
    }
  }
  H = map;
  return Status::Ok;
}

Status pose_map(const TwinModel& model, const TwinState& state, Mat34& F) noexcept {
  std::array<Mat2, 2> J;
  for (std::size_t k = 0; k < 2; ++k) {
    if (const Status status = jacobian(model.linkage[k], joint_pair(state.q, k), state.linkage[k], J[k]); status != Status::Ok)
      return status;
  }
  const Vec2 span = state.linkage[1].end - state.linkage[0].end;
  const double length = span.norm();
  if (length < singular_sine * model.coupling_m) return Status::Singular;
  const Vec2 n = perp(span) / length;
  Mat34 map;
  map.bottomLeftCorner<1, 2>() = -n.transpose() * J[0] / length;
  map.bottomRightCorner<1, 2>() = n.transpose() * J[1] / length;
  map.topLeftCorner<2, 2>() = 0.5 * J[0];
  map.topRightCorner<2, 2>() = 0.5 * J[1];
  map.topRows<2>() += (model.handle_m - 0.5 * model.coupling_m) * n * map.row(2);
  F = map;
  return Status::Ok;
}

double singularity_distance(const TwinModel& model, const TwinState& state) noexcept {
  return std::min(singularity_distance(model.linkage[0], state.q.head<2>(), state.linkage[0]),
                  singularity_distance(model.linkage[1], state.q.tail<2>(), state.linkage[1]));
}

Status dynamics(const TwinModel& model, const TwinState& state, const Vec3& x_dot, Mat3& M, Mat3& C) noexcept {
  if (!x_dot.allFinite()) return Status::NotFinite;
  Mat43 H;
  if (const Status status = velocity_map(model, state, H); status != Status::Ok) return status;
  const Vec2 d = direction(state.x(2)), n = perp(d), n_dot = -x_dot(2) * d;
  Mat3 mass = Mat3::Zero(), coriolis = Mat3::Zero();
  for (std::size_t k = 0; k < 2; ++k) {
    const FiveBarModel& linkage = model.linkage[k];
    LinkageMotion<3> motion;
    motion.Jp = point_map(offset(model, k), n);
    motion.Jp_dot.setZero();
    motion.Jp_dot.col(2) = offset(model, k) * n_dot;
    motion.T = H.middleRows<2>(static_cast<Eigen::Index>(2 * k));
    motion.theta_dot = motion.T * x_dot;
    motion.end_dot = motion.Jp * x_dot;
    for (std::size_t i = 0; i < 2; ++i) {
      // (w . e) T = w^T Jp differentiated.
      const auto row = static_cast<Eigen::Index>(i);
      const Arm arm(linkage, state.linkage[k], i, motion.theta_dot(row), motion.end_dot);
      const double serial = arm.w.dot(arm.e), serial_dot = arm.w_dot.dot(arm.e) + arm.w.dot(arm.e_dot);
      motion.T_dot.row(row) =
          (arm.w_dot.transpose() * motion.Jp + arm.w.transpose() * motion.Jp_dot - serial_dot * motion.T.row(row)) / serial;
    }
    add_inertia(linkage, state.linkage[k], motion, mass, coriolis);
  }

  const double com = model.handle_com_m - model.handle_m;
  const Rows Jc = point_map(com, n);
  Rows Jc_dot = Rows::Zero();
  Jc_dot.col(2) = com * n_dot;
  mass.noalias() += model.handle_mass_kg * Jc.transpose() * Jc;
  coriolis.noalias() += model.handle_mass_kg * Jc.transpose() * Jc_dot;
  mass(2, 2) += model.handle_inertia_kg_m2;
  M = mass;
  C = coriolis;
  return Status::Ok;
}

}  // namespace trocar::mechanism
