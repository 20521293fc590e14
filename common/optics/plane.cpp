#include "common/optics/plane.hpp"

#include <cmath>

namespace trocar::optics {
namespace {

std::array<std::array<double, 3>, 3> rotation_of(const std::array<double, 3>& r) noexcept {
  const double angle = std::hypot(r[0], r[1], r[2]);
  // sin(a)/a and (1 - cos(a))/a^2, which have limits.
  const double s = angle > 1e-9 ? std::sin(angle) / angle : 1.0;
  const double half = angle > 1e-9 ? std::sin(0.5 * angle) / (0.5 * angle) : 1.0;
  const double c = 0.5 * half * half;
  const double xx = r[0] * r[0], yy = r[1] * r[1], zz = r[2] * r[2];
  const double xy = r[0] * r[1], xz = r[0] * r[2], yz = r[1] * r[2];
  return {{{1.0 - c * (yy + zz), c * xy - s * r[2], c * xz + s * r[1]},
           {c * xy + s * r[2], 1.0 - c * (xx + zz), c * yz - s * r[0]},
           {c * xz - s * r[1], c * yz + s * r[0], 1.0 - c * (xx + yy)}}};
}

}  // namespace

PlaneView::PlaneView(const Lens& lens, const Pose& pose) noexcept
    : rectifier_(lens), pose_(pose), rotation_(rotation_of(pose.rotation_rad)) {}

std::optional<Pixel> PlaneView::project(const PlanePoint& point) const noexcept {
  const auto& r = rotation_;
  const auto& t = pose_.translation_m;
  const double depth = r[2][0] * point.x_m + r[2][1] * point.y_m + t[2];
  if (!(depth > 0.0)) return std::nullopt;
  const Ray ray{(r[0][0] * point.x_m + r[0][1] * point.y_m + t[0]) / depth, (r[1][0] * point.x_m + r[1][1] * point.y_m + t[1]) / depth};
  if (!(std::hypot(ray.x, ray.y) < rectifier_.invertible_radius())) return std::nullopt;
  return to_pixel(rectifier_.lens(), distort(rectifier_.lens(), ray));
}

std::optional<PlanePoint> PlaneView::locate(const Pixel& seen) const noexcept {
  const Mapped mapped = rectifier_.newton(seen);
  if (mapped.status != Status::Ok) return std::nullopt;
  const Ray ray = to_ray(rectifier_.lens(), mapped.pixel);
  const auto& r = rotation_;
  const auto& t = pose_.translation_m;
  // depth (ray.x, ray.y, 1) = x r0 + y r1 + t, with the depth eliminated.
  const double a = r[0][0] - ray.x * r[2][0], b = r[0][1] - ray.x * r[2][1], p = ray.x * t[2] - t[0];
  const double c = r[1][0] - ray.y * r[2][0], d = r[1][1] - ray.y * r[2][1], q = ray.y * t[2] - t[1];
  const double det = a * d - b * c;
  const PlanePoint point{(p * d - b * q) / det, (a * q - p * c) / det};
  const double depth = r[2][0] * point.x_m + r[2][1] * point.y_m + t[2];
  if (!std::isfinite(point.x_m) || !std::isfinite(point.y_m) || !(depth > 0.0)) return std::nullopt;
  return point;
}

Jacobian2 PlaneView::jacobian(const PlanePoint& point) const noexcept {
  const auto& r = rotation_;
  const auto& t = pose_.translation_m;
  const double depth = r[2][0] * point.x_m + r[2][1] * point.y_m + t[2];
  const Ray ray{(r[0][0] * point.x_m + r[0][1] * point.y_m + t[0]) / depth, (r[1][0] * point.x_m + r[1][1] * point.y_m + t[1]) / depth};
  const auto lens = distortion_jacobian(rectifier_.lens(), ray);
  Jacobian2 out{};
  for (std::size_t k = 0; k < 2; ++k) {
    const double dx = (r[0][k] - ray.x * r[2][k]) / depth, dy = (r[1][k] - ray.y * r[2][k]) / depth;
    out[0][k] = rectifier_.lens().fx_px * (lens[0] * dx + lens[1] * dy);
    out[1][k] = rectifier_.lens().fy_px * (lens[1] * dx + lens[2] * dy);
  }
  return out;
}

}  // namespace trocar::optics
