#include "common/mechanism/capability.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "common/mechanism/linkage_terms.hpp"

namespace trocar::mechanism {
namespace {

constexpr double turn = 2.0 * std::numbers::pi;

Vec2 any_turn() noexcept { return Vec2::Zero(); }  // which turn a joint is on changes no figure

void mass_range(const Mat2& M, Figures& out) noexcept {
  const double mean = 0.5 * M.trace();
  const double radius = std::hypot(0.5 * (M(0, 0) - M(1, 1)), M(0, 1));
  out.mass_least_kg = mean - radius;
  out.mass_most_kg = mean + radius;
}

Figures worse(const Figures& a, const Figures& b) noexcept {
  Figures out;
  out.singularity = std::min(a.singularity, b.singularity);
  out.position_step_m = std::max(a.position_step_m, b.position_step_m);
  out.position_rms_m = std::max(a.position_rms_m, b.position_rms_m);
  out.angle_step_rad = std::max(a.angle_step_rad, b.angle_step_rad);
  out.angle_rms_rad = std::max(a.angle_rms_rad, b.angle_rms_rad);
  out.peak_force_n = std::min(a.peak_force_n, b.peak_force_n);
  out.continuous_force_n = std::min(a.continuous_force_n, b.continuous_force_n);
  out.continuous_force_best_n = std::min(a.continuous_force_best_n, b.continuous_force_best_n);
  out.mass_least_kg = std::min(a.mass_least_kg, b.mass_least_kg);
  out.mass_most_kg = std::max(a.mass_most_kg, b.mass_most_kg);
  out.inertia_kg_m2 = std::max(a.inertia_kg_m2, b.inertia_kg_m2);
  return out;
}

// Forces f at zero moment: |normal . f| <= limit for each pair of drives.
struct ForcePolygon {
  std::array<Vec2, 6> normal;
  std::array<double, 6> limit{};
  std::size_t edges = 0;

  ForcePolygon(const Mat43& H, const Vec4& torque_limit_nm) noexcept {
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = i + 1; j < 4; ++j) {
        const Vec3 n = H.row(i).transpose().cross(H.row(j).transpose());
        if (n.head<2>().squaredNorm() == 0.0) continue;
        normal[edges] = n.head<2>();
        limit[edges++] = torque_limit_nm.dot((H * n).cwiseAbs());
      }
    }
  }
  [[nodiscard]] bool holds(const Vec2& force) const noexcept {
    for (std::size_t k = 0; k < edges; ++k) {
      if (std::abs(normal[k].dot(force)) > limit[k] * (1.0 + 1e-9)) return false;  // corners lie on two limits, up to rounding
    }
    return true;
  }
};

// Translation rows of F give the position figures, the rotation row (if any) those of the angle.
template <class Map>
void resolution(const Map& F, double counts_per_turn, Figures& out) noexcept {
  const double count_rad = turn / counts_per_turn;
  out.position_step_m = count_rad * F.template topRows<2>().colwise().norm().maxCoeff();
  out.position_rms_m = count_rad * F.template topRows<2>().norm() / std::sqrt(12.0);
  if constexpr (Map::RowsAtCompileTime == 3) {
    out.angle_step_rad = count_rad * F.row(2).cwiseAbs().maxCoeff();
    out.angle_rms_rad = count_rad * F.row(2).norm() / std::sqrt(12.0);
  }
}

Status figures_at(const TwinModel& model, const DriveLimits& drives, const Vec3& x, Figures& out) noexcept {
  TwinState state;
  Mat43 H;
  Mat34 F;
  Mat3 M, C;
  const Vec4 near = Vec4::Zero();
  if (const Status status = at_pose(model, x, near, state); status != Status::Ok) return status;
  if (const Status status = velocity_map(model, state, H); status != Status::Ok) return status;
  if (const Status status = pose_map(model, state, F); status != Status::Ok) return status;
  if (const Status status = dynamics(model, state, Vec3::Zero(), M, C); status != Status::Ok) return status;
  out.singularity = singularity_distance(model, state);
  resolution(F, drives.encoder_counts_per_turn, out);
  out.peak_force_n = weakest_force(H, drives.peak_torque_nm);
  out.continuous_force_n = weakest_force(H, drives.continuous_torque_nm);
  out.continuous_force_best_n = strongest_force(H, drives.continuous_torque_nm);
  mass_range(M.topLeftCorner<2, 2>(), out);
  out.inertia_kg_m2 = M(2, 2);
  return Status::Ok;
}

