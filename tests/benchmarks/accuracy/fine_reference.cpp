#include "tests/benchmarks/accuracy/fine_reference.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "common/fem/statics.hpp"
#include "tests/reference/box_qp.hpp"

namespace trocar::bench {
namespace {

constexpr double smallest_m = 4e-5;
constexpr double growth = 1.2;

// From 0 to length, intervals that grow from 0 on.
std::vector<double> graded(double length_m) {
  std::vector<double> x{0.0};
  for (double step = smallest_m; x.back() < length_m; step *= growth) x.push_back(x.back() + step);
  const double scale = length_m / x.back();
  for (double& each : x) each *= scale;
  return x;
}

void append(std::vector<double>& axis, double from, const std::vector<double>& more, double sign) {
  for (const double x : more) axis.push_back(from + sign * x);
}

std::vector<double> finish(std::vector<double> axis, int level) {
  std::sort(axis.begin(), axis.end());
  std::vector<double> x;
  for (const double each : axis)
    if (x.empty() || each - x.back() > 1e-9) x.push_back(each);
  for (int k = 0; k < level; ++k) {
    std::vector<double> halved{x.front()};
    for (std::size_t i = 1; i < x.size(); ++i) {
      halved.push_back(0.5 * (x[i - 1] + x[i]));
      halved.push_back(x[i]);
    }
    x = std::move(halved);
  }
  return x;
}

// The shaft is the line x = entry_x_m until the mesh is sheared.
struct FineMesh {
  fem::Mesh mesh{};
  std::vector<int> shaft{};  // from entry to tip
};

FineMesh make(const Path& path, double depth_m, int level) {
  const double tip_y_m = path.at(depth_m)[1];
  std::vector<double> x, y;
  append(x, path.entry_x_m, graded(path.entry_x_m + 0.5 * side_m), -1.0);
  append(x, path.entry_x_m, graded(0.5 * side_m - path.entry_x_m), 1.0);
  append(y, 0.0, graded(0.5 * tip_y_m), 1.0);
  append(y, tip_y_m, graded(0.5 * tip_y_m), -1.0);
  append(y, tip_y_m, graded(side_m - tip_y_m), 1.0);
  fem::Grid grid;
  grid.element = fem::Type::Quad4;
  grid.axis_m[0] = finish(x, level);
  grid.axis_m[1] = finish(y, level);
  FineMesh fine;
  fine.mesh = fem::structured_grid(grid);
  for (std::size_t n = 0; n < fine.mesh.node.size(); ++n) {
    fem::Point& at = fine.mesh.node[n];
    const double shaft_x_m = path.entry_x_m + at[1] * std::tan(path.angle_rad);
    if (std::abs(at[0] - path.entry_x_m) < 1e-10) {
      at[0] = shaft_x_m;
      if (at[1] < tip_y_m + 1e-10) fine.shaft.push_back(static_cast<int>(n));
      continue;
    }
    const double edge = at[0] < path.entry_x_m ? -0.5 * side_m : 0.5 * side_m;
    at[0] = edge + (at[0] - edge) * (shaft_x_m - edge) / (path.entry_x_m - edge);
  }
  return fine;
}

}  // namespace

// The thresholds of 30 mm sum to 1.1 N, and stuck they would take 193 N/m.
double slip_motion_m(double depth_m) { return 0.13 * depth_m; }

Answer fine_answer(const Path& path, double depth_m, int level, const std::vector<fem::Point>& places) {
  const FineMesh fine = make(path, depth_m, level);
  const fem::Locator locator(fine.mesh);
  const auto [tx, ty] = path.tangent();
  Answer answer;

  const fem::Tissue tissue = block_tissue();
  {
    fem::Mesh held_mesh = fine.mesh;
    std::vector<int> shaft = fine.shaft;
    std::sort(shaft.begin(), shaft.end());
    held_mesh.group["shaft"] = shaft;
    fem::Tissue held = tissue;
    held.supports.push_back({std::string("shaft"), {true, true, false}});
    const fem::Statics statics(held_mesh, held);
    Eigen::MatrixXd prescribed = Eigen::MatrixXd::Zero(statics.degrees_of_freedom(), 2);
    for (const int n : fine.shaft) prescribed.block<2, 2>(2 * n, 0) << tx, -ty, ty, tx;
    const Eigen::MatrixXd u = statics.solve(Eigen::MatrixXd::Zero(statics.degrees_of_freedom(), 2), prescribed);
    const Eigen::MatrixXd f = statics.stiffness_n_per_m() * u;
    answer.force_n.resize(2 * static_cast<Eigen::Index>(fine.shaft.size()), 3);
    for (const int n : fine.shaft) {
      answer.force_n.block<2, 2>(2 * static_cast<Eigen::Index>(answer.shaft_m.size()), 0) = f.block<2, 2>(2 * n, 0);
      answer.shaft_m.push_back(fine.mesh.node[static_cast<std::size_t>(n)]);
      answer.axial_n_per_m += tx * f(2 * n, 0) + ty * f(2 * n + 1, 0);
      answer.lateral_n_per_m += -ty * f(2 * n, 1) + tx * f(2 * n + 1, 1);
    }
    answer.axial_visible = displacement_at(locator, u.col(0), places);
    answer.lateral_visible = displacement_at(locator, u.col(1), places);
  }

  const fem::Statics statics(fine.mesh, tissue);
  const auto s = static_cast<Eigen::Index>(fine.shaft.size());
  std::vector<Eigen::Triplet<double>> unit;
  std::vector<bool> wanted(static_cast<std::size_t>(statics.degrees_of_freedom()), false);
  for (Eigen::Index i = 0; i < s; ++i)
    for (int axis = 0; axis < 2; ++axis) {
      const int row = 2 * fine.shaft[static_cast<std::size_t>(i)] + axis;
      unit.emplace_back(row, 2 * i + axis, 1.0);
      wanted[static_cast<std::size_t>(row)] = true;
    }
  Eigen::SparseMatrix<double> loads(statics.degrees_of_freedom(), 2 * s);
  loads.setFromTriplets(unit.begin(), unit.end());
  reference::BoxQp qp;
  qp.compliance_m_per_n.resize(2 * s, 2 * s);
  statics.solve_columns(loads, 64, wanted, [&](Eigen::Index first, const auto& u) {
    for (Eigen::Index i = 0; i < s; ++i)
      qp.compliance_m_per_n.block(2 * i, first, 2, u.cols()) = u.middleRows(2 * fine.shaft[static_cast<std::size_t>(i)], 2);
  });
  qp.compliance_m_per_n = (0.5 * (qp.compliance_m_per_n + qp.compliance_m_per_n.transpose())).eval();
  std::vector<double> depth;
  for (const int n : fine.shaft) depth.push_back(fine.mesh.node[static_cast<std::size_t>(n)][1] / ty);
  const double motion_m = slip_motion_m(depth_m);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const double begin = i == 0 ? 0.0 : 0.5 * (depth[i - 1] + depth[i]);
    const double end = i + 1 == depth.size() ? depth[i] : 0.5 * (depth[i] + depth[i + 1]);
    qp.contact.push_back(
        {{tx, ty}, {motion_m * tx, motion_m * ty}, -shaft_n_per_m * (end - begin), density_integral_n(begin, end, depth_m)});
  }
  const reference::Solution found = reference::projected_gauss_seidel(qp, 1e-9, 3000);
  if (!found.solved) throw std::runtime_error("the fine mesh's stick-slip problem was not solved");
  answer.force_n.col(2) = found.force_n;
  Eigen::VectorXd f = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
  for (Eigen::Index i = 0; i < s; ++i) {
    f.segment<2>(2 * fine.shaft[static_cast<std::size_t>(i)]) = found.force_n.segment<2>(2 * i);
    answer.slip_force_n += tx * found.force_n(2 * i) + ty * found.force_n(2 * i + 1);
    const auto k = static_cast<std::size_t>(i);
    if (found.state[k] != reference::Axial::Stuck) answer.slipping += qp.contact[k].upper_n;
  }
  answer.slipping /= density_integral_n(0.0, depth_m, depth_m);
  const Eigen::VectorXd u = statics.solve(f);
  answer.slip_visible_m = displacement_at(locator, u, places);
  answer.tip_m = tx * u(2 * fine.shaft.back()) + ty * u(2 * fine.shaft.back() + 1);
  return answer;
}

Answer extrapolated(const Answer& coarser, const Answer& finer) {
  Answer answer = finer;
  const auto go_on = [](auto& to, const auto& from) {
    constexpr double more = 1.0 / (2.9 - 1.0);
    to += more * (to - from);
  };
  go_on(answer.axial_n_per_m, coarser.axial_n_per_m);
  go_on(answer.lateral_n_per_m, coarser.lateral_n_per_m);
  go_on(answer.slip_force_n, coarser.slip_force_n);
  go_on(answer.tip_m, coarser.tip_m);
  go_on(answer.axial_visible, coarser.axial_visible);
  go_on(answer.lateral_visible, coarser.lateral_visible);
  go_on(answer.slip_visible_m, coarser.slip_visible_m);
  return answer;
}

}  // namespace trocar::bench
