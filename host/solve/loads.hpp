// Loads on nodes from a table.
#pragma once

#include <Eigen/Core>
#include <filesystem>

#include "common/fem/mesh.hpp"

namespace trocar::host {

struct Loads {
  Eigen::VectorXd force_n{};  // dimension() entries a node
  std::size_t rows{};         // of the table
  std::size_t nodes{};        // that carry one
};

// CSV x_m,y_m,fx_n,fy_n, for solids x_m,y_m,z_m,fx_n,fy_n,fz_n: forces on the nodes at these places; several on one node add up.
// Throws config::UserError with FILE:LINE for a place that is no node (up to 1e-9 m, or 1e-9 of a mesh larger than 1 m), naming the
// nearest, and for the header of the other dimension.
[[nodiscard]] Loads read_loads(const std::filesystem::path& file, const fem::Mesh& mesh);

}  // namespace trocar::host
