// The candidate mesh of a scene, in the needle's plane, and how its nodes hold on to the tissue.
//   Planar models: the elements that touch the corridor, and one ring of elements around them (mesh adaptation moves nodes of the outer
//     ones too). Candidate nodes are the mesh's own.
//   Solids: a grid of quads in the plane z = plane_z_m. Of a structured grid it has the axes' own coordinates, so its nodes lie on
//     the tissue's where the plane does; of other meshes uniform lines, spaced by their mean edge. Quads whose corners and centre lie in
//     the tissue and which reach into the corridor. Each node is tied to the tissue by the mean over a ball (spread.hpp).
#pragma once

#include <Eigen/SparseCore>
#include <vector>

#include "common/condense/topology.hpp"
#include "common/fem/mesh.hpp"
#include "common/model/tissue.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

struct Candidates {
  std::vector<model::Vector2> node_m{};
  std::vector<std::uint8_t> flags{};
  std::vector<model::Cell> cell{};
  std::vector<element::Material> material{};  // of the scene's zones
  Lists ring{};
  SearchBuckets buckets{};
  double edge_length_m{};  // mean over the cells in the corridor, without the ring around them
  // P: forces on the tissue's degrees of freedom per candidate force; one column each, 2 * node + axis. P^T gives displacements back.
  Eigen::SparseMatrix<double> load{};

  [[nodiscard]] std::size_t columns() const { return 2 * node_m.size(); }
};

// Throws fem::Error: no element in the corridor, plane outside of the tissue, solid with a needle of unknown diameter, and what the mesh's
// functions throw.
[[nodiscard]] Candidates candidates_of(const fem::Mesh& mesh, const scene::Scene& scene);

}  // namespace trocar::condense
