// Vectors of the plane, for the sources of this folder.
#pragma once

#include <cmath>

#include "common/needle/beam.hpp"

namespace trocar::needle {

inline double dot(const Vector2& a, const Vector2& b) noexcept { return a[0] * b[0] + a[1] * b[1]; }
inline Vector2 normal(const Vector2& t) noexcept { return {-t[1], t[0]}; }
inline Vector2 direction(double theta_rad) noexcept { return {std::cos(theta_rad), std::sin(theta_rad)}; }

}  // namespace trocar::needle
