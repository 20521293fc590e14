#include "common/fem/statics.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "common/fem/element.hpp"

namespace trocar::fem {
namespace {

bool contains(const Box& box, const Point& x) {
  return x[0] >= box.min_m[0] && x[0] <= box.max_m[0] && x[1] >= box.min_m[1] && x[1] <= box.max_m[1];
}

Box bounding_box(const Mesh& mesh) {
  Box box{mesh.node.front(), mesh.node.front()};
  for (const Point& x : mesh.node)
    for (std::size_t axis = 0; axis < 2; ++axis) {
      box.min_m[axis] = std::min(box.min_m[axis], x[axis]);
      box.max_m[axis] = std::max(box.max_m[axis], x[axis]);
    }
  return box;
}

// A thin slab around an edge of the bounding box: coordinates that were computed differ in their last bits.
Box edge_box(const Box& bounds, Edge edge) {
  const double slack = 1e-9 * std::max(bounds.max_m[0] - bounds.min_m[0], bounds.max_m[1] - bounds.min_m[1]);
  Box box = bounds;
  switch (edge) {
    case Edge::XMin:
      box.max_m[0] = bounds.min_m[0];
      break;
    case Edge::XMax:
      box.min_m[0] = bounds.max_m[0];
      break;
    case Edge::YMin:
      box.max_m[1] = bounds.min_m[1];
      break;
    case Edge::YMax:
      box.min_m[1] = bounds.max_m[1];
      break;
  }
  for (std::size_t axis = 0; axis < 2; ++axis) {
    box.min_m[axis] -= slack;
    box.max_m[axis] += slack;
  }
  return box;
}

const Material& material_at(const Tissue& tissue, const Point& centroid) {
  for (auto zone = tissue.materials.rbegin(); zone != tissue.materials.rend(); ++zone)
    if (!zone->box || contains(*zone->box, centroid)) return *zone;
  throw Error("no material at (" + std::to_string(centroid[0]) + ", " + std::to_string(centroid[1]) +
              ") m; give one without a box before the others");
}

// Rigid motions (translations along x and y, rotation about the centre, scaled to be comparable) that every support allows
// span the null space of their Gram matrix over the supported degrees of freedom.
void refuse_rigid_motion(const Mesh& mesh, const std::vector<bool>& fixed) {
  const Box bounds = bounding_box(mesh);
  const Point centre{0.5 * (bounds.min_m[0] + bounds.max_m[0]), 0.5 * (bounds.min_m[1] + bounds.max_m[1])};
  const double size = std::max(bounds.max_m[0] - bounds.min_m[0], bounds.max_m[1] - bounds.min_m[1]);
  Eigen::Matrix3d gram = Eigen::Matrix3d::Zero();
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const Eigen::Vector3d along_x{1.0, 0.0, -(mesh.node[n][1] - centre[1]) / size};
    const Eigen::Vector3d along_y{0.0, 1.0, (mesh.node[n][0] - centre[0]) / size};
    if (fixed[2 * n]) gram += along_x * along_x.transpose();
    if (fixed[2 * n + 1]) gram += along_y * along_y.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(gram);
  if (eigen.eigenvalues()(0) > 1e-12 * std::max(1.0, eigen.eigenvalues()(2))) return;
  Eigen::Index direction = 0;
  eigen.eigenvectors().col(0).cwiseAbs().maxCoeff(&direction);
  constexpr std::array<const char*, 3> motion{"move along x", "move along y", "rotate"};
  throw Error(std::string("the mesh is unsupported: it can still ") + motion[static_cast<std::size_t>(direction)] +
              " as a rigid body; add a support that prevents it");
}

}  // namespace

Statics::Statics(const Mesh& mesh, const Tissue& tissue) {
  if (mesh.node.empty() || mesh.element.empty()) throw Error("the mesh has no elements");
  if (!(tissue.thickness_m > 0.0) || !std::isfinite(tissue.thickness_m))
    throw Error("thickness_m = " + std::to_string(tissue.thickness_m) + ": must be positive, such as 0.011");

  const auto size = static_cast<Eigen::Index>(2 * mesh.node.size());
  const auto corners = static_cast<std::size_t>(mesh.nodes_per_element());
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(mesh.element.size() * 4 * corners * corners);
  for (const auto& element : mesh.element) {
    std::array<Point, 4> corner{};
    Point centroid{};
    for (std::size_t k = 0; k < corners; ++k) {
      corner[k] = mesh.node[static_cast<std::size_t>(element[k])];
      for (std::size_t axis = 0; axis < 2; ++axis) centroid[axis] += corner[k][axis] / static_cast<double>(corners);
    }
    const Eigen::Matrix3d c = elasticity(tissue.model, material_at(tissue, centroid));
    const ElementStiffness k_e = stiffness(mesh.type, {corner.data(), corners}, c, tissue.thickness_m);
    for (std::size_t a = 0; a < 2 * corners; ++a)
      for (std::size_t b = 0; b < 2 * corners; ++b)
        entries.emplace_back(2 * element[a / 2] + static_cast<int>(a % 2), 2 * element[b / 2] + static_cast<int>(b % 2),
                             k_e(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)));
  }
  stiffness_.resize(size, size);
  stiffness_.setFromTriplets(entries.begin(), entries.end());

