#include "host/tracking/metric.hpp"

#include <limits>

namespace trocar::tracking {

MetricMarker to_plane(const optics::PlaneView& view, const Marker& marker) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto point = marker.valid ? view.locate({marker.u_px, marker.v_px}) : std::nullopt;
  if (!point) return {nan, nan, {nan, nan, nan}};
  const optics::Jacobian2 j = view.jacobian(*point);
  const double det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
  const double a = j[1][1] / det, b = -j[0][1] / det, c = -j[1][0] / det, d = j[0][0] / det;
  const auto& [uu, uv, vv] = marker.covariance;
  return {point->x_m,
          point->y_m,
          {a * a * uu + 2.0 * a * b * uv + b * b * vv, a * c * uu + (a * d + b * c) * uv + b * d * vv,
           c * c * uu + 2.0 * c * d * uv + d * d * vv}};
}

}  // namespace trocar::tracking
