#include "common/fem/factor.hpp"

#include <Eigen/SparseCholesky>

#include "common/fem/tissue.hpp"

namespace trocar::fem {
namespace {

class EigenFactor final : public SparseFactor {
 public:
  explicit EigenFactor(const Eigen::SparseMatrix<double>& matrix) : ldlt_(matrix) {
    if (ldlt_.info() != Eigen::Success || !(ldlt_.vectorD().minCoeff() > 0.0))
      throw Error("the stiffness matrix is not positive definite; a part of the mesh may be unsupported or badly shaped");
  }
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right_hand_sides) const override { return ldlt_.solve(right_hand_sides); }

 private:
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> ldlt_;
};

}  // namespace

std::unique_ptr<SparseFactor> factorise(const Eigen::SparseMatrix<double>& matrix) { return std::make_unique<EigenFactor>(matrix); }

}  // namespace trocar::fem
