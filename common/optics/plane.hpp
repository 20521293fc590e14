// A plane before a camera: the marked surface of a phantom, or a calibration board.
//   point (x, y) of the plane  ->  X = R (x, y, 0)^T + t  in the camera's frame  ->  lens.hpp  ->  pixel
// A plane whose z looks at the camera (a phantom seen from above: x right, y up in the image) has R = diag(1, -1, -1) when the camera
// looks straight down on it.
#pragma once

#include <array>
#include <optional>

#include "common/optics/lens.hpp"

namespace trocar::optics {

struct Pose {                            // of the plane in the camera's frame
  std::array<double, 3> rotation_rad{};  // axis times angle: R = exp([rotation]x)
  std::array<double, 3> translation_m{};
};

struct PlanePoint {
  double x_m{}, y_m{};
};

// Rows: d(x_m, y_m) / d(u_px, v_px), or the other way about.
using Jacobian2 = std::array<std::array<double, 2>, 2>;

class PlaneView {
 public:
  // `lens` as Rectifier wants it; finite pose.
  PlaneView(const Lens& lens, const Pose& pose) noexcept;

  [[nodiscard]] const Rectifier& rectifier() const noexcept { return rectifier_; }
  [[nodiscard]] const Pose& pose() const noexcept { return pose_; }

  // Nothing for a point behind the pinhole or beyond the lens's fold.
  [[nodiscard]] std::optional<Pixel> project(const PlanePoint& point) const noexcept;
  // Nothing where the lens cannot be inverted, or the ray misses the plane. Newton's inverse.
  [[nodiscard]] std::optional<PlanePoint> locate(const Pixel& seen) const noexcept;
  // d(u_px, v_px) / d(x_m, y_m) at a point of the plane, exact.
  [[nodiscard]] Jacobian2 jacobian(const PlanePoint& point) const noexcept;

 private:
  Rectifier rectifier_;
  Pose pose_{};
  std::array<std::array<double, 3>, 3> rotation_{};
};

}  // namespace trocar::optics
