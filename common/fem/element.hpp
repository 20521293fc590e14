// Stiffness of planar elements.
//   sigma = C eps, eps = (eps_xx, eps_yy, gamma_xy) = B u,  K_e = integral of B^T C B over area times thickness
//   plane stress  C = E/(1-nu^2) [[1, nu, 0], [nu, 1, 0], [0, 0, (1-nu)/2]]
//   plane strain  C = E/((1+nu)(1-2nu)) [[1-nu, nu, 0], [nu, 1-nu, 0], [0, 0, (1-2nu)/2]]
// Degrees of freedom are ordered u_x, u_y node by node. quad4 is integrated with 2 x 2 points, which is exact for
// parallelograms; tri3 has constant strain. Near nu = 0.5 both lock in plane strain, not in plane stress.
#pragma once

#include <Eigen/Core>
#include <span>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

// Pa. Throws Error unless young_pa > 0 and 0 <= poisson < 0.5.
[[nodiscard]] Eigen::Matrix3d elasticity(Model model, const Material& material);

// N/m. The last two rows and columns are zero for tri3. Throws Error for an element without positive area.
using ElementStiffness = Eigen::Matrix<double, 8, 8>;
[[nodiscard]] ElementStiffness stiffness(Element type, std::span<const Point> corners, const Eigen::Matrix3d& elasticity_pa,
                                         double thickness_m);

}  // namespace trocar::fem
