// Static equilibrium K u = f of a supported planar mesh, factored once.
//   f  loads on the nodes [N], u  displacements [m]; 2 rows a node, x before y. On supported degrees of freedom u is given
//   (zero unless stated) and f is ignored. A = K^-1 on the free ones is symmetric positive definite.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>
#include <span>
#include <vector>

#include "common/fem/factor.hpp"
#include "common/fem/mesh.hpp"

namespace trocar::fem {

class Statics {
 public:
  // Throws Error: bad material, inverted element, an element without material, a support that holds no node, a mesh that
  // can still move as a rigid body.
  Statics(const Mesh& mesh, const Tissue& tissue);

  [[nodiscard]] Eigen::Index degrees_of_freedom() const { return stiffness_.rows(); }
  [[nodiscard]] bool supported(Eigen::Index degree_of_freedom) const { return equation_[static_cast<std::size_t>(degree_of_freedom)] < 0; }
  [[nodiscard]] const Eigen::SparseMatrix<double>& stiffness_n_per_m() const { return stiffness_; }  // before supports

  // One column a load case.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& loads_n) const;
  // With displacements prescribed on the supported degrees of freedom (other rows of `prescribed_m` are ignored).
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& loads_n, const Eigen::MatrixXd& prescribed_m) const;

 private:
  Eigen::SparseMatrix<double> stiffness_{};
  std::vector<Eigen::Index> equation_{};  // row in the factored system, -1 where supported
  Eigen::Index equations_{};
  std::unique_ptr<SparseFactor> factor_{};
};

// u at nodes for a unit load at every listed degree of freedom: columns of A, zero rows where supported. Blocked, so that
// memory stays near the result's own size.
[[nodiscard]] Eigen::MatrixXd compliance_columns(const Statics& statics, std::span<const Eigen::Index> degrees_of_freedom);

}  // namespace trocar::fem
