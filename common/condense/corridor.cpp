#include "common/condense/corridor.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::condense {
namespace {

using model::Vector2;

double cross(const Vector2& a, const Vector2& b, const Vector2& c) { return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]); }

double to_segment(const Vector2& x, const Vector2& a, const Vector2& b) {
  const Vector2 along{b[0] - a[0], b[1] - a[1]};
  const double square = along[0] * along[0] + along[1] * along[1];
  const double place = square > 0.0 ? std::clamp(((x[0] - a[0]) * along[0] + (x[1] - a[1]) * along[1]) / square, 0.0, 1.0) : 0.0;
  return std::hypot(x[0] - a[0] - place * along[0], x[1] - a[1] - place * along[1]);
}

bool cross_each_other(const Vector2& a, const Vector2& b, const Vector2& c, const Vector2& d) {
  return (cross(a, b, c) > 0.0) != (cross(a, b, d) > 0.0) && (cross(c, d, a) > 0.0) != (cross(c, d, b) > 0.0);
}

}  // namespace

double distance_m(const scene::Corridor& line, std::span<const Vector2> polygon) {
  const Vector2& from = line.from_m;
  const Vector2& to = line.to_m;
  bool inside = true;
  double least = 0.0;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Vector2& a = polygon[k];
    const Vector2& b = polygon[(k + 1) % polygon.size()];
    if (cross_each_other(from, to, a, b)) return 0.0;
    inside = inside && cross(a, b, from) >= 0.0;
    const double here = std::min({to_segment(a, from, to), to_segment(from, a, b), to_segment(to, a, b)});
    least = k == 0 ? here : std::min(least, here);
  }
  return inside ? 0.0 : least;
}

}  // namespace trocar::condense
