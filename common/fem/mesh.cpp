#include "common/fem/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/fem/gmsh.hpp"

namespace trocar::fem {
namespace {

constexpr std::array<const char*, 3> axis_name{"x", "y", "z"};

std::string text(const Point& x, int dimension) {
  std::string out = "(" + std::to_string(x[0]) + ", " + std::to_string(x[1]);
  return (dimension == 3 ? out + ", " + std::to_string(x[2]) : out) + ") m";
}

bool contains(const Box& box, const Point& x, double slack) {
  for (std::size_t a = 0; a < 3; ++a)
    if (!(x[a] >= box.min_m[a] - slack && x[a] <= box.max_m[a] + slack)) return false;
  return true;
}

// Coordinates that were computed differ in their last bits.
double slack_of(const Box& bounds) {
  double size = 0.0;
  for (std::size_t a = 0; a < 3; ++a) size = std::max(size, bounds.max_m[a] - bounds.min_m[a]);
  return 1e-9 * size;
}

Box box_of(Side side, const Box& bounds, int dimension) {
  const auto axis = static_cast<std::size_t>(side) / 2;
  if (axis == 2 && dimension == 2) throw Error("z_min and z_max: a planar mesh has no such side; use x_min, x_max, y_min or y_max");
  const bool upper = static_cast<std::size_t>(side) % 2 == 1;
  Box box;
  (upper ? box.min_m : box.max_m)[axis] = (upper ? bounds.max_m : bounds.min_m)[axis];
  return box;
}

template <class Names>
std::string listed(const Names& names, const char* none) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "\"" : ", \"") + name + "\"";
  return out.empty() ? none : out;
}

// The brick's corners are numbered as Hex8; each path along x, y and z from corner 0 to corner 6 gives one tetrahedron.
constexpr std::array<std::array<std::size_t, 4>, 6> tetrahedra{
    {{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}}};

}  // namespace

element::Corners Mesh::corners(std::size_t index) const {
  element::Corners corner = element::Corners::Zero();
  for (int k = 0; k < nodes_per_element(); ++k) {
    const Point& x = node[static_cast<std::size_t>(element[index][static_cast<std::size_t>(k)])];
    corner.col(k) << x[0], x[1], x[2];
  }
  return corner;
}

Point Mesh::centroid(std::size_t index) const {
  const Eigen::Vector3d mean = corners(index).leftCols(nodes_per_element()).rowwise().mean();
  return {mean[0], mean[1], mean[2]};
}

Grid uniform_grid(Type element, const Point& origin_m, const Point& size_m, const std::array<int, 3>& nodes) {
  Grid grid;
  grid.element = element;
  for (std::size_t a = 0; a < static_cast<std::size_t>(element::dimension(element)); ++a) {
    if (!(size_m[a] > 0.0) || !std::isfinite(size_m[a]) || !std::isfinite(origin_m[a]))
      throw Error(std::string("grid: the size along ") + axis_name[a] + " is " + std::to_string(size_m[a]) +
                  " m; it must be positive and finite");
    if (nodes[a] < 2 || nodes[a] > most_nodes)
      throw Error("grid: " + std::to_string(nodes[a]) + " nodes along " + axis_name[a] + "; an element needs at least 2");
    const double step = size_m[a] / (nodes[a] - 1);
    for (int i = 0; i + 1 < nodes[a]; ++i) grid.axis_m[a].push_back(origin_m[a] + i * step);
    grid.axis_m[a].push_back(origin_m[a] + size_m[a]);
  }
  return grid;
}

