// Nodes and elements of a planar mesh, and where a point lies in a structured grid.
#pragma once

#include <array>
#include <vector>

#include "common/fem/tissue.hpp"

namespace trocar::fem {

using Point = std::array<double, 2>;  // x_m, y_m

struct Mesh {
  Element type{};
  std::vector<Point> node{};
  std::vector<std::array<int, 4>> element{};  // counter-clockwise; Tri3 uses the first three, the fourth is -1

  [[nodiscard]] int nodes_per_element() const { return type == Element::Quad4 ? 4 : 3; }
};

// A point tied to the nodes of the element around it: u(x) = sum_k weight[k] u[node[k]]; the weights sum to one.
struct Embedding {
  int element{};
  int count{};  // 3 or 4
  std::array<int, 4> node{};
  std::array<double, 4> weight{};
  std::array<Point, 4> gradient{};  // d weight / d(x, y), 1/m
};

// Throws Error for sizes and node counts that make no grid. Node (i, j) has the index j * nodes[0] + i.
[[nodiscard]] Mesh structured_grid(const Grid& grid);

[[nodiscard]] bool inside(const Grid& grid, const Point& x_m) noexcept;  // edges count as inside

// Outside of the grid the nearest element's shape functions are continued. Constant time, no allocation.
[[nodiscard]] Embedding locate(const Grid& grid, const Point& x_m) noexcept;

}  // namespace trocar::fem
