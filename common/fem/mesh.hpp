// Nodes and elements, where a point lies among them, and what a scene's words choose of them.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/fem/tissue.hpp"

namespace trocar::fem {

inline constexpr int most_nodes = 5'000'000;  // 15 million unknowns: their factor alone would fill 100 GB

struct Mesh {
  Type type{};
  std::vector<Point> node{};
  std::vector<std::array<int, 8>> element{};  // node indices in the order of element.hpp, the rest -1
  std::vector<int> region{};                  // of each element: index into region_name, or -1; empty when there are no regions
  std::vector<std::string> region_name{};
  std::map<std::string, std::vector<int>, std::less<>> group{};  // named node sets, each increasing

  [[nodiscard]] int dimension() const { return element::dimension(type); }
  [[nodiscard]] int nodes_per_element() const { return element::node_count(type); }
  [[nodiscard]] element::Corners corners(std::size_t index) const;
  [[nodiscard]] Point centroid(std::size_t index) const;
};

// A point tied to the nodes of the element around it: u(x) = sum_k weight[k] u[node[k]]; the weights sum to one.
struct Embedding {
  int element{-1};
  int count{};
  std::array<int, 8> node{};
  std::array<double, 8> weight{};
};

// Equal steps along each axis of the element's dimension. Throws Error for a size or a count that makes no grid.
[[nodiscard]] Grid uniform_grid(Type element, const Point& origin_m, const Point& size_m, const std::array<int, 3>& nodes);

// Node (i, j, k) has the index (k * ny + j) * nx + i; elements run in the same order. Throws Error for axes that make no grid.
[[nodiscard]] Mesh structured_grid(const Grid& grid);

// The grid or the gmsh file of a tissue. Throws Error.
[[nodiscard]] Mesh make_mesh(const Tissue& tissue);

[[nodiscard]] Box bounding_box(const Mesh& mesh);

// Increasing node indices; a node on a side or a box's face up to 1e-9 of the mesh's size counts. May be empty for a side of the third
// axis of a planar mesh and for a box; throws Error for a group that the mesh does not have, naming those that it has.
[[nodiscard]] std::vector<int> nodes_at(const Mesh& mesh, const Where& where);

// Index of the zone that holds for each element. Throws Error for an element without one and for a region that the mesh does not have.
[[nodiscard]] std::vector<int> zones_of(const Mesh& mesh, const std::vector<Zone>& zones);

// Finds elements and nodes by place, through uniform buckets over the bounding box. The mesh must outlive it.
class Locator {
 public:
  explicit Locator(const Mesh& mesh);
  // Empty when no element holds the point; points up to tolerance_m outside belong to the nearest element that they touch.
  // Of several elements the first in the mesh's order answers, so the answer does not depend on rounding of the buckets.
  [[nodiscard]] std::optional<Embedding> locate(const Point& x_m, double tolerance_m = 1e-9) const;
  [[nodiscard]] int nearest_node(const Point& x_m) const;

 private:
  [[nodiscard]] std::array<int, 3> bucket_of(const Point& x_m) const;
  [[nodiscard]] std::size_t index_of(const std::array<int, 3>& bucket) const;

  const Mesh* mesh_;
  Box bounds_{};
  std::array<int, 3> count_{1, 1, 1};
  Point bucket_size_m_{};
  std::vector<int> element_begin_{}, element_{};  // elements whose bounding box overlaps bucket b: element_[element_begin_[b]] …
  std::vector<int> node_begin_{}, node_{};
};

}  // namespace trocar::fem