Status figures_at(const FiveBarModel& model, const DriveLimits& drives, const Vec3& x, Figures& out) noexcept {
  Vec2 theta;
  FiveBarPose pose;
  Mat2 J, D, C;
  if (const Status status = inverse(model, x.head<2>(), any_turn(), theta); status != Status::Ok) return status;
  if (const Status status = forward(model, theta, pose); status != Status::Ok) return status;
  if (const Status status = jacobian(model, theta, pose, J); status != Status::Ok) return status;
  if (const Status status = dynamics(model, theta, Vec2::Zero(), D, C); status != Status::Ok) return status;
  out.singularity = singularity_distance(model, theta, pose);
  resolution(J, drives.encoder_counts_per_turn, out);
  out.peak_force_n = weakest_force(J, drives.peak_torque_nm.head<2>());
  out.continuous_force_n = weakest_force(J, drives.continuous_torque_nm.head<2>());
  out.continuous_force_best_n = strongest_force(J, drives.continuous_torque_nm.head<2>());
  const Mat2 J_inverse = J.inverse();
  mass_range(J_inverse.transpose() * D * J_inverse, out);
  return Status::Ok;
}

template <class Model>
Capability survey(const Model& model, const DriveLimits& drives, const Rectangle& area, int positions, int orientations) noexcept {
  const int n = std::max(positions, 2), turns = std::max(orientations, 1);
  Capability out;
  bool first = true;
  const auto worst_orientation = [&](double x_m, double y_m, Figures& figures) noexcept {
    for (int k = 0; k < turns; ++k) {
      Figures here;
      if (const Status status = figures_at(model, drives, {x_m, y_m, turn * k / turns}, here); status != Status::Ok) return status;
      figures = k == 0 ? here : worse(figures, here);
    }
    return Status::Ok;
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      Figures here;
      out.status = worst_orientation(std::lerp(area.x_m[0], area.x_m[1], double(i) / (n - 1)),
                                     std::lerp(area.y_m[0], area.y_m[1], double(j) / (n - 1)), here);
      if (out.status != Status::Ok) return out;
      out.worst = first ? here : worse(out.worst, here);
      first = false;
    }
  }
  out.status = worst_orientation(std::midpoint(area.x_m[0], area.x_m[1]), std::midpoint(area.y_m[0], area.y_m[1]), out.centre);
  return out;
}

bool usable(const FiveBarModel& model, const Vec2& end_m, double least_distance) noexcept {
  Vec2 theta;
  FiveBarPose pose;
  return inverse(model, end_m, any_turn(), theta) == Status::Ok && forward(model, theta, pose) == Status::Ok &&
         singularity_distance(model, theta, pose) >= least_distance;
}

double reach_m(const FiveBarModel& model) noexcept {
  return 0.5 * model.base_m +
         std::min(model.proximal[0].length_m + model.distal[0].length_m, model.proximal[1].length_m + model.distal[1].length_m);
}

