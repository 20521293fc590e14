#include "sim_plant/phantom/plane_grid.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::sim_plant {

PlaneGrid plane_grid(const fem::Tissue& tissue) {
  if (!tissue.grid || element::dimension(tissue.grid->element) != 2)
    throw fem::Error("tissue: the simulated phantom is planar; give grid = { size_m, origin_m, nodes, element } with tri3 or quad4");
  PlaneGrid grid;
  grid.quads = tissue.grid->element == fem::Type::Quad4;
  for (std::size_t a = 0; a < 2; ++a) {
    const std::vector<double>& axis = tissue.grid->axis_m[a];
    if (axis.size() < 2) throw fem::Error("tissue: the grid needs at least 2 nodes along each axis");
    grid.origin_m[a] = axis.front();
    grid.size_m[a] = axis.back() - axis.front();
    grid.nodes[a] = static_cast<int>(axis.size());
    const double step = grid.size_m[a] / (grid.nodes[a] - 1);
    for (std::size_t i = 1; i < axis.size(); ++i)
      if (std::abs(axis[i] - axis[i - 1] - step) > 1e-6 * step)
        throw fem::Error("tissue: the simulated phantom takes uniform grids alone; remove spacing");
  }
  return grid;
}

bool inside(const PlaneGrid& grid, const Point& x_m) noexcept {
  return x_m[0] >= grid.origin_m[0] && x_m[0] <= grid.origin_m[0] + grid.size_m[0] && x_m[1] >= grid.origin_m[1] &&
         x_m[1] <= grid.origin_m[1] + grid.size_m[1];
}

Embedding locate(const PlaneGrid& grid, const Point& x_m) noexcept {
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
  if (grid.quads)
    return {index,
            4,
            {a, b, c, d},
            {(1 - xi) * (1 - eta), xi * (1 - eta), xi * eta, (1 - xi) * eta},
            {{{-gx * (1 - eta), -gy * (1 - xi)}, {gx * (1 - eta), -gy * xi}, {gx * eta, gy * xi}, {-gx * eta, gy * (1 - xi)}}}};
  if (xi >= eta) return {2 * index, 3, {a, b, c, a}, {1 - xi, xi - eta, eta, 0.0}, {{{-gx, 0.0}, {gx, -gy}, {0.0, gy}, {0.0, 0.0}}}};
  return {2 * index + 1, 3, {a, c, d, a}, {1 - eta, xi, eta - xi, 0.0}, {{{0.0, -gy}, {gx, 0.0}, {-gx, gy}, {0.0, 0.0}}}};
}

}  // namespace trocar::sim_plant
