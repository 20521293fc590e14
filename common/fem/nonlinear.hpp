// Static equilibrium at large displacement: Green-Lagrange strain, St. Venant-Kirchhoff material (element.hpp), dead loads.
//   find u with  f_int(u) = load,  f_int the derivative of the strain energy;  K_T(u) du = load - f_int(u),  u <- u + s du
// The load is applied in steps. s = 1 where that at least halves the work rate g(s) = du . (f_int(u + s du) - load); else the potential
// energy, a quartic polynomial along any line for this material, is minimised: g is a cubic, known from g(0), g'(0) = -g(0), g(1/2) and
// g(1). A step that fails (tangent not positive definite, no convergence, an element turned inside out) is halved and tried again from the
// last equilibrium. The material has a limit in compression: at a stretch of 1/sqrt(3) in one direction its force falls. Beyond there is no
// answer, and it says so.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

struct NonlinearOptions {
  int load_steps{1};
  int max_iterations{30};   // of Newton, each step; near nu = 0.5 some 25 pass before its quadratic end, else fewer than 10
  int max_halvings{10};     // a step is never shorter than 1/1024 of the first
  double tolerance{1e-10};  // residual over the larger of load and support forces, Euclidean norms over degrees of freedom
};

struct NonlinearResult {
  bool converged{};
  Eigen::VectorXd displacement_m{};  // of the last equilibrium that was reached: at load_fraction of the load
  double load_fraction{};            // 1 when converged
  double residual_n{};               // there, Euclidean norm over free degrees of freedom
  int steps{};                       // that led there
  int halvings{};
  int iterations{};                   // factorisations, those of failed steps included
  std::vector<double> residuals_n{};  // before each iteration of the last step, and after the last one
  std::string failure{};              // why the next step failed, in words; empty when converged
};

// `loads_n` as for Statics: on supported degrees of freedom ignored; they move to `prescribed_m` in proportion to the load (zero when
// empty; rows of free ones are ignored). Throws Error: all that Statics throws for the mesh and tissue, loads of another size or not
// finite, options out of range. Not converging is no Error but a result.
[[nodiscard]] NonlinearResult solve_green_lagrange(const Mesh& mesh, const Tissue& tissue, const Eigen::VectorXd& loads_n,
                                                   const NonlinearOptions& options = {}, const Eigen::VectorXd& prescribed_m = {});

}  // namespace trocar::fem
