// A hand that moves a rigid needle through a block of tissue, and checks of a step that hold whatever the path.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/insertion/insertion.hpp"
#include "tests/reference/box_qp.hpp"
#include "tests/reference/grid_image/grid_image.hpp"

namespace trocar::insertion::testing {

inline constexpr double needle_m = 0.1;
inline constexpr double shaft_n_per_m = 34.0;
inline constexpr double tip_excess_n = (68.0 - 34.0) * 0.0025;

// Row by row of the law's file for PVC.
[[nodiscard]] inline contact::VelocityLaw rising_law() {
  return {5, {0.001, 0.003, 0.005, 0.007, 0.009}, {34.0, 44.8, 51.9, 56.5, 60.0}, {68.0, 67.5, 66.5, 64.5, 61.0}};
}

// Building an image takes a while: one for each kind of mesh in a program.
[[nodiscard]] inline reference::GridImage& grid_of(fem::Type type, double distortion = 0.0) {
  static reference::GridImage tri({.element = fem::Type::Tri3});
  static reference::GridImage quad(reference::Block{});
  static reference::GridImage bent_tri({.element = fem::Type::Tri3, .distortion = 0.2});
  static reference::GridImage bent_quad({.distortion = 0.2});
  if (distortion > 0.0) return type == fem::Type::Tri3 ? bent_tri : bent_quad;
  return type == fem::Type::Tri3 ? tri : quad;
}

// The tissue begins at y = 0; starts with the tip 5 mm in front of it.
class Hand {
 public:
  explicit Hand(const reference::GridImage& grid, contact::Method method = contact::Method::Embedded)
      : law_(grid.law), image_(grid.image()) {
    law_.method = method;
    open();
  }
  Hand(const Hand&) = delete;
  Hand& operator=(const Hand&) = delete;

  // Change the law, the needle, then open.
  [[nodiscard]] contact::Law& law() { return law_; }
  [[nodiscard]] contact::Method method() const { return law_.method; }
  [[nodiscard]] model::Image& image() { return image_; }
  void open() {
    image_.law = &law_;
    model_->open(image_);
    step();
  }

  const Result& step(double dt_s = 1e-3) { return result_ = model_->step(pose, dt_s); }
  // Straight in all three coordinates; after(previous wrench, result) after each step.
  template <class After>
  void move(double dx_m, double dy_m, double dtheta_rad, double speed_m_s, const After& after, double step_m = 5e-5) {
    const double length = std::max(std::hypot(dx_m, dy_m), 0.1 * std::abs(dtheta_rad));
    const int steps = std::max(1, static_cast<int>(std::ceil(length / step_m)));
    const Pose from = pose;
    for (int i = 1; i <= steps; ++i) {
      const double s = static_cast<double>(i) / steps;
      pose = {from.x_m + s * dx_m, from.y_m + s * dy_m, from.theta_rad + s * dtheta_rad};
      const Wrench before = result_.base;
      after(before, step(length / steps / speed_m_s));
      worst_ = std::max(worst_, result_.status);
      worst_residual_n_ = std::max(worst_residual_n_, result_.residual_n);
    }
  }
  void move(double dx_m, double dy_m, double dtheta_rad = 0.0, double speed_m_s = 1e-3) {
    move(dx_m, dy_m, dtheta_rad, speed_m_s, [](const Wrench&, const Result&) {});
  }

  [[nodiscard]] const Result& result() const { return result_; }
  [[nodiscard]] const Wrench& base() const { return result_.base; }
  [[nodiscard]] double path_m() const { return result_.path_m; }
  [[nodiscard]] Insertion& model() { return *model_; }
  [[nodiscard]] const Insertion& model() const { return *model_; }
  [[nodiscard]] Status worst() const { return worst_; }
  [[nodiscard]] double worst_residual_n() const { return worst_residual_n_; }
  [[nodiscard]] Vector2 axis() const { return {std::cos(pose.theta_rad), std::sin(pose.theta_rad)}; }

  Pose pose{0.0, -needle_m - 0.005, std::numbers::pi / 2};

