// Markers in the phantom's frame.
#pragma once

#include <array>
#include <optional>

#include "common/optics/plane.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {

struct MetricMarker {
  double x_m{}, y_m{};                 // NaN when the marker is not valid, or its ray misses the plane
  std::array<double, 3> covariance{};  // xx, xy, yy; m^2: C = J^-1 C_px J^-T, J = d(u, v) / d(x, y)
};
[[nodiscard]] MetricMarker to_plane(const optics::PlaneView& view, const Marker& marker);

}  // namespace trocar::tracking
