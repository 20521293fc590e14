#include "common/fem/mesh.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace trocar::fem {

Mesh structured_grid(const Grid& grid) {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const std::string name = axis == 0 ? "x" : "y";
    if (!(grid.size_m[axis] > 0.0) || !std::isfinite(grid.size_m[axis]) || !std::isfinite(grid.origin_m[axis]))
      throw Error("grid: the size along " + name + " is " + std::to_string(grid.size_m[axis]) + " m; it must be positive and finite");
    if (grid.nodes[axis] < 2)
      throw Error("grid: " + std::to_string(grid.nodes[axis]) + " nodes along " + name + "; an element needs at least 2");
  }
  const int columns = grid.nodes[0];
  const int rows = grid.nodes[1];
  const double dx = grid.size_m[0] / (columns - 1);
  const double dy = grid.size_m[1] / (rows - 1);

  Mesh mesh;
  mesh.type = grid.element;
  for (int j = 0; j < rows; ++j)
    for (int i = 0; i < columns; ++i) mesh.node.push_back({grid.origin_m[0] + i * dx, grid.origin_m[1] + j * dy});
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i + 1 < columns; ++i) {
      const int a = j * columns + i;
      const std::array<int, 4> corner{a, a + 1, a + columns + 1, a + columns};
      if (grid.element == Element::Quad4) {
        mesh.element.push_back(corner);
      } else {
        mesh.element.push_back({corner[0], corner[1], corner[2], -1});
        mesh.element.push_back({corner[0], corner[2], corner[3], -1});
      }
    }
  }
  return mesh;
}

bool inside(const Grid& grid, const Point& x_m) noexcept {
  return x_m[0] >= grid.origin_m[0] && x_m[0] <= grid.origin_m[0] + grid.size_m[0] && x_m[1] >= grid.origin_m[1] &&
         x_m[1] <= grid.origin_m[1] + grid.size_m[1];
}

Embedding locate(const Grid& grid, const Point& x_m) noexcept {
  std::array<int, 2> cell{};
  std::array<double, 2> local{};    // 0 … 1 inside the cell
  std::array<double, 2> inverse{};  // 1 / cell size
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const int cells = grid.nodes[axis] - 1;
    inverse[axis] = cells / grid.size_m[axis];
    const double position = (x_m[axis] - grid.origin_m[axis]) * inverse[axis];
    cell[axis] = static_cast<int>(std::clamp(std::floor(position), 0.0, static_cast<double>(cells - 1)));
    local[axis] = position - cell[axis];
  }
  const int a = cell[1] * grid.nodes[0] + cell[0];
  const int index = cell[1] * (grid.nodes[0] - 1) + cell[0];
  const double xi = local[0];
  const double eta = local[1];
  const double gx = inverse[0];
  const double gy = inverse[1];
  const int b = a + 1;
  const int c = a + grid.nodes[0] + 1;
  const int d = a + grid.nodes[0];
  if (grid.element == Element::Quad4)
    return {index,
            4,
            {a, b, c, d},
            {(1 - xi) * (1 - eta), xi * (1 - eta), xi * eta, (1 - xi) * eta},
            {{{-gx * (1 - eta), -gy * (1 - xi)}, {gx * (1 - eta), -gy * xi}, {gx * eta, gy * xi}, {-gx * eta, gy * (1 - xi)}}}};
  if (xi >= eta) return {2 * index, 3, {a, b, c, a}, {1 - xi, xi - eta, eta, 0.0}, {{{-gx, 0.0}, {gx, -gy}, {0.0, gy}, {0.0, 0.0}}}};
  return {2 * index + 1, 3, {a, c, d, a}, {1 - eta, xi, eta - xi, 0.0}, {{{0.0, -gy}, {gx, 0.0}, {-gx, gy}, {0.0, 0.0}}}};
}

}  // namespace trocar::fem
