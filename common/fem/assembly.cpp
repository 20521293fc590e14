#include "common/fem/assembly.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "common/fem/statics.hpp"

namespace trocar::fem {
namespace {

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

Assembly::Assembly(const Mesh& mesh) : mesh_(&mesh) {
  if (mesh.node.empty() || mesh.element.empty()) throw Error("the mesh has no elements");
  const auto corners = static_cast<std::size_t>(mesh.nodes_per_element());
  std::vector<std::size_t> begin(mesh.node.size() + 1, 0);
  for (const auto& e : mesh.element)
    for (std::size_t k = 0; k < corners; ++k) ++begin[static_cast<std::size_t>(e[k]) + 1];
  for (std::size_t n = 0; n < mesh.node.size(); ++n) begin[n + 1] += begin[n];
  std::vector<std::size_t> fill(begin.begin(), begin.end() - 1);
  std::vector<int> around(begin.back());
  for (std::size_t e = 0; e < mesh.element.size(); ++e)
    for (std::size_t k = 0; k < corners; ++k) around[fill[static_cast<std::size_t>(mesh.element[e][k])]++] = static_cast<int>(e);

  begin_.push_back(0);
  std::vector<int> found;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    found.clear();
    for (std::size_t at = begin[n]; at < begin[n + 1]; ++at) {
      const auto& e = mesh.element[static_cast<std::size_t>(around[at])];
      found.insert(found.end(), e.begin(), e.begin() + static_cast<std::ptrdiff_t>(corners));
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    neighbour_.insert(neighbour_.end(), found.begin(), found.end());
    begin_.push_back(neighbour_.size());
  }

  // Column by column: d x d blocks for each pair of neighbours.
  const auto d = static_cast<std::size_t>(mesh.dimension());
  const std::size_t entries = neighbour_.size() * d * d;
  if (entries > static_cast<std::size_t>(std::numeric_limits<int>::max()))
    throw Error("the mesh has " + std::to_string(mesh.node.size()) + " nodes, too many for one sparse matrix; take a coarser one");
  const auto size = static_cast<Eigen::Index>(mesh.node.size() * d);
  matrix_.resize(size, size);
  matrix_.resizeNonZeros(static_cast<Eigen::Index>(entries));
  int* const outer = matrix_.outerIndexPtr();
  int* const inner = matrix_.innerIndexPtr();
  int at = 0;
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    for (std::size_t a = 0; a < d; ++a) {
      outer[n * d + a] = at;
      for (std::size_t m = begin_[n]; m < begin_[n + 1]; ++m)
        for (std::size_t b = 0; b < d; ++b) inner[at++] = neighbour_[m] * static_cast<int>(d) + static_cast<int>(b);
    }
  outer[size] = at;
  clear();
}

void Assembly::clear() { std::fill_n(matrix_.valuePtr(), matrix_.nonZeros(), 0.0); }

void Assembly::add(std::size_t element, const element::Stiffness& k_e) {
  const auto d = static_cast<std::size_t>(mesh_->dimension());
  const auto corners = static_cast<std::size_t>(mesh_->nodes_per_element());
  const auto& nodes = mesh_->element[element];
  const int* const outer = matrix_.outerIndexPtr();
  double* const value = matrix_.valuePtr();
  for (std::size_t p = 0; p < corners; ++p) {
    const auto n = static_cast<std::size_t>(nodes[p]);
    const auto begin = neighbour_.begin() + static_cast<std::ptrdiff_t>(begin_[n]);
    const auto end = neighbour_.begin() + static_cast<std::ptrdiff_t>(begin_[n + 1]);
    for (std::size_t q = 0; q < corners; ++q) {
      const auto place = static_cast<std::size_t>(std::lower_bound(begin, end, nodes[q]) - begin) * d;
      for (std::size_t a = 0; a < d; ++a)
        for (std::size_t b = 0; b < d; ++b)
          value[static_cast<std::size_t>(outer[n * d + a]) + place + b] +=
              k_e(static_cast<Eigen::Index>(q * d + b), static_cast<Eigen::Index>(p * d + a));
    }
  }
}

Equations::Equations(const std::vector<bool>& supported) : row(supported.size(), -1) {
  for (std::size_t i = 0; i < supported.size(); ++i) {
    if (supported[i]) continue;
    row[i] = static_cast<int>(unknown.size());
    unknown.push_back(static_cast<int>(i));
  }
}

Eigen::SparseMatrix<double> Equations::reduce(const Eigen::SparseMatrix<double>& matrix) const {
  Eigen::SparseMatrix<double> reduced(count(), count());
  reduced.reserve(matrix.nonZeros() / 2 + count());
  for (Eigen::Index j = 0; j < count(); ++j) {
    reduced.startVec(j);
    for (Eigen::SparseMatrix<double>::InnerIterator it(matrix, unknown[static_cast<std::size_t>(j)]); it; ++it)
      if (const int i = row[static_cast<std::size_t>(it.row())]; i >= j) reduced.insertBack(i, j) = it.value();
  }
  reduced.finalize();
  return reduced;
}

std::string inverted_element(const Mesh& mesh, std::size_t element) {
  const Point x = mesh.centroid(element);
  return "element " + std::to_string(element) + " around (" + std::to_string(x[0]) + ", " + std::to_string(x[1]) + ", " +
         std::to_string(x[2]) + ") m is inverted or has no volume; order its nodes positively and keep its angles below 180 degrees";
}

std::string node_in_words(const Mesh& mesh, Eigen::Index degree_of_freedom) {
  const auto node = static_cast<std::size_t>(degree_of_freedom / mesh.dimension());
  const Point& x = mesh.node[node];
  return "node " + std::to_string(node) + " at (" + std::to_string(x[0]) + ", " + std::to_string(x[1]) +
         (mesh.dimension() == 3 ? ", " + std::to_string(x[2]) : "") + ") m";
}

Eigen::SparseMatrix<double> assemble_stiffness(const Mesh& mesh, const Tissue& tissue) {
  Assembly assembly(mesh);
  const std::vector<element::Elasticity> elasticity = elasticities(mesh, tissue);
  const std::vector<int> zone = zones_of(mesh, tissue.zones);
  element::Stiffness k_e;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    const auto& c = elasticity[static_cast<std::size_t>(zone[e])];
    if (element::stiffness(mesh.type, tissue.integration, mesh.corners(e), c, tissue.thickness_m, k_e) != element::Status::Ok)
      throw Error(inverted_element(mesh, e));
    assembly.add(e, k_e);
  }
  return assembly.matrix();
}

}  // namespace trocar::fem
