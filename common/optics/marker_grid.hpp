// The markers painted on a phantom: a regular grid.
// Phantom frame: origin at marker (row 0, column 0), x along the columns, y along the rows, z out of the marked surface, towards the
// camera. In an image of a camera that looks down on it, column 0 is on the left and row 0 at the bottom, unless the user's corners say
// otherwise.
#pragma once

#include <cstddef>

#include "common/optics/plane.hpp"

namespace trocar::optics {

struct MarkerGrid {  // the thesis's phantom (3.2); the diameter is ours, from its figure 3.9
  int rows{21}, columns{21};
  double spacing_m{0.005};
  double diameter_m{0.0018};
  [[nodiscard]] std::size_t markers() const noexcept { return static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns); }
  // Row by row, columns first.
  [[nodiscard]] std::size_t index(int row, int column) const noexcept {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }
  [[nodiscard]] PlanePoint at_rest(int row, int column) const noexcept { return {column * spacing_m, row * spacing_m}; }
};

}  // namespace trocar::optics
