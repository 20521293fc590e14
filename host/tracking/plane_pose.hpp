// Where the marked plane stands before the camera, from the markers of one frame and the grid that they were painted on.
#pragma once

#include <optional>
#include <span>

#include "common/optics/marker_grid.hpp"
#include "common/optics/plane.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {

struct PlaneFit {
  optics::Pose pose{};
  double rms_px{};  // of the distances: what the dots stray from the grid, and the lens from its model
};

// Least squares over all valid markers; the start from the homography of the rectified rays (Collins and Bartoli 2014, by OpenCV). Nothing
// with fewer than four, or when they lie on a line.
[[nodiscard]] std::optional<PlaneFit> fit_plane(const optics::Lens& lens, const optics::MarkerGrid& grid, std::span<const Marker> markers);

}  // namespace trocar::tracking
