// A sparse Cholesky factor whose values are computed again and again on one symbolic analysis: what common/fem's factor, made once, does
// not offer. CHOLMOD supernodal, approximate minimum degree or METIS, whichever it predicts to be cheaper. Allocates in its constructor
// only.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>

namespace trocar::partner {

class SparseCholesky {
 public:
  // Keeps the lower triangle's pattern and values; factor() must follow. Throws std::runtime_error when CHOLMOD fails.
  explicit SparseCholesky(const Eigen::SparseMatrix<double>& matrix);
  ~SparseCholesky();
  SparseCholesky(const SparseCholesky&) = delete;
  SparseCholesky& operator=(const SparseCholesky&) = delete;

  [[nodiscard]] Eigen::Index rows() const;
  [[nodiscard]] int slot(int row, int column) const;  // of entry (row, column) or its mirror in values(); throws when the pattern lacks it
  [[nodiscard]] double* values();
  void factor();  // of the values as they are now; throws std::runtime_error when not positive definite
  // One or many columns. The view holds until the next call.
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> solve(const Eigen::Ref<const Eigen::MatrixXd>& right_hand_sides);
  [[nodiscard]] double factor_nonzeros() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace trocar::partner
