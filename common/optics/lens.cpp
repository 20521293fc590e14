#include "common/optics/lens.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trocar::optics {
namespace {

// Both are of s = r^2.
double across(const std::array<double, 5>& d, double s) noexcept { return 1.0 + s * (d[0] + s * (d[1] + s * d[4])); }
double along(const std::array<double, 5>& d, double s) noexcept { return 1.0 + s * (3.0 * d[0] + s * (5.0 * d[1] + s * 7.0 * d[4])); }

Ray tangential(const std::array<double, 5>& d, const Ray& ray) noexcept {
  const double s = ray.x * ray.x + ray.y * ray.y;
  return {2.0 * d[2] * ray.x * ray.y + d[3] * (s + 2.0 * ray.x * ray.x), d[2] * (s + 2.0 * ray.y * ray.y) + 2.0 * d[3] * ray.x * ray.y};
}

double smaller_eigenvalue(const std::array<double, 3>& j) noexcept { return 0.5 * (j[0] + j[2]) - std::hypot(0.5 * (j[0] - j[2]), j[1]); }

// Walks outwards in steps that h(r) = min(f, g) - 6 P r, whose slope is bounded on each, cannot fall to zero within.
double invertible_radius_of(const std::array<double, 5>& d) noexcept {
  constexpr double close = 1e-7;  // to zero
  constexpr int most_steps = 100000;
  const double tangent = 6.0 * std::hypot(d[2], d[3]);
  double r = 0.0;
  for (int k = 0; k < most_steps && r < Rectifier::widest; ++k) {
    const double h = std::min(across(d, r * r), along(d, r * r)) - tangent * r;
    if (!(h > close)) return r;
    const double reach = 2.0 * r + 0.1;
    const double s = reach * reach;
    const double slope = reach * (6.0 * std::abs(d[0]) + s * (20.0 * std::abs(d[1]) + s * 42.0 * std::abs(d[4]))) + tangent;
    r = std::min(r + (slope > 0.0 ? h / slope : reach), reach);
  }
  return std::min(r, Rectifier::widest);
}

bool finite(const Pixel& p) noexcept { return std::isfinite(p.u_px) && std::isfinite(p.v_px); }

Mapped failed(Status status, int iterations = 0) noexcept {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  return {{nan, nan}, status, iterations};
}

}  // namespace

const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::Ok:
      return "ok";
    case Status::BeyondFold:
      return "beyond_fold";
    case Status::NotConverged:
      return "not_converged";
    case Status::NotFinite:
      break;
  }
  return "not_finite";
}

Ray distort(const Lens& lens, const Ray& ray) noexcept {
  const double radial = across(lens.distortion, ray.x * ray.x + ray.y * ray.y);
  const Ray t = tangential(lens.distortion, ray);
  return {ray.x * radial + t.x, ray.y * radial + t.y};
}

std::array<double, 3> distortion_jacobian(const Lens& lens, const Ray& ray) noexcept {
  const auto& [k1, k2, p1, p2, k3] = lens.distortion;
  const double s = ray.x * ray.x + ray.y * ray.y;
  const double radial = across(lens.distortion, s);
  const double slope = 2.0 * (k1 + s * (2.0 * k2 + s * 3.0 * k3));
  return {radial + slope * ray.x * ray.x + 2.0 * p1 * ray.y + 6.0 * p2 * ray.x, slope * ray.x * ray.y + 2.0 * (p1 * ray.x + p2 * ray.y),
          radial + slope * ray.y * ray.y + 6.0 * p1 * ray.y + 2.0 * p2 * ray.x};
}

Pixel to_pixel(const Lens& lens, const Ray& distorted) noexcept {
  return {lens.fx_px * distorted.x + lens.cx_px, lens.fy_px * distorted.y + lens.cy_px};
}

Ray to_ray(const Lens& lens, const Pixel& pixel) noexcept {
  return {(pixel.u_px - lens.cx_px) / lens.fx_px, (pixel.v_px - lens.cy_px) / lens.fy_px};
}

