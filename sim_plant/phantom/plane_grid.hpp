// A uniform planar grid and where a point lies in it, in constant time: the phantom asks this in every step.
#pragma once

#include <array>

#include "common/fem/tissue.hpp"

namespace trocar::sim_plant {

using Point = std::array<double, 2>;  // x_m, y_m

struct PlaneGrid {
  bool quads{};  // else triangles, diagonals from lower left to upper right
  Point origin_m{};
  Point size_m{};
  std::array<int, 2> nodes{};  // node (i, j) has the index j * nodes[0] + i, as in fem::structured_grid
};

// A point tied to the nodes of the element around it: u(x) = sum_k weight[k] u[node[k]]; the weights sum to one.
struct Embedding {
  int element{};
  int count{};  // 3 or 4
  std::array<int, 4> node{};
  std::array<double, 4> weight{};
  std::array<Point, 4> gradient{};  // d weight / d(x, y), 1/m
};

// Throws fem::Error unless the tissue is a planar grid of equal steps.
[[nodiscard]] PlaneGrid plane_grid(const fem::Tissue& tissue);

[[nodiscard]] bool inside(const PlaneGrid& grid, const Point& x_m) noexcept;  // edges count as inside

// Outside of the grid the nearest element's shape functions are continued. Constant time, no allocation.
[[nodiscard]] Embedding locate(const PlaneGrid& grid, const Point& x_m) noexcept;

}  // namespace trocar::sim_plant
