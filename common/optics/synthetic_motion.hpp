// Motions of a phantom's markers in closed form, for synthetic images: no tissue, but as smooth and as large as a tissue's.
//   Shear      both displacements D sin(w t) times a product of half sines over the grid, with different numbers of waves; w = v / D
//   Insertion  a needle enters at the middle of the first row along +y at v: points near its line are dragged with it,
//              D exp(-(x - x0)^2 / (2 b^2)) s(d / D) s((y_tip - y) / b), s(z) = z / (1 + z) for z > 0, d the depth, b = 0.012 m; it stops
//              at 90 % of the grid and goes back
// D is the greatest displacement, v the greatest speed.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "common/optics/render.hpp"

namespace trocar::optics {

enum class MotionKind { Still, Shear, Insertion };

struct SyntheticMotion {
  MotionKind kind{MotionKind::Still};
  double displacement_m{0.005};
  double speed_m_s{0.009};

  [[nodiscard]] double depth_m(const MarkerGrid& grid, double t_s) const noexcept {
    const double most = 0.9 * (grid.rows - 1) * grid.spacing_m;
    const double way = std::fmod(speed_m_s * t_s, 2.0 * most);
    return way < most ? way : 2.0 * most - way;
  }
  [[nodiscard]] PlanePoint at(const MarkerGrid& grid, int row, int column, double t_s) const noexcept {
    PlanePoint p = grid.at_rest(row, column);
    const double width = (grid.columns - 1) * grid.spacing_m, height = (grid.rows - 1) * grid.spacing_m;
    if (kind == MotionKind::Shear) {
      const double s = std::sin(speed_m_s / displacement_m * t_s), x = p.x_m / width, y = p.y_m / height, pi = std::numbers::pi;
      p.x_m += displacement_m * s * 0.8 * std::sin(pi * y) * std::cos(0.5 * pi * (x - 0.5));
      p.y_m += displacement_m * s * 0.6 * std::sin(pi * x) * std::cos(pi * (y - 0.5));
    } else if (kind == MotionKind::Insertion) {
      constexpr double b = 0.012;
      const auto rise = [](double z) { return z > 0.0 ? z / (1.0 + z) : 0.0; };
      const double depth = depth_m(grid, t_s), dx = p.x_m - 0.5 * width;
      p.y_m += displacement_m * std::exp(-0.5 * dx * dx / (b * b)) * rise(depth / displacement_m) * rise((depth - p.y_m + b) / b);
    }
    return p;
  }
  [[nodiscard]] std::vector<MarkerState> markers(const MarkerGrid& grid, double t_s) const {
    constexpr double h = 1e-5;
    std::vector<MarkerState> out;
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        const PlanePoint before = at(grid, row, column, t_s - h), after = at(grid, row, column, t_s + h);
        out.push_back({at(grid, row, column, t_s), (after.x_m - before.x_m) / (2 * h), (after.y_m - before.y_m) / (2 * h)});
      }
    }
    return out;
  }
  // From outside of the grid to the tip; nothing while there is none.
  [[nodiscard]] std::vector<PlanePoint> needle(const MarkerGrid& grid, double t_s) const {
    if (kind != MotionKind::Insertion) return {};
    const double x = 0.5 * (grid.columns - 1) * grid.spacing_m;
    return {{x, -4.0 * grid.spacing_m}, {x, depth_m(grid, t_s)}};
  }
};

}  // namespace trocar::optics