Rectifier::Rectifier(const Lens& lens) noexcept : lens_(lens), radius_(invertible_radius_of(lens.distortion)) {}

bool Rectifier::within(const Ray& ray) const noexcept { return std::hypot(ray.x, ray.y) < radius_; }

double Rectifier::error_px(const Ray& ray, const Ray& residual) const noexcept {
  const double stiffness = smaller_eigenvalue(distortion_jacobian(lens_, ray));
  if (!(stiffness > 0.0)) return std::numeric_limits<double>::infinity();
  return std::hypot(residual.x, residual.y) * std::max(lens_.fx_px, lens_.fy_px) / stiffness;
}

Mapped Rectifier::distort(const Pixel& rectified) const noexcept {
  if (!finite(rectified)) return failed(Status::NotFinite);
  const Ray ray = to_ray(lens_, rectified);
  if (!within(ray)) return failed(Status::BeyondFold);
  return {to_pixel(lens_, optics::distort(lens_, ray)), Status::Ok, 0};
}

Mapped Rectifier::fixed_point(const Pixel& seen, double tolerance) const noexcept {
  if (!finite(seen)) return failed(Status::NotFinite);
  const Ray target = to_ray(lens_, seen);
  Ray ray = target;
  for (int k = 0; k <= most_fixed_point; ++k) {
    const Ray image = optics::distort(lens_, ray);
    if (error_px(ray, {image.x - target.x, image.y - target.y}) <= tolerance)
      return within(ray) ? Mapped{to_pixel(lens_, ray), Status::Ok, k} : failed(Status::BeyondFold, k);
    const double radial = across(lens_.distortion, ray.x * ray.x + ray.y * ray.y);
    const Ray t = tangential(lens_.distortion, ray);
    ray = {(target.x - t.x) / radial, (target.y - t.y) / radial};
    if (!std::isfinite(ray.x) || !std::isfinite(ray.y)) return failed(Status::NotConverged, k + 1);
  }
  return failed(Status::NotConverged, most_fixed_point);
}

Mapped Rectifier::newton(const Pixel& seen, double tolerance) const noexcept {
  if (!finite(seen)) return failed(Status::NotFinite);
  constexpr double of_the_way_out = 0.9;  // a step does not reach the fold
  const Ray target = to_ray(lens_, seen);
  Ray ray{};
  Ray residual{-target.x, -target.y};
  for (int k = 0; k <= most_newton; ++k) {
    if (error_px(ray, residual) <= tolerance) return {to_pixel(lens_, ray), Status::Ok, k};
    const auto [a, b, c] = distortion_jacobian(lens_, ray);
    const double determinant = a * c - b * b;
    const Ray step{(b * residual.y - c * residual.x) / determinant, (b * residual.x - a * residual.y) / determinant};
    const double length = std::hypot(step.x, step.y);
    // The longest part of the step that stays within the disc: |ray + t step| = radius.
    const double forward = (ray.x * step.x + ray.y * step.y) / length;
    const double square = ray.x * ray.x + ray.y * ray.y;
    const double room = std::sqrt(forward * forward + radius_ * radius_ - square) - forward;
    double t = std::min(1.0, of_the_way_out * room / length);
    const double before = std::hypot(residual.x, residual.y);
    bool falls = false;
    for (int halving = 0; halving < 40 && !falls; ++halving) {
      const Ray next{ray.x + t * step.x, ray.y + t * step.y};
      const Ray image = optics::distort(lens_, next);
      const Ray left{image.x - target.x, image.y - target.y};
      falls = std::hypot(left.x, left.y) < before;
      if (!falls) {
        t *= 0.5;
        continue;
      }
      ray = next;
      residual = left;
    }
    if (!falls) break;
  }
  // Within the disc Newton's method finds what is there: J is positive definite, so the residual falls along every step.
  return failed(Status::BeyondFold, most_newton);
}

}  // namespace trocar::optics