 private:
  contact::Law law_;
  model::Image image_;
  std::unique_ptr<Insertion> model_{std::make_unique<Insertion>()};
  Result result_{};
  Status worst_{Status::Ok};
  double worst_residual_n_{};
};

[[nodiscard]] inline std::array<double, 3> wrench_of(const Result& result) {
  return {result.base.fx_n, result.base.fy_n, result.base.tau_nm};
}

struct Balance {
  double wrench{};      // largest difference in N, and in N m over the needle's length
  double off_axis_m{};  // farthest that a contact's tissue lies from the needle's axis
  double stretch_m{};   // most that a tie gives way by more than its ridge and jumps, the last two segments' apart
};

// Shares of (along, across) over C t: a compliance along and across a segment, applied to a force. Plane stress.
[[nodiscard]] inline Vector2 yield_m(const reference::GridImage& whole, const contact::WorkingSet::Point& segment, const Vector2& share,
                                     const Vector2& force_n) {
  const double size = std::hypot(segment.heading[0], segment.heading[1]);
  const Vector2 t{segment.heading[0] / size, segment.heading[1] / size};
  const auto& [young_pa, poisson] = whole.image().tissue.material.front();
  const double per_pa = 1.0 / whole.image().tissue.thickness_m;
  const double axial_m = share[0] * per_pa * (t[0] * force_n[0] + t[1] * force_n[1]) * 2.0 * (1.0 + poisson) / young_pa;
  const double lateral_m = share[1] * per_pa * (t[0] * force_n[1] - t[1] * force_n[0]) * (1.0 - poisson * poisson) / young_pa;
  return {t[0] * axial_m - t[1] * lateral_m, t[1] * axial_m + t[0] * lateral_m};
}

// sin^2 of twice the angle between a segment and the edges of the cell around its middle: the mean of the two that meet most squarely.
[[nodiscard]] inline double askew_to_cell(const fem::Mesh& mesh, const contact::WorkingSet::Point& segment, double length_m,
                                          double beyond_m) {
  const double way_m = 0.5 * length_m + beyond_m;
  const fem::Point middle{segment.begin_m[0] + way_m * segment.heading[0], segment.begin_m[1] + way_m * segment.heading[1], 0.0};
  const auto& cell = mesh.element[static_cast<std::size_t>(fem::Locator(mesh).locate(middle)->element)];
  const int count = mesh.nodes_per_element();
  const auto angle = [&](int from, int to) {
    const fem::Point& a = mesh.node[static_cast<std::size_t>(cell[static_cast<std::size_t>(from % count)])];
    const fem::Point& b = mesh.node[static_cast<std::size_t>(cell[static_cast<std::size_t>(to % count)])];
    return std::atan2(b[1] - a[1], b[0] - a[0]);
  };
  double squarest = 2.0, edge = 0.0, other = 0.0;
  for (int k = 0; k < count; ++k) {
    const double off = std::abs(std::cos(angle(k, k + 1) - angle(k, k + count - 1)));
    if (off < squarest) squarest = off, edge = angle(k, k + 1), other = angle(k, k + count - 1);
  }
  const double along = std::atan2(segment.heading[1], segment.heading[0]);
  return 0.5 * (std::pow(std::sin(2.0 * (edge - along)), 2) + std::pow(std::sin(2.0 * (other - along)), 2));
}

// What elements miss on a line load through them: a tent of height q |d| / (2 C t), interpolated, by its two components, and how they take
// it up on the average (tests/benchmarks/accuracy/unresolved.py).
[[nodiscard]] inline Vector2 ridge_m(const reference::GridImage& whole, const contact::WorkingSet::Point& segment, double length_m,
                                     const Vector2& force_n, double beyond_m = 0.0) {
  const double size = std::hypot(segment.heading[0], segment.heading[1]);
  const Vector2 t{segment.heading[0] / size, segment.heading[1] / size};
  double distance_m = 0.0;
  for (std::uint32_t k = 0; k < segment.at.count; ++k) {
    const fem::Point& node = whole.mesh().node[segment.at.node[k]];
    distance_m += segment.at.weight[k] * std::abs(t[0] * (node[1] - segment.begin_m[1]) - t[1] * (node[0] - segment.begin_m[0]));
  }
  const double ridge = distance_m / (2.0 * length_m), askew = askew_to_cell(whole.mesh(), segment, length_m, beyond_m);
  return whole.mesh().type == fem::Type::Tri3
             ? yield_m(whole, segment, {(1.0 + 0.4 * askew) * ridge, (1.0 - 0.1 * askew) * ridge}, force_n)
             : yield_m(whole, segment, {(1.0 + 0.03 * askew) * ridge, (1.0 - 0.4 * askew) * ridge}, force_n);
}

// Of segment i over the jumps of density to its neighbours, all of them whole and the spacing being the mesh's mean edge.
[[nodiscard]] inline Vector2 jump_m(const reference::GridImage& whole, const contact::WorkingSet& set, std::size_t i) {
  const double per_edge = whole.mesh().type == fem::Type::Tri3 ? 0.88 : 1.0;
  const double of_jump = 0.15 * per_edge * per_edge;
  const auto course = [&](std::size_t k) { return std::hypot(set.point(k).heading[0], set.point(k).heading[1]); };
  Vector2 sum{};
  for (const std::size_t later : {i, i + 1}) {
    if (later == 0 || later >= set.size()) continue;
    const double share = course(later) / course(later - 1);
    const Vector2& f = set.solver().contact(later).force_n;
    const Vector2& g = set.solver().contact(later - 1).force_n;
    const Vector2 u = yield_m(whole, set.point(later), {of_jump, of_jump}, {f[0] - share * g[0], f[1] - share * g[1]});
    const double sign = later == i ? 1.0 : -share;
    sum = {sum[0] + sign * u[0], sum[1] + sign * u[1]};
  }
  return sum;
}

// The contact forces on the nodes of the whole sparse mesh (as adapted): the displacements that these cause say where the contacts
// are, and with that what the base must apply.
[[nodiscard]] inline Balance balance_of(const reference::GridImage& whole, const Hand& hand) {
  const contact::WorkingSet& set = hand.model().working_set();
  Eigen::VectorXd load = Eigen::VectorXd::Zero(whole.statics().degrees_of_freedom());
  for (std::size_t i = 0; i < set.size(); ++i) {
    const contact::Embedding& at = set.point(i).at;
    for (std::uint32_t k = 0; k < at.count; ++k)
      for (std::size_t c = 0; c < 2; ++c)
        load(static_cast<Eigen::Index>(2 * at.node[k] + c)) += at.weight[k] * set.solver().contact(i).force_n[c];
  }
  const Eigen::VectorXd u = whole.statics().solve(load);
  const auto unit_load = [&](std::size_t i) {
    const contact::Embedding& at = set.point(i).at;
    Eigen::MatrixXd unit = Eigen::MatrixXd::Zero(whole.statics().degrees_of_freedom(), 2);
    for (std::uint32_t k = 0; k < at.count; ++k)
      for (Eigen::Index c = 0; c < 2; ++c) unit(2 * static_cast<Eigen::Index>(at.node[k]) + c, c) += at.weight[k];
    return unit;
  };
  Balance balance;
  Wrench sum;
  const Vector2 t = hand.axis();
  for (std::size_t i = 0; i < set.size(); ++i) {
    const contact::Embedding& at = set.point(i).at;
    const Eigen::MatrixXd moved = whole.statics().solve(unit_load(i));
    const Vector2& f = set.solver().contact(i).force_n;
    // What the tie gives way: its compliance beyond the mesh's, its own and with the contacts beside it.
    Vector2 x{};
    for (std::size_t j = i == 0 ? 0 : i - 1; j < std::min(i + 2, set.size()); ++j) {
      const Eigen::Matrix2d raw = moved.transpose() * unit_load(j);
      const contact::Block tied = set.solver().compliance(i, j);
      const Vector2& g = set.solver().contact(j).force_n;
      x = {x[0] + (tied[0] - raw(0, 0)) * g[0] + (tied[1] - raw(0, 1)) * g[1],
           x[1] + (tied[2] - raw(1, 0)) * g[0] + (tied[3] - raw(1, 1)) * g[1]};
    }
    const bool embedded = hand.method() == contact::Method::Embedded;
    if (i + (embedded ? 2 : 1) < set.size()) {
      double stretch_m = std::hypot(x[0], x[1]);
      if (embedded) {
        const Vector2 jump = jump_m(whole, set, i);
        stretch_m = 1.0;
        // The middle may lie on an edge: either cell will do.
        for (const double beyond_m : {-1e-5, 0.0, 1e-5}) {
          const Vector2 ridge = ridge_m(whole, set.point(i), set.point(i + 1).path_m - set.point(i).path_m, f, beyond_m);
          stretch_m = std::min(stretch_m, std::hypot(x[0] - ridge[0] - jump[0], x[1] - ridge[1] - jump[1]));
        }
      }
      balance.stretch_m = std::max(balance.stretch_m, stretch_m);
    }
    for (std::uint32_t k = 0; k < at.count; ++k)
      for (std::size_t c = 0; c < 2; ++c)
        x[c] += at.weight[k] * (whole.mesh().node[at.node[k]][c] + u(static_cast<Eigen::Index>(2 * at.node[k] + c)));
    const Vector2 arm{x[0] - hand.pose.x_m, x[1] - hand.pose.y_m};
    sum.fx_n += f[0];
    sum.fy_n += f[1];
    sum.tau_nm += arm[0] * f[1] - arm[1] * f[0];
    balance.off_axis_m = std::max(balance.off_axis_m, std::abs(t[0] * arm[1] - t[1] * arm[0]));
  }
  balance.wrench = std::max(
      {std::abs(sum.fx_n - hand.base().fx_n), std::abs(sum.fy_n - hand.base().fy_n), std::abs(sum.tau_nm - hand.base().tau_nm) / needle_m});
  return balance;
}

// The whole mesh as a method has adapted it; null when nothing was moved.
[[nodiscard]] inline std::unique_ptr<reference::GridImage> adapted(const reference::GridImage& grid, const Hand& hand) {
  const contact::Geometry& geometry = hand.model().working_set().geometry();
  std::vector<std::pair<std::uint32_t, model::Vector2>> moves;
  for (std::uint32_t n = 0; n < grid.mesh().node.size(); ++n)
    if (geometry.is_moved(n)) moves.emplace_back(n, geometry.node_m(n));
  return moves.empty() ? nullptr : grid.with_moved(moves);
}

}  // namespace trocar::insertion::testing
