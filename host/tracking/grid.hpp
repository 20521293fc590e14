// The grid of dots in an image, without being told where.
#pragma once

#include <string>
#include <vector>

#include "common/optics/marker_grid.hpp"
#include "host/tracking/locate.hpp"

namespace trocar::tracking {

struct DetectedGrid {
  std::vector<Place> place{};  // in the grid's order (common/optics/marker_grid.hpp); NaN where no dot was seen
  std::size_t seen{};
  double radius_px{};     // median of the dots'
  std::string problem{};  // why there is no grid; then `place` is empty. Says what was found
};

// Dark blobs against their surroundings; then from dot to dot along the two directions in which neighbours lie, each step from the one
// before, so that lens, perspective and deformation do no harm. Blobs off the grid are left out; dots may be missing. When more than the
// grid was found, the part of its size that holds the most dots is taken, if there is one.
[[nodiscard]] DetectedGrid detect_grid(const optics::Frame& frame, const Gains& gains, const optics::MarkerGrid& grid);

// Least-squares extrapolation of a missing place from those around it: mean of the places that neighbours in a row, column or diagonal
// predict (2 p1 - p2, or the middle of two opposite ones). Goes on until nothing changes; what stays unknown is NaN.
void fill_missing(std::vector<Place>& place, const optics::MarkerGrid& grid);

}  // namespace trocar::tracking
