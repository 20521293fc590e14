// Static equilibrium K u = f of a supported mesh, small strain, factored once.
//   f  loads on the nodes [N], u  displacements [m]; dimension() rows a node, x, y[, z]. On supported degrees of freedom u is given
//   (zero unless stated) and f is ignored. A = K^-1 on the free ones is symmetric positive definite.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>
#include <vector>

#include "common/fem/assembly.hpp"
#include "common/fem/factor.hpp"
#include "common/fem/mesh.hpp"

namespace trocar::fem {

// Which degrees of freedom the supports hold. Throws Error: a support that holds no node or fixes nothing, a mesh (or a part of it that
// hangs together with the rest through no node) that can still move as a rigid body, naming the motion.
[[nodiscard]] std::vector<bool> supported_degrees_of_freedom(const Mesh& mesh, const std::vector<Support>& supports);

// Material of each element. Throws Error: value out of range, element without material, unknown region, model that does not fit the
// mesh's dimension, thickness that is not positive.
[[nodiscard]] std::vector<element::Elasticity> elasticities(const Mesh& mesh, const Tissue& tissue);

// N/m, both triangles, before supports. Throws Error as above, and for an inverted element.
[[nodiscard]] Eigen::SparseMatrix<double> assemble_stiffness(const Mesh& mesh, const Tissue& tissue);

class Statics {
 public:
  using Sink = Factor::Sink;

  // Throws Error: all of the above. The tissue's grid and file are not looked at: the mesh is what counts.
  Statics(const Mesh& mesh, const Tissue& tissue);

  [[nodiscard]] Eigen::Index degrees_of_freedom() const { return stiffness_.rows(); }
  [[nodiscard]] bool supported(Eigen::Index degree_of_freedom) const { return equations_.supported(degree_of_freedom); }
  [[nodiscard]] const Eigen::SparseMatrix<double>& stiffness_n_per_m() const { return stiffness_; }  // before supports
  [[nodiscard]] Factor::Info factor_info() const { return factor_ ? factor_->info() : Factor::Info{}; }

  // One column a load case.
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& loads_n) const;
  // With displacements prescribed on the supported degrees of freedom (other rows of `prescribed_m` are ignored).
  [[nodiscard]] Eigen::MatrixXd solve(const Eigen::MatrixXd& loads_n, const Eigen::MatrixXd& prescribed_m) const;
  // Many sparse load cases, as Factor::solve_columns: sink(first, u) with u degrees_of_freedom() x (columns of the block).
  void solve_columns(const Eigen::SparseMatrix<double>& loads_n, Eigen::Index block, const Sink& sink) const;
  // The same where few rows of u are looked at: those that are not `wanted` (one entry a degree of freedom) are zero, and what leads to
  // them alone is not computed.
  void solve_columns(const Eigen::SparseMatrix<double>& loads_n, Eigen::Index block, const std::vector<bool>& wanted,
                     const Sink& sink) const;

 private:
  Equations equations_;
  Eigen::SparseMatrix<double> stiffness_{};
  std::unique_ptr<Factor> factor_{};
};

}  // namespace trocar::fem