  std::vector<bool> fixed(static_cast<std::size_t>(size), false);
  const Box bounds = bounding_box(mesh);
  for (const Support& support : tissue.supports) {
    const Box region = support.box ? *support.box : edge_box(bounds, support.edge);
    bool found = false;
    for (std::size_t n = 0; n < mesh.node.size(); ++n) {
      if (!contains(region, mesh.node[n])) continue;
      found = true;
      fixed[2 * n] = fixed[2 * n] || support.fix_x;
      fixed[2 * n + 1] = fixed[2 * n + 1] || support.fix_y;
    }
    if (!found) throw Error("a support holds no node; its box must contain nodes of the mesh");
  }
  refuse_rigid_motion(mesh, fixed);

  equation_.assign(static_cast<std::size_t>(size), -1);
  for (std::size_t i = 0; i < fixed.size(); ++i)
    if (!fixed[i]) equation_[i] = equations_++;
  std::vector<Eigen::Triplet<double>> free_entries;
  free_entries.reserve(static_cast<std::size_t>(stiffness_.nonZeros()));
  for (Eigen::Index column = 0; column < size; ++column)
    for (Eigen::SparseMatrix<double>::InnerIterator it(stiffness_, column); it; ++it) {
      const Eigen::Index i = equation_[static_cast<std::size_t>(it.row())];
      const Eigen::Index j = equation_[static_cast<std::size_t>(column)];
      if (i >= 0 && j >= 0) free_entries.emplace_back(static_cast<int>(i), static_cast<int>(j), it.value());
    }
  if (equations_ == 0) return;
  Eigen::SparseMatrix<double> reduced(equations_, equations_);
  reduced.setFromTriplets(free_entries.begin(), free_entries.end());
  factor_ = factorise(reduced);
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n) const {
  return solve(loads_n, Eigen::MatrixXd::Zero(loads_n.rows(), loads_n.cols()));
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n, const Eigen::MatrixXd& prescribed_m) const {
  Eigen::MatrixXd displacement = prescribed_m;
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i).setZero();
  const Eigen::MatrixXd remaining = loads_n - stiffness_ * displacement;
  if (equations_ == 0) return displacement;
  Eigen::MatrixXd right(equations_, loads_n.cols());
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) right.row(equation_[static_cast<std::size_t>(i)]) = remaining.row(i);
  const Eigen::MatrixXd solution = factor_->solve(right);
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i) = solution.row(equation_[static_cast<std::size_t>(i)]);
  return displacement;
}

Eigen::MatrixXd compliance_columns(const Statics& statics, std::span<const Eigen::Index> degrees_of_freedom) {
  constexpr Eigen::Index block = 64;
  const auto columns = static_cast<Eigen::Index>(degrees_of_freedom.size());
  Eigen::MatrixXd result(statics.degrees_of_freedom(), columns);
  for (Eigen::Index first = 0; first < columns; first += block) {
    const Eigen::Index count = std::min(block, columns - first);
    Eigen::MatrixXd loads = Eigen::MatrixXd::Zero(statics.degrees_of_freedom(), count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index row = degrees_of_freedom[static_cast<std::size_t>(first + k)];
      loads(row, k) = 1.0;
    }
    result.middleCols(first, count) = statics.solve(loads);
  }
  return result;
}

}  // namespace trocar::fem
