// Vectors and compliances in the needle's plane, in the axes of the mesh. What this folder's files share; nobody else needs it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace trocar::contact {

using Vector2 = std::array<double, 2>;
using Block = std::array<double, 4>;  // xx, xy, yx, yy

[[nodiscard]] inline Vector2 plus(const Vector2& a, const Vector2& b) noexcept { return {a[0] + b[0], a[1] + b[1]}; }
[[nodiscard]] inline Vector2 minus(const Vector2& a, const Vector2& b) noexcept { return {a[0] - b[0], a[1] - b[1]}; }
[[nodiscard]] inline Vector2 scaled(const Vector2& a, double factor) noexcept { return {a[0] * factor, a[1] * factor}; }
[[nodiscard]] inline double dot(const Vector2& a, const Vector2& b) noexcept { return a[0] * b[0] + a[1] * b[1]; }
[[nodiscard]] inline double length(const Vector2& a) noexcept { return std::hypot(a[0], a[1]); }
[[nodiscard]] inline Vector2 normal(const Vector2& tangent) noexcept { return {-tangent[1], tangent[0]}; }

inline void add(Block& to, const Block& what, double factor = 1.0) noexcept {
  for (std::size_t k = 0; k < 4; ++k) to[k] += factor * what[k];
}
// Of a compliance along a unit vector and one across it.
[[nodiscard]] inline Block in_axes(const Vector2& t, double along, double across) noexcept {
  const double shear = (along - across) * t[0] * t[1];
  return {along * t[0] * t[0] + across * t[1] * t[1], shear, shear, along * t[1] * t[1] + across * t[0] * t[0]};
}

}  // namespace trocar::contact
