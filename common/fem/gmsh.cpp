#include "common/fem/gmsh.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>

#include "common/fem/msh_file.hpp"

namespace trocar::fem {
namespace {

std::optional<Type> supported_type(int number) {
  switch (number) {
    case 2:
      return Type::Tri3;
    case 3:
      return Type::Quad4;
    case 4:
      return Type::Tet4;
    case 5:
      return Type::Hex8;
    default:
      return std::nullopt;
  }
}

// The one gmsh type of the highest dimension.
int solid_type(const std::string& name, const MshFile& file) {
  int dimension = 0;
  for (const MshElement& e : file.element) dimension = std::max(dimension, msh_type(e.type).dimension);
  std::set<int> types;
  for (const MshElement& e : file.element)
    if (msh_type(e.type).dimension == dimension) types.insert(e.type);
  if (dimension < 2) throw Error(name + ": has neither triangles, quadrilaterals, tetrahedra nor hexahedra; mesh the surface or volume");
  for (const int type : types)
    if (!supported_type(type))
      throw Error(name + ": has " + msh_type(type).name +
                  ", which are not computed; use linear triangles, quadrilaterals, tetrahedra or hexahedra (element order 1)");
  if (types.size() > 1)
    throw Error(name + ": mixes " + msh_type(*types.begin()).name + " and " + msh_type(*types.rbegin()).name +
                "; use one kind of element throughout");
  return *types.begin();
}

// From negative to positive orientation.
void turn(Type type, std::array<int, 8>& node) {
  switch (type) {
    case Type::Tri3:
    case Type::Tet4:
      std::swap(node[1], node[2]);
      break;
    case Type::Quad4:
      std::swap(node[1], node[3]);
      break;
    case Type::Hex8:
      for (std::size_t k = 0; k < 4; ++k) std::swap(node[k], node[k + 4]);
      break;
  }
}

// Determinant of the map at the element's centre (at any point of a simplex).
double orientation(const Mesh& mesh, std::size_t e) {
  element::Shape value;
  element::ShapeGradient gradient;
  element::shape(mesh.type, Eigen::Vector3d::Zero(), value, gradient);
  const int d = mesh.dimension();
  const int n = mesh.nodes_per_element();
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
  jacobian.topLeftCorner(d, d) = gradient.topLeftCorner(d, n) * mesh.corners(e).topLeftCorner(d, n).transpose();
  return jacobian.determinant();
}

void flatten(const std::string& name, Mesh& mesh) {
  const Box bounds = bounding_box(mesh);
  const double size = std::max(bounds.max_m[0] - bounds.min_m[0], bounds.max_m[1] - bounds.min_m[1]);
  if (bounds.max_m[2] - bounds.min_m[2] > 1e-9 * size)
    throw Error(name + ": its surface is not flat: z reaches from " + std::to_string(bounds.min_m[2]) + " to " +
                std::to_string(bounds.max_m[2]) + " m; a planar mesh lies in a plane of one z, a solid needs tetrahedra or hexahedra");
  for (Point& x : mesh.node) x[2] = 0.0;
}

}  // namespace

Mesh read_gmsh(const std::filesystem::path& path) {
  const MshFile file = read_msh(path);
  const std::string name = path.string();
  const int kept = solid_type(name, file);
  const int dimension = msh_type(kept).dimension;

  std::unordered_map<std::int64_t, std::size_t> position;
  for (std::size_t n = 0; n < file.node_tag.size(); ++n)
    if (!position.emplace(file.node_tag[n], n).second)
      throw Error(name + ": two nodes have the number " + std::to_string(file.node_tag[n]));
  const auto position_of = [&](std::int64_t tag) {
    const auto found = position.find(tag);
    if (found == position.end()) throw Error(name + ": an element names node " + std::to_string(tag) + ", which is not in the file");
    return found->second;
  };

  Mesh mesh;
  mesh.type = *supported_type(kept);
  std::vector<int> index(file.node.size(), -1);  // in the mesh
  for (const MshElement& e : file.element)
    if (e.type == kept)
      for (const std::int64_t tag : e.node) index[position_of(tag)] = 0;
  for (std::size_t n = 0; n < index.size(); ++n) {
    if (index[n] < 0) continue;
    index[n] = static_cast<int>(mesh.node.size());
    mesh.node.push_back(file.node[n]);
  }
  if (dimension == 2) flatten(name, mesh);

  const auto group_name = [&](int of_dimension, int number) {
    const auto found = file.physical_name.find({of_dimension, number});
    return found != file.physical_name.end() && !found->second.empty() ? found->second : std::to_string(number);
  };
  const auto region_of = [&](const MshElement& e) {
    if (e.physical.empty()) return -1;
    const std::string region = group_name(dimension, e.physical.front());
    const auto found = std::find(mesh.region_name.begin(), mesh.region_name.end(), region);
    if (found != mesh.region_name.end()) return static_cast<int>(found - mesh.region_name.begin());
    mesh.region_name.push_back(region);
    return static_cast<int>(mesh.region_name.size() - 1);
  };
  const auto refuse_overlap = [&](int first, int second) {
    throw Error(name + ": an element belongs to the physical groups \"" + group_name(dimension, first) + "\" and \"" +
                group_name(dimension, second) + "\"; regions must not overlap: keep one of them");
  };
  std::map<std::string, std::set<int>> groups;
  std::map<std::array<int, 8>, int> seen;  // format 2.2 writes an element once for each of its groups
  for (const MshElement& e : file.element) {
    std::array<int, 8> node{};
    node.fill(-1);
    for (std::size_t k = 0; k < e.node.size(); ++k) {
      const int n = index[position_of(e.node[k])];
      if (e.type == kept) node[k] = n;
      if (n < 0) continue;
      for (const int number : e.physical) groups[group_name(msh_type(e.type).dimension, number)].insert(n);
    }
    if (e.type != kept) continue;
    if (e.physical.size() > 1) refuse_overlap(e.physical[0], e.physical[1]);
    std::array<int, 8> sorted = node;
    std::sort(sorted.begin(), sorted.end());
    const int number = e.physical.empty() ? 0 : e.physical.front();
    if (const auto [before, fresh] = seen.emplace(sorted, number); !fresh) {
      if (before->second != number) refuse_overlap(before->second, number);
      throw Error(name + ": two elements have the same nodes; remove the double ones");
    }
    mesh.element.push_back(node);
    mesh.region.push_back(region_of(e));
    if (orientation(mesh, mesh.element.size() - 1) < 0.0) turn(mesh.type, mesh.element.back());
  }
  if (mesh.region_name.empty()) mesh.region.clear();
  for (const auto& [group, nodes] : groups) mesh.group[group].assign(nodes.begin(), nodes.end());
  return mesh;
}

}  // namespace trocar::fem
