// Materials and stiffness of statics.hpp.
#include <algorithm>
#include <cmath>
#include <string>

#include "common/fem/statics.hpp"

namespace trocar::fem {
namespace {

// Nodes that share an element with each node, itself among them: neighbour[begin[n]] … increasing.
struct Neighbours {
  std::vector<std::size_t> begin;
  std::vector<int> neighbour;
};

Neighbours neighbours_of(const Mesh& mesh) {
  const auto corners = static_cast<std::size_t>(mesh.nodes_per_element());
  std::vector<std::size_t> begin(mesh.node.size() + 1, 0);
  for (const auto& e : mesh.element)
    for (std::size_t k = 0; k < corners; ++k) ++begin[static_cast<std::size_t>(e[k]) + 1];
  for (std::size_t n = 0; n < mesh.node.size(); ++n) begin[n + 1] += begin[n];
  std::vector<std::size_t> fill(begin.begin(), begin.end() - 1);
  std::vector<int> around(begin.back());
  for (std::size_t e = 0; e < mesh.element.size(); ++e)
    for (std::size_t k = 0; k < corners; ++k) around[fill[static_cast<std::size_t>(mesh.element[e][k])]++] = static_cast<int>(e);

  Neighbours result;
  result.begin.push_back(0);
  std::vector<int> found;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    found.clear();
    for (std::size_t at = begin[n]; at < begin[n + 1]; ++at) {
      const auto& e = mesh.element[static_cast<std::size_t>(around[at])];
      found.insert(found.end(), e.begin(), e.begin() + static_cast<std::ptrdiff_t>(corners));
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    result.neighbour.insert(result.neighbour.end(), found.begin(), found.end());
    result.begin.push_back(result.neighbour.size());
  }
  return result;
}

void require_valid(const Material& material) {
  if (!(material.young_pa > 0.0) || !std::isfinite(material.young_pa))
    throw Error("young_pa = " + std::to_string(material.young_pa) + ": must be positive, for soft tissue 1e3 to 1e6 Pa");
  if (!(material.poisson >= 0.0 && material.poisson < 0.5))
    throw Error("poisson = " + std::to_string(material.poisson) + ": must be at least 0 and below 0.5, such as 0.48");
}

}  // namespace

std::vector<element::Elasticity> elasticities(const Mesh& mesh, const Tissue& tissue) {
  const bool solid = tissue.model == Model::Solid;
  if (solid != (mesh.dimension() == 3))
    throw Error(solid ? "model solid needs tet4 or hex8 elements, and the mesh is planar; take plane_stress or plane_strain"
                      : "a mesh of tet4 or hex8 elements needs the model solid");
  if (!solid && (!(tissue.thickness_m > 0.0) || !std::isfinite(tissue.thickness_m)))
    throw Error("thickness_m = " + std::to_string(tissue.thickness_m) + ": must be positive, such as 0.011");
  std::vector<element::Elasticity> of_zone;
  for (const Zone& zone : tissue.zones) {
    require_valid(zone.material);
    of_zone.push_back(element::elasticity(tissue.model, zone.material));
  }
  return of_zone;
}

Eigen::SparseMatrix<double> assemble_stiffness(const Mesh& mesh, const Tissue& tissue) {
  if (mesh.node.empty() || mesh.element.empty()) throw Error("the mesh has no elements");
  const std::vector<element::Elasticity> elasticity = elasticities(mesh, tissue);
  const std::vector<int> zone = zones_of(mesh, tissue.zones);

  // The pattern first, column by column: d x d blocks for each pair of neighbours.
  const Neighbours neighbours = neighbours_of(mesh);
  const auto d = static_cast<std::size_t>(mesh.dimension());
  const std::size_t entries = neighbours.neighbour.size() * d * d;
  if (entries > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error("the mesh has " + std::to_string(mesh.node.size()) + " nodes, too many for one sparse matrix; take a coarser one");
  const auto size = static_cast<Eigen::Index>(mesh.node.size() * d);
  Eigen::SparseMatrix<double> k(size, size);
  k.resizeNonZeros(static_cast<Eigen::Index>(entries));
  int* const outer = k.outerIndexPtr();
  int* const inner = k.innerIndexPtr();
  double* const value = k.valuePtr();
  std::fill(value, value + entries, 0.0);
  int at = 0;
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    for (std::size_t a = 0; a < d; ++a) {
      outer[n * d + a] = at;
      for (std::size_t m = neighbours.begin[n]; m < neighbours.begin[n + 1]; ++m)
        for (std::size_t b = 0; b < d; ++b) inner[at++] = neighbours.neighbour[m] * static_cast<int>(d) + static_cast<int>(b);
    }
  outer[size] = at;

  const auto corners = static_cast<std::size_t>(mesh.nodes_per_element());
  element::Stiffness k_e;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    const auto& c = elasticity[static_cast<std::size_t>(zone[e])];
    if (element::stiffness(mesh.type, tissue.integration, mesh.corners(e), c, tissue.thickness_m, k_e) != element::Status::Ok) {
      const Point x = mesh.centroid(e);
      throw Error("element " + std::to_string(e) + " around (" + std::to_string(x[0]) + ", " + std::to_string(x[1]) + ", " +
                  std::to_string(x[2]) +
                  ") m is inverted or has no volume; order its nodes positively and keep its angles below 180 degrees");
    }
    for (std::size_t p = 0; p < corners; ++p) {
      const auto n = static_cast<std::size_t>(mesh.element[e][p]);
      const auto begin = neighbours.neighbour.begin() + static_cast<std::ptrdiff_t>(neighbours.begin[n]);
      const auto end = neighbours.neighbour.begin() + static_cast<std::ptrdiff_t>(neighbours.begin[n + 1]);
      for (std::size_t q = 0; q < corners; ++q) {
        const auto place = static_cast<std::size_t>(std::lower_bound(begin, end, mesh.element[e][q]) - begin) * d;
        for (std::size_t a = 0; a < d; ++a)
          for (std::size_t b = 0; b < d; ++b)
            value[static_cast<std::size_t>(outer[n * d + a]) + place + b] +=
                k_e(static_cast<Eigen::Index>(q * d + b), static_cast<Eigen::Index>(p * d + a));
      }
    }
  }
  return k;
}

}  // namespace trocar::fem