Mesh structured_grid(const Grid& grid) {
  const auto dimension = static_cast<std::size_t>(element::dimension(grid.element));
  double nodes = 1.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const std::vector<double>& axis = grid.axis_m[a];
    if (a >= dimension) {
      if (!axis.empty()) throw Error("grid: planar elements leave the z axis empty; take tet4 or hex8 for a solid");
      continue;
    }
    if (axis.size() < 2)
      throw Error("grid: " + std::to_string(axis.size()) + " nodes along " + axis_name[a] + "; an element needs at least 2");
    for (std::size_t i = 0; i < axis.size(); ++i)
      if (!std::isfinite(axis[i]) || (i > 0 && !(axis[i] > axis[i - 1])))
        throw Error(std::string("grid: node coordinates along ") + axis_name[a] + " must be finite and increase; entry " +
                    std::to_string(i + 1) + " is " + std::to_string(axis[i]) + " m");
    nodes *= static_cast<double>(axis.size());
  }
  if (nodes > most_nodes) throw Error("grid: " + std::to_string(nodes) + " nodes; at most 5 million fit in memory");

  const int nx = static_cast<int>(grid.axis_m[0].size());
  const int ny = static_cast<int>(grid.axis_m[1].size());
  const int nz = dimension == 3 ? static_cast<int>(grid.axis_m[2].size()) : 1;
  Mesh mesh;
  mesh.type = grid.element;
  mesh.node.reserve(static_cast<std::size_t>(nodes));
  for (int k = 0; k < nz; ++k)
    for (const double y : grid.axis_m[1])
      for (const double x : grid.axis_m[0]) mesh.node.push_back({x, y, dimension == 3 ? grid.axis_m[2][static_cast<std::size_t>(k)] : 0.0});

  const auto add = [&mesh](std::initializer_list<int> corner) {
    std::array<int, 8>& e = mesh.element.emplace_back();
    e.fill(-1);
    std::copy(corner.begin(), corner.end(), e.begin());
  };
  for (int k = 0; k < std::max(nz - 1, 1); ++k)
    for (int j = 0; j + 1 < ny; ++j)
      for (int i = 0; i + 1 < nx; ++i) {
        const int a = (k * ny + j) * nx + i;
        const int up = nx * ny;
        const std::array<int, 8> c{a, a + 1, a + nx + 1, a + nx, a + up, a + up + 1, a + up + nx + 1, a + up + nx};
        switch (grid.element) {
          case Type::Tri3:
            add({c[0], c[1], c[2]});
            add({c[0], c[2], c[3]});
            break;
          case Type::Quad4:
            add({c[0], c[1], c[2], c[3]});
            break;
          case Type::Tet4:
            for (const auto& t : tetrahedra) add({c[t[0]], c[t[1]], c[t[2]], c[t[3]]});
            break;
          case Type::Hex8:
            mesh.element.push_back(c);
            break;
        }
      }
  return mesh;
}

Mesh make_mesh(const Tissue& tissue) { return tissue.grid ? structured_grid(*tissue.grid) : read_gmsh(tissue.mesh_file); }

Box bounding_box(const Mesh& mesh) {
  if (mesh.node.empty()) throw Error("the mesh has no nodes");
  Box box{mesh.node.front(), mesh.node.front()};
  for (const Point& x : mesh.node)
    for (std::size_t a = 0; a < 3; ++a) {
      box.min_m[a] = std::min(box.min_m[a], x[a]);
      box.max_m[a] = std::max(box.max_m[a], x[a]);
    }
  return box;
}

std::vector<int> nodes_at(const Mesh& mesh, const Where& where) {
  if (where.kind == Where::Kind::Group) {
    const auto found = mesh.group.find(where.group);
    if (found != mesh.group.end()) return found->second;
    std::vector<std::string> names;
    for (const auto& [known, nodes] : mesh.group) names.push_back(known);
    throw Error("the mesh has no group \"" + where.group + "\"; it has " +
                listed(names, "no groups, as only a gmsh file with physical groups does"));
  }
  const Box bounds = bounding_box(mesh);
  const Box box = where.kind == Where::Kind::Side ? box_of(where.side, bounds, mesh.dimension()) : where.box;
  std::vector<int> chosen;
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    if (contains(box, mesh.node[n], slack_of(bounds))) chosen.push_back(static_cast<int>(n));
  return chosen;
}

std::vector<int> zones_of(const Mesh& mesh, const std::vector<Zone>& zones) {
  std::vector<int> region_of_zone(zones.size(), -1);
  for (std::size_t z = 0; z < zones.size(); ++z) {
    if (!zones[z].region) continue;
    const auto found = std::find(mesh.region_name.begin(), mesh.region_name.end(), *zones[z].region);
    if (found == mesh.region_name.end())
      throw Error("the mesh has no region \"" + *zones[z].region + "\"; it has " +
                  listed(mesh.region_name, "no regions, as only a gmsh file with physical groups does"));
    region_of_zone[z] = static_cast<int>(found - mesh.region_name.begin());
  }
  std::vector<int> zone(mesh.element.size(), -1);
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    const Point centroid = mesh.centroid(e);
    for (std::size_t z = zones.size(); z-- > 0 && zone[e] < 0;)
      if ((!zones[z].region || mesh.region[e] == region_of_zone[z]) && (!zones[z].box || contains(*zones[z].box, centroid, 0.0)))
        zone[e] = static_cast<int>(z);
    if (zone[e] < 0)
      throw Error("no material at " + text(centroid, mesh.dimension()) + "; give one without box and region before the others");
  }
  return zone;
}

}  // namespace trocar::fem
