// Stress of a solution, one value an element, for pictures.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

using Stress = std::array<double, 6>;  // Pa: xx, yy, zz, xy, yz, zx

// At the centre of each element: Cauchy stress of small strain, second Piola-Kirchhoff stress of Green-Lagrange strain (tissue.strain says
// which). `displacement_m` has dimension() entries a node. Throws Error for materials as Statics does.
[[nodiscard]] std::vector<Stress> centre_stresses(const Mesh& mesh, const Tissue& tissue, const Eigen::VectorXd& displacement_m);

[[nodiscard]] double von_mises_pa(const Stress& stress) noexcept;

}  // namespace trocar::fem
