// The tissue of the thesis's phantom as a square sheet, fine or coarse, with a row of contacts along its axis: the scene that the solvers
// are compared in. 100 x 100 x 11 mm, plane stress, E 25.3 kPa, nu 0.48, triangles, fixed at y_max; the needle enters at y_min and runs
// along +y.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <memory>
#include <span>
#include <vector>

#include "common/fem/statics.hpp"
#include "tests/benchmarks/partner/full_system.hpp"

namespace trocar::partner {

struct Sheet {
  fem::Mesh mesh{};
  std::unique_ptr<fem::Statics> statics{};
  Eigen::SparseMatrix<double> stiffness{};  // unsupported rows and columns, both triangles
  std::vector<int> row{};                   // of each degree of freedom in `stiffness`, -1 where supported
};

[[nodiscard]] fem::Tissue sheet_tissue(int nodes_per_side);
[[nodiscard]] Sheet make_sheet(int nodes_per_side);

// `contacts` nodes at equal steps over `depth_m` below the entry, all of one column, nearest to x = 0. Throws std::runtime_error when
// the mesh has not as many.
[[nodiscard]] std::vector<int> axis_nodes(const Sheet& sheet, std::size_t contacts, double depth_m = 0.07);

[[nodiscard]] Eigen::MatrixXd compliance(const Sheet& sheet, std::span<const int> nodes);  // m/N, 2 rows a node
[[nodiscard]] std::vector<ContactNode> contact_nodes(const Sheet& sheet, std::span<const int> nodes);

}  // namespace trocar::partner