// Side of the largest square that ends at a grid node = 1 + the least of its three predecessors, row by row.
template <class Test>
Square search(double reach, double step_m, const Test& test) noexcept {
  constexpr int most_columns = 512;
  if (!(step_m > 0.0) || !(reach > 0.0)) return {};
  const double step = std::max(step_m, 2.0 * reach / (most_columns - 2));
  const int half = static_cast<int>(reach / step);
  std::array<int, most_columns> side{};  // nodes along the side of the square ending here, in the row above until overwritten
  Square best;
  int best_nodes = 1;
  double best_off_axis = std::numeric_limits<double>::infinity();
  for (int row = -half; row <= half; ++row) {
    int diagonal = 0;
    std::size_t c = 0;
    for (int column = -half; column <= half; ++column, ++c) {
      const int above = side[c], left = c == 0 ? 0 : side[c - 1];
      side[c] = test(Vec2(column * step, row * step)) ? 1 + std::min({above, left, diagonal}) : 0;
      diagonal = above;
      const double back = 0.5 * (side[c] - 1);
      const double off_axis = std::abs(column - back);
      if (side[c] > best_nodes || (side[c] == best_nodes && best_nodes > 1 && off_axis < best_off_axis)) {
        best_nodes = side[c];
        best_off_axis = off_axis;
        best.side_m = (best_nodes - 1) * step;
        best.centre_m = Vec2((column - back) * step, (row - back) * step);
      }
    }
  }
  return best;
}

}  // namespace

Capability capability(const TwinModel& model, const DriveLimits& drives, const Rectangle& rectangle, const Sampling& sampling) noexcept {
  return survey(model, drives, rectangle, sampling.positions, sampling.orientations);
}

Capability capability(const FiveBarModel& model, const DriveLimits& drives, const Rectangle& rectangle, const Sampling& sampling) noexcept {
  return survey(model, drives, rectangle, sampling.positions, 1);
}

Square largest_square(const TwinModel& model, double least_distance, double step_m, int orientations) noexcept {
  const int turns = std::max(orientations, 1);
  const double reach = std::min(reach_m(model.linkage[0]), reach_m(model.linkage[1])) + model.coupling_m;
  return search(reach, step_m, [&](const Vec2& handle) noexcept {
    for (int k = 0; k < turns; ++k) {
      const double angle = turn * k / turns;
      const Vec2 d(std::cos(angle), std::sin(angle));
      if (!usable(model.linkage[0], handle - model.handle_m * d, least_distance)) return false;
      if (!usable(model.linkage[1], handle + (model.coupling_m - model.handle_m) * d, least_distance)) return false;
    }
    return true;
  });
}

Square largest_square(const FiveBarModel& model, double least_distance, double step_m) noexcept {
  return search(reach_m(model), step_m, [&](const Vec2& end) noexcept { return usable(model, end, least_distance); });
}

double weakest_force(const Mat43& H, const Vec4& torque_limit_nm) noexcept {
  const ForcePolygon polygon(H, torque_limit_nm);
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < polygon.edges; ++k) least = std::min(least, polygon.limit[k] / polygon.normal[k].norm());
  return std::isfinite(least) ? least : 0.0;
}

double strongest_force(const Mat43& H, const Vec4& torque_limit_nm) noexcept {
  const ForcePolygon polygon(H, torque_limit_nm);
  double most = 0.0;
  for (std::size_t i = 0; i < polygon.edges; ++i) {
    for (std::size_t j = i + 1; j < polygon.edges; ++j) {
      const double det = cross(polygon.normal[i], polygon.normal[j]);
      if (det == 0.0) continue;
      for (const double side : {-1.0, 1.0}) {
        const Vec2 corner = perp(side * polygon.limit[j] * polygon.normal[i] - polygon.limit[i] * polygon.normal[j]) / det;
        if (polygon.holds(corner)) most = std::max(most, corner.norm());
      }
    }
  }
  return most;
}

// f = J^-T tau fills a parallelogram: edges limit_i / |column i of J| away, corners where both torques are at their limit.
double weakest_force(const Mat2& dend_dtheta, const Vec2& torque_limit_nm) noexcept {
  return (torque_limit_nm.array() / dend_dtheta.colwise().norm().transpose().array()).minCoeff();
}

double strongest_force(const Mat2& dend_dtheta, const Vec2& torque_limit_nm) noexcept {
  const Mat2 J_inverse = dend_dtheta.inverse();
  const Vec2 first = torque_limit_nm(0) * J_inverse.row(0).transpose(), second = torque_limit_nm(1) * J_inverse.row(1).transpose();
  return std::max((first + second).norm(), (first - second).norm());
}

}  // namespace trocar::mechanism
