#include "common/fem/statics.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace trocar::fem {

Statics::Statics(const Mesh& mesh, const Tissue& tissue) {
  const std::vector<bool> fixed = supported_degrees_of_freedom(mesh, tissue.supports);
  stiffness_ = assemble_stiffness(mesh, tissue);

  equation_.assign(fixed.size(), -1);
  for (std::size_t i = 0; i < fixed.size(); ++i)
    if (!fixed[i]) equation_[i] = equations_++;
  if (equations_ == 0) return;

  // Equations keep the order of the degrees of freedom, so each column stays sorted.
  Eigen::SparseMatrix<double> reduced(equations_, equations_);
  reduced.reserve(stiffness_.nonZeros() / 2 + equations_);
  std::vector<int> unknown;
  for (Eigen::Index column = 0; column < stiffness_.cols(); ++column) {
    const int j = equation_[static_cast<std::size_t>(column)];
    if (j < 0) continue;
    unknown.push_back(static_cast<int>(column));
    reduced.startVec(j);
    for (Eigen::SparseMatrix<double>::InnerIterator it(stiffness_, column); it; ++it) {
      const int i = equation_[static_cast<std::size_t>(it.row())];
      if (i >= j) reduced.insertBack(i, j) = it.value();
    }
  }
  reduced.finalize();
  try {
    factor_ = std::make_unique<Factor>(reduced);
  } catch (const NotPositiveDefinite& failure) {
    const auto node = static_cast<std::size_t>(unknown[static_cast<std::size_t>(failure.row)] / mesh.dimension());
    const Point& x = mesh.node[node];
    throw Error(
        "the tissue can move without strain near node " + std::to_string(node) + " at (" + std::to_string(x[0]) + ", " +
        std::to_string(x[1]) + (mesh.dimension() == 3 ? ", " + std::to_string(x[2]) : "") +
        ") m: a part hangs on a single node or edge like a hinge, or its material is too soft beside the rest; add a support or join it");
  } catch (const std::bad_alloc&) {
    throw Error("the factor of " + std::to_string(equations_) + " unknowns does not fit in memory; take a coarser mesh");
  }
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n) const {
  return solve(loads_n, Eigen::MatrixXd::Zero(loads_n.rows(), loads_n.cols()));
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n, const Eigen::MatrixXd& prescribed_m) const {
  Eigen::MatrixXd displacement = prescribed_m;
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i).setZero();
  if (equations_ == 0) return displacement;
  const Eigen::MatrixXd remaining = loads_n - stiffness_ * displacement;
  Eigen::MatrixXd right(equations_, loads_n.cols());
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) right.row(equation_[static_cast<std::size_t>(i)]) = remaining.row(i);
  const Eigen::MatrixXd solution = factor_->solve(right);
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i) = solution.row(equation_[static_cast<std::size_t>(i)]);
  return displacement;
}

void Statics::solve_columns(const Eigen::SparseMatrix<double>& loads_n, Eigen::Index block, const Sink& sink) const {
  Eigen::SparseMatrix<double> right(equations_, loads_n.cols());
  right.reserve(loads_n.nonZeros());
  for (Eigen::Index column = 0; column < loads_n.cols(); ++column) {
    right.startVec(column);
    for (Eigen::SparseMatrix<double>::InnerIterator it(loads_n, column); it; ++it)
      if (const int i = equation_[static_cast<std::size_t>(it.row())]; i >= 0) right.insertBack(i, column) = it.value();
  }
  right.finalize();
  Eigen::MatrixXd displacement;
  const auto expand = [&](Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& x) {
    displacement.setZero(degrees_of_freedom(), x.cols());
    for (Eigen::Index i = 0; i < displacement.rows(); ++i)
      if (!supported(i)) displacement.row(i) = x.row(equation_[static_cast<std::size_t>(i)]);
    sink(first, displacement);
  };
  if (equations_ > 0) return factor_->solve_columns(right, block, expand);
  for (Eigen::Index first = 0; first < loads_n.cols(); first += block)
    sink(first, Eigen::MatrixXd::Zero(degrees_of_freedom(), std::min(block, loads_n.cols() - first)));
}

}  // namespace trocar::fem
