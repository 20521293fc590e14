#include "host/tracking/plane_pose.hpp"

#include <cmath>
#include <opencv2/calib3d.hpp>

namespace trocar::tracking {

std::optional<PlaneFit> fit_plane(const optics::Lens& lens, const optics::MarkerGrid& grid, std::span<const Marker> markers) {
  const optics::Rectifier rectifier(lens);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> rays, pixels;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const Marker& m = markers[grid.index(row, column)];
      if (!m.valid) continue;
      const optics::Mapped mapped = rectifier.newton({m.u_px, m.v_px});
      if (mapped.status != optics::Status::Ok) continue;
      const optics::Ray ray = optics::to_ray(lens, mapped.pixel);
      const optics::PlanePoint p = grid.at_rest(row, column);
      points.emplace_back(p.x_m, p.y_m, 0.0);
      rays.emplace_back(ray.x, ray.y);
      pixels.emplace_back(m.u_px, m.v_px);
    }
  }
  if (points.size() < 4) return std::nullopt;
  PlaneFit fit;
  try {
    const cv::Matx33d pinhole = cv::Matx33d::eye();
    const cv::Matx33d matrix(lens.fx_px, 0.0, lens.cx_px, 0.0, lens.fy_px, lens.cy_px, 0.0, 0.0, 1.0);
    const std::vector<double> distortion(lens.distortion.begin(), lens.distortion.end());
    cv::Vec3d rotation, translation;
    if (!cv::solvePnP(points, rays, pinhole, cv::noArray(), rotation, translation, false, cv::SOLVEPNP_IPPE)) return std::nullopt;
    cv::solvePnPRefineLM(points, pixels, matrix, distortion, rotation, translation);
    fit.pose = {{rotation[0], rotation[1], rotation[2]}, {translation[0], translation[1], translation[2]}};
  } catch (const cv::Exception&) {  // points on a line
    return std::nullopt;
  }
  const optics::PlaneView view(lens, fit.pose);
  double squares = 0.0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto seen = view.project({points[k].x, points[k].y});
    if (!seen) return std::nullopt;
    squares += std::pow(seen->u_px - pixels[k].x, 2) + std::pow(seen->v_px - pixels[k].y, 2);
  }
  fit.rms_px = std::sqrt(squares / static_cast<double>(points.size()));
  return fit;
}

}  // namespace trocar::tracking
