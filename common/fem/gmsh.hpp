// Meshes from gmsh files (.msh), format 2.2 and 4.1, ASCII and binary.
//
// The reader is our own. Measured with libgmsh 4.8: linking it adds 150 ms and 90 shared libraries to the start of every command, and on
// files with three random bytes changed it aborted, crashed or hung in 7 of 160; here each ends in one Error.
#pragma once

#include <filesystem>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

// Elements are those of the highest dimension in the file: one of tri3, quad4, tet4, hex8, turned to positive orientation where they are
// not. Physical groups (their name, or their number in digits) of any dimension become node groups, those of the highest one regions too.
// Nodes without an element are dropped, the others keep the order of the file; planar meshes lose their one z.
// Throws Error, beginning with FILE and for ASCII files :LINE: no mesh file, another version, cut short, inconsistent, mixed or quadratic
// elements, a planar mesh that is not flat, an element in two regions.
[[nodiscard]] Mesh read_gmsh(const std::filesystem::path& file);

}  // namespace trocar::fem
