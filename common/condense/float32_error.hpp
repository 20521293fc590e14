// What storing a compliance in float32 would do.
#pragma once

#include <Eigen/Core>

#include "common/condense/candidates.hpp"
#include "common/model/image.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

// Contacts of the reference line: points along the corridor's centre line (without one: the middle of the candidates, along y), at least
// an element and law.spacing_m apart, tied by the cells' shape functions; those on fixed nodes are left out. 2 columns a contact.
[[nodiscard]] Eigen::SparseMatrix<double> reference_line(const Candidates& candidates, const scene::Scene& scene, double spacing_m);

// `compliance` is (2 nodes)^2. Forces: G f = u with G = H C H^T, u one unit along x, then along y, on all contacts of the line.
[[nodiscard]] model::Float32Error float32_error(const Eigen::MatrixXd& compliance, const Eigen::SparseMatrix<double>& line);

}  // namespace trocar::condense
