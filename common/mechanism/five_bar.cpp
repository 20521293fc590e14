#include "common/mechanism/five_bar.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/mechanism/linkage_terms.hpp"

namespace trocar::mechanism {
namespace {

struct ClosedLoop {
  std::array<double, 2> serial;  // w_i . e_i, the diagonal of B
  Mat2 A_inverse;
};

Status close_loop(const FiveBarModel& model, const std::array<Arm, 2>& arm, ClosedLoop& out) noexcept {
  const double det = cross(arm[0].w, arm[1].w);
  const double sine = det / (model.distal[0].length_m * model.distal[1].length_m);
  if (!std::isfinite(sine)) return Status::NotFinite;
  if (std::abs(sine) < singular_sine) return Status::Singular;
  out.A_inverse << arm[1].w.y(), -arm[0].w.y(), -arm[1].w.x(), arm[0].w.x();
  out.A_inverse /= det;
  out.serial = {arm[0].w.dot(arm[0].e), arm[1].w.dot(arm[1].e)};
  return Status::Ok;
}

}  // namespace

Status forward(const FiveBarModel& model, const Vec2& theta_rad, FiveBarPose& out) noexcept {
  if (!theta_rad.allFinite()) return Status::NotFinite;
  FiveBarPose pose;
  for (std::size_t i = 0; i < 2; ++i) {
    const double angle = theta_rad(static_cast<Eigen::Index>(i));
    pose.elbow[i] = motor_axis(model, i) + model.proximal[i].length_m * Vec2(std::cos(angle), std::sin(angle));
  }
  const Vec2 d = pose.elbow[1] - pose.elbow[0];
  const double r0 = model.distal[0].length_m, r1 = model.distal[1].length_m;
  const double distance = d.norm();
  if (distance < singular_sine * std::min(r0, r1)) return Status::Singular;
  const double along = (distance * distance + (r0 - r1) * (r0 + r1)) / (2.0 * distance);
  const double height_squared = (r0 - along) * (r0 + along);
  if (height_squared < 0.0) return Status::Unreachable;
  const double height = std::sqrt(height_squared);
  if (distance * height < singular_sine * r0 * r1) return Status::Singular;

  pose.end = pose.elbow[0] + (along * d + height * perp(d)) / distance;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vec2 w = pose.end - pose.elbow[i];
    pose.distal_angle_rad[i] = std::atan2(w.y(), w.x());
  }
  out = pose;
  return Status::Ok;
}

Status inverse(const FiveBarModel& model, const Vec2& end_m, const Vec2& theta_near_rad, Vec2& theta_rad) noexcept {
  if (!end_m.allFinite() || !theta_near_rad.allFinite()) return Status::NotFinite;
  Vec2 theta;
  std::array<Vec2, 2> w;
  std::array<double, 2> elbow_x{};
  bool stretched = false;
  for (std::size_t i = 0; i < 2; ++i) {
    const double l = model.proximal[i].length_m, r = model.distal[i].length_m;
    const Vec2 d = end_m - motor_axis(model, i);
    const double distance = d.norm();
    if (distance < singular_sine * l) return Status::Singular;
    const double along = (distance * distance + (l - r) * (l + r)) / (2.0 * distance);
    const double height_squared = (l - along) * (l + along);
    if (height_squared < 0.0) return Status::Unreachable;
    const double height = std::sqrt(height_squared);
    stretched = stretched || distance * height < singular_sine * l * r;

    const Vec2 link = (along * d + (i == 0 ? height : -height) * perp(d)) / distance;
    w[i] = d - link;
    elbow_x[i] = end_m.x() - w[i].x();
    const auto row = static_cast<Eigen::Index>(i);
    const double near = theta_near_rad(row);
    theta(row) = near + std::remainder(std::atan2(link.y(), link.x()) - near, 2.0 * std::numbers::pi);
  }
  if (stretched) return Status::Singular;
  const double parallel = cross(w[0], w[1]) / (model.distal[0].length_m * model.distal[1].length_m);
  if (std::abs(parallel) < singular_sine) return Status::Singular;
  if (parallel < 0.0) return Status::Unreachable;
  if (!(elbow_x[0] < elbow_x[1])) return Status::Unreachable;
  theta_rad = theta;
  return Status::Ok;
}

Status jacobian(const FiveBarModel& model, const Vec2& theta_rad, const FiveBarPose& pose, Mat2& dend_dtheta) noexcept {
  if (!theta_rad.allFinite()) return Status::NotFinite;
  const std::array<Arm, 2> arm{Arm(model, pose, 0, 0.0, Vec2::Zero()), Arm(model, pose, 1, 0.0, Vec2::Zero())};
  ClosedLoop loop;
  if (const Status status = close_loop(model, arm, loop); status != Status::Ok) return status;
  dend_dtheta.col(0) = loop.serial[0] * loop.A_inverse.col(0);
  dend_dtheta.col(1) = loop.serial[1] * loop.A_inverse.col(1);
  return Status::Ok;
}

double singularity_distance(const FiveBarModel& model, const Vec2& theta_rad, const FiveBarPose& pose) noexcept {
  const Vec2 w0 = pose.end - pose.elbow[0], w1 = pose.end - pose.elbow[1];
  const double r0 = model.distal[0].length_m, r1 = model.distal[1].length_m;
  const Vec2 u0(std::cos(theta_rad(0)), std::sin(theta_rad(0))), u1(std::cos(theta_rad(1)), std::sin(theta_rad(1)));
  const double parallel = cross(w0, w1) / (r0 * r1), serial0 = cross(w0, u0) / r0, serial1 = cross(u1, w1) / r1;
  const bool own_modes = parallel > 0.0 && serial0 > 0.0 && serial1 > 0.0 && pose.elbow[0].x() < pose.elbow[1].x();
  if (!own_modes || !std::isfinite(parallel + serial0 + serial1)) return 0.0;
  return std::min({parallel, serial0, serial1, 1.0});
}

Status dynamics(const FiveBarModel& model, const Vec2& theta_rad, const Vec2& theta_dot_rad_s, Mat2& D, Mat2& C) noexcept {
  if (!theta_dot_rad_s.allFinite()) return Status::NotFinite;
  FiveBarPose pose;
  if (const Status status = forward(model, theta_rad, pose); status != Status::Ok) return status;
  LinkageMotion<2> motion;
  if (const Status status = jacobian(model, theta_rad, pose, motion.Jp); status != Status::Ok) return status;
  motion.theta_dot = theta_dot_rad_s;
  motion.end_dot = motion.Jp * theta_dot_rad_s;
  motion.T.setIdentity();
  motion.T_dot.setZero();

  const std::array<Arm, 2> arm{Arm(model, pose, 0, theta_dot_rad_s(0), motion.end_dot),
                               Arm(model, pose, 1, theta_dot_rad_s(1), motion.end_dot)};
  ClosedLoop loop;
  if (const Status status = close_loop(model, arm, loop); status != Status::Ok) return status;
  // A J = B differentiated: A J' = B' - A' J.
  Mat2 rate;
  for (std::size_t i = 0; i < 2; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    rate.row(row) = -arm[i].w_dot.transpose() * motion.Jp;
    rate(row, row) += arm[i].w_dot.dot(arm[i].e) + arm[i].w.dot(arm[i].e_dot);
  }
  motion.Jp_dot = loop.A_inverse * rate;

  Mat2 mass = Mat2::Zero(), coriolis = Mat2::Zero();
  add_inertia(model, pose, motion, mass, coriolis);
  D = mass;
  C = coriolis;
  return Status::Ok;
}

}  // namespace trocar::mechanism
