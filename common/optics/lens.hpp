// Pinhole camera with radial and tangential distortion (Brown; the five-term model of OpenCV, with its order of terms), and its inverse.
//   x  = X/Z, y = Y/Z                                          ray through the pinhole; camera frame: x right, y down, z into the scene
//   xd = x (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 x y + p2 (s + 2 x^2)      s = x^2 + y^2
//   yd = y (1 + k1 s + k2 s^2 + k3 s^3) + p1 (s + 2 y^2) + 2 p2 x y
//   u  = fx xd + cx,  v = fy yd + cy                            pixel; the first pixel's centre is (0, 0), v downwards
// A rectified pixel is where a camera with the same fx, fy, cx, cy and no distortion would see the point.
//
// Where it can be inverted: (xd, yd) is the gradient of a potential, so its Jacobian J is symmetric; wherever J is positive definite on a
// disc about the axis, no two rays of that disc fall on one pixel. With g = 1 + 3 k1 s + 5 k2 s^2 + 7 k3 s^3 (radial) and
// f = 1 + k1 s + k2 s^2 + k3 s^3 (across) and P = hypot(p1, p2), J is positive definite while min(f, g) > 6 P r. The first r at which that
// fails is the invertible radius: behind it the image folds back over itself, and a pixel no longer says which ray it saw.
#pragma once

#include <array>

namespace trocar::optics {

struct Pixel {
  double u_px{}, v_px{};
};

struct Ray {
  double x{}, y{};  // at z = 1
};

struct Lens {
  double fx_px{}, fy_px{}, cx_px{}, cy_px{};
  std::array<double, 5> distortion{};  // k1, k2, p1, p2, k3
};

[[nodiscard]] Ray distort(const Lens& lens, const Ray& ray) noexcept;                            // xd, yd; the polynomial, wherever asked
[[nodiscard]] std::array<double, 3> distortion_jacobian(const Lens& lens, const Ray&) noexcept;  // dxd/dx, dxd/dy = dyd/dx, dyd/dy
[[nodiscard]] Pixel to_pixel(const Lens& lens, const Ray& distorted) noexcept;
[[nodiscard]] Ray to_ray(const Lens& lens, const Pixel& pixel) noexcept;

enum class Status {
  Ok,
  BeyondFold,    // no ray within the invertible radius has this image, or it lies so close to the fold that the pixel does not determine it
  NotConverged,  // out of iterations; Newton's method takes whatever the fixed point does not
  NotFinite,     // the point asked for
};
[[nodiscard]] const char* to_string(Status status) noexcept;

struct Mapped {
  Pixel pixel{};  // meaningful when Ok, else NaN
  Status status{Status::NotFinite};
  int iterations{};
};

// The lens with its invertible radius. A lens has fx, fy > 0 and finite numbers.
class Rectifier {
 public:
  static constexpr double widest = 10.0;  // rays further off the axis than this (84 degrees) are not considered
  static constexpr double tolerance_px = 1e-8;
  static constexpr int most_fixed_point = 200;
  static constexpr int most_newton = 50;

  explicit Rectifier(const Lens& lens) noexcept;
  [[nodiscard]] const Lens& lens() const noexcept { return lens_; }
  [[nodiscard]] double invertible_radius() const noexcept { return radius_; }  // of rays; `widest` when nothing folds

  // Where the camera sees what a rectified pixel shows. Exact, no iterations.
  [[nodiscard]] Mapped distort(const Pixel& rectified) const noexcept;
  // Its inverse. Ok: the rectified pixel is within `tolerance` of the true one, by residual / smallest eigenvalue of J.
  //   fixed point: x <- (xd - tangential(x)) / radial(x), from xd. Contracts for lenses of moderate distortion (thesis B).
  //   Newton: J step = -residual from the axis, shortened until the residual falls, within the invertible radius.
  [[nodiscard]] Mapped fixed_point(const Pixel& seen, double tolerance = tolerance_px) const noexcept;
  [[nodiscard]] Mapped newton(const Pixel& seen, double tolerance = tolerance_px) const noexcept;

 private:
  [[nodiscard]] bool within(const Ray& ray) const noexcept;
  [[nodiscard]] double error_px(const Ray& ray, const Ray& residual) const noexcept;  // of the rectified pixel, to first order

  Lens lens_{};
  double radius_{};
};

}  // namespace trocar::optics
