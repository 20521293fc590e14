// A factored symmetric positive definite sparse matrix. The only file pair that knows which library factors.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>

namespace trocar::fem {

class SparseFactor {
 public:
  SparseFactor() = default;
  SparseFactor(const SparseFactor&) = delete;
  SparseFactor& operator=(const SparseFactor&) = delete;
  virtual ~SparseFactor() = default;
  [[nodiscard]] virtual Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides) const = 0;
};

// Throws Error when the matrix is not positive definite. Reads the lower triangle.
[[nodiscard]] std::unique_ptr<SparseFactor> factorise(const Eigen::SparseMatrix<double>& matrix);

}  // namespace trocar::fem
