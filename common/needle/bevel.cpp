#include "common/needle/bevel.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::needle {

double lateral_per_axial(const Bevel& bevel) noexcept {
  if (bevel.angle_rad == 0.0) return 0.0;
  const double beta = std::abs(bevel.angle_rad);
  const double lateral = std::cos(beta) - bevel.friction * std::sin(beta);
  const double axial = std::sin(beta) + bevel.friction * std::cos(beta);
  return std::copysign(std::max(lateral, 0.0) / axial, bevel.angle_rad);
}

}  // namespace trocar::needle
