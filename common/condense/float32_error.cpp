#include "common/condense/float32_error.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "common/core/capacities.hpp"
#include "common/element/element.hpp"

namespace trocar::condense {
namespace {

using model::Vector2;

scene::Corridor centre_line(const Candidates& c, const scene::Scene& scene) {
  if (scene.corridor) return *scene.corridor;
  const SearchBuckets& b = c.buckets;
  const double middle = b.origin_m[0] + 0.5 * b.size_m[0] * b.count[0];
  return {{middle, b.origin_m[1]}, {middle, b.origin_m[1] + b.size_m[1] * b.count[1]}, 0.0};
}

// Weights of a cell's nodes at a point in it.
element::Shape weights(const Candidates& c, const model::Cell& cell, const Vector2& x) {
  const element::Type type = cell.count == 3 ? element::Type::Tri3 : element::Type::Quad4;
  element::Corners corner = element::Corners::Zero();
  for (std::size_t k = 0; k < cell.count; ++k)
    for (std::size_t axis = 0; axis < 2; ++axis)
      corner(static_cast<Eigen::Index>(axis), static_cast<Eigen::Index>(k)) = c.node_m[cell.node[k]][axis];
  Eigen::Vector3d natural = Eigen::Vector3d::Zero();
  element::Shape value = element::Shape::Zero();
  element::ShapeGradient gradient;
  if (element::natural_coordinates(type, corner, {x[0], x[1], 0.0}, natural)) element::shape(type, natural, value, gradient);
  return value;
}

}  // namespace

Eigen::SparseMatrix<double> reference_line(const Candidates& c, const scene::Scene& scene, double spacing_m) {
  const scene::Corridor line = centre_line(c, scene);
  const double length = std::hypot(line.to_m[0] - line.from_m[0], line.to_m[1] - line.from_m[1]);
  const double step = std::max({spacing_m, c.edge_length_m, length / static_cast<double>(capacity::contacts)});
  std::vector<Eigen::Triplet<double>> entries;
  int contacts = 0;
  for (double s = 0.5 * step; s < length; s += step) {
    const Vector2 x{line.from_m[0] + s / length * (line.to_m[0] - line.from_m[0]),
                    line.from_m[1] + s / length * (line.to_m[1] - line.from_m[1])};
    const std::int32_t at = cell_at(c.node_m, c.cell, c.buckets, x);
    if (at < 0) continue;
    const model::Cell& cell = c.cell[static_cast<std::size_t>(at)];
    const element::Shape w = weights(c, cell, x);
    const bool fixed = std::any_of(cell.node.begin(), cell.node.begin() + cell.count,
                                   [&](std::uint32_t n) { return (c.flags[n] & (model::fixed_x | model::fixed_y)) != 0; });
    if (fixed) continue;
    for (int axis = 0; axis < 2; ++axis)
      for (std::size_t k = 0; k < cell.count; ++k)
        entries.emplace_back(2 * static_cast<int>(cell.node[k]) + axis, 2 * contacts + axis, w(static_cast<Eigen::Index>(k)));
    ++contacts;
  }
  Eigen::SparseMatrix<double> h(static_cast<Eigen::Index>(c.columns()), 2 * contacts);
  h.setFromTriplets(entries.begin(), entries.end());
  return h;
}

model::Float32Error float32_error(const Eigen::MatrixXd& compliance, const Eigen::SparseMatrix<double>& line) {
  model::Float32Error error{};
  const Eigen::VectorXd root = compliance.diagonal().cwiseSqrt();
  for (Eigen::Index j = 0; j < compliance.cols(); ++j)
    for (Eigen::Index i = j; i < compliance.rows(); ++i) {
      const double scale = root(i) * root(j);
      const double change = std::abs(static_cast<double>(static_cast<float>(compliance(i, j))) - compliance(i, j));
      if (scale > 0.0) error.compliance = std::max(error.compliance, change / scale);
    }
  if (line.cols() == 0) return error;

  // Only the rows and columns that the line touches.
  std::vector<Eigen::Index> used;
  const Eigen::SparseMatrix<double, Eigen::RowMajor> by_row = line;
  for (Eigen::Index i = 0; i < by_row.rows(); ++i)
    if (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator(by_row, i)) used.push_back(i);
  const Eigen::MatrixXd rounded = compliance(used, used).cast<float>().cast<double>();
  const Eigen::MatrixXd exact = compliance(used, used);
  const Eigen::MatrixXd h = Eigen::MatrixXd(line)(used, Eigen::all);
  Eigen::MatrixXd u = Eigen::MatrixXd::Zero(line.cols(), 2);
  for (Eigen::Index i = 0; i < line.cols(); ++i) u(i, i % 2) = 1.0;
  const auto forces = [&](const Eigen::MatrixXd& c) -> Eigen::MatrixXd { return (h.transpose() * c * h).ldlt().solve(u); };
  const Eigen::MatrixXd f = forces(exact);
  error.force = (forces(rounded) - f).cwiseAbs().maxCoeff() / f.cwiseAbs().maxCoeff();
  return error;
}

}  // namespace trocar::condense
