#include "common/fem/statics.hpp"

#include <algorithm>
#include <string>

namespace trocar::fem {

Statics::Statics(const Mesh& mesh, const Tissue& tissue)
    : equations_(supported_degrees_of_freedom(mesh, tissue.supports)), stiffness_(assemble_stiffness(mesh, tissue)) {
  if (equations_.count() == 0) return;
  try {
    factor_ = std::make_unique<Factor>(equations_.reduce(stiffness_));
  } catch (const NotPositiveDefinite& failure) {
    throw Error(
        "the tissue can move without strain near " + node_in_words(mesh, equations_.unknown[static_cast<std::size_t>(failure.row)]) +
        ": a part hangs on a single node or edge like a hinge, or its material is too soft beside the rest; add a support or join it");
  } catch (const std::bad_alloc&) {
    throw Error("the factor of " + std::to_string(equations_.count()) + " unknowns does not fit in memory; take a coarser mesh");
  }
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n) const {
  return solve(loads_n, Eigen::MatrixXd::Zero(loads_n.rows(), loads_n.cols()));
}

Eigen::MatrixXd Statics::solve(const Eigen::MatrixXd& loads_n, const Eigen::MatrixXd& prescribed_m) const {
  Eigen::MatrixXd displacement = prescribed_m;
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i).setZero();
  if (equations_.count() == 0) return displacement;
  const Eigen::MatrixXd remaining = loads_n - stiffness_ * displacement;
  Eigen::MatrixXd right(equations_.count(), loads_n.cols());
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) right.row(equations_.row[static_cast<std::size_t>(i)]) = remaining.row(i);
  const Eigen::MatrixXd solution = factor_->solve(right);
  for (Eigen::Index i = 0; i < displacement.rows(); ++i)
    if (!supported(i)) displacement.row(i) = solution.row(equations_.row[static_cast<std::size_t>(i)]);
  return displacement;
}

void Statics::solve_columns(const Eigen::SparseMatrix<double>& loads_n, Eigen::Index block, const Sink& sink) const {
  solve_columns(loads_n, block, std::vector<bool>(static_cast<std::size_t>(degrees_of_freedom()), true), sink);
}

void Statics::solve_columns(const Eigen::SparseMatrix<double>& loads_n, Eigen::Index block, const std::vector<bool>& wanted,
                            const Sink& sink) const {
  if (equations_.count() == 0) {
    for (Eigen::Index first = 0; first < loads_n.cols(); first += block)
      sink(first, Eigen::MatrixXd::Zero(degrees_of_freedom(), std::min(block, loads_n.cols() - first)));
    return;
  }
  Eigen::SparseMatrix<double> right(equations_.count(), loads_n.cols());
  right.reserve(loads_n.nonZeros());
  for (Eigen::Index column = 0; column < loads_n.cols(); ++column) {
    right.startVec(column);
    for (Eigen::SparseMatrix<double>::InnerIterator it(loads_n, column); it; ++it)
      if (const int i = equations_.row[static_cast<std::size_t>(it.row())]; i >= 0) right.insertBack(i, column) = it.value();
  }
  right.finalize();
  Factor::Wanted rows{degrees_of_freedom(), {}, {}};
  for (std::size_t i = 0; i < wanted.size(); ++i)
    if (wanted[i] && equations_.row[i] >= 0) {
      rows.row.push_back(static_cast<int>(i));
      rows.unknown.push_back(equations_.row[i]);
    }
  factor_->solve_columns(right, block, rows, sink);
}

}  // namespace trocar::fem
