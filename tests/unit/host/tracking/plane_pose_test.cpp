#include "host/tracking/plane_pose.hpp"

#include <gtest/gtest.h>

#include <sstream>

#include "host/tracking/metric.hpp"
#include "scene.hpp"

namespace trocar::tracking {
namespace {

std::vector<Marker> markers_at(const optics::PlaneView& view, const optics::MarkerGrid& grid) {
  std::vector<Marker> markers;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const auto pixel = view.project(grid.at_rest(row, column));
      EXPECT_TRUE(pixel);
      markers.push_back({true, pixel->u_px, pixel->v_px, 1.0, {0.01, 0.002, 0.03}});
    }
  }
  return markers;
}

TEST(FitPlane, FindsThePoseThatTheMarkersWereSeenFrom) {
  const optics::Pose pose{{3.0, 0.1, -0.05}, {-0.021, 0.018, 0.06}};
  const optics::PlaneView view(small_camera().lens, pose);
  auto markers = markers_at(view, small_grid());
  markers[7].valid = false;
  markers[7].u_px = markers[7].v_px = std::nan("");
  const auto fit = fit_plane(small_camera().lens, small_grid(), markers);
  ASSERT_TRUE(fit);
  EXPECT_LT(fit->rms_px, 1e-5);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(fit->pose.rotation_rad[k], pose.rotation_rad[k], 1e-6);
    EXPECT_NEAR(fit->pose.translation_m[k], pose.translation_m[k], 1e-8);
  }
}

TEST(FitPlane, SaysWhenMarkersDetermineNothing) {
  const optics::PlaneView view(small_camera().lens, small_pose());
  auto markers = markers_at(view, small_grid());
  for (std::size_t k = 3; k < markers.size(); ++k) markers[k].valid = false;
  EXPECT_FALSE(fit_plane(small_camera().lens, small_grid(), markers));
}

TEST(ToPlane, CarriesPlaceAndCovarianceOver) {
  const optics::PlaneView view(small_camera().lens, small_pose(0.1));
  const Marker marker{true, 210.0, 450.0, 1.0, {0.01, 0.002, 0.03}};
  const MetricMarker metric = to_plane(view, marker);
  const auto back = view.project({metric.x_m, metric.y_m});
  ASSERT_TRUE(back);
  EXPECT_NEAR(back->u_px, 210.0, 1e-6);
  EXPECT_NEAR(back->v_px, 450.0, 1e-6);
  // By differences of locate.
  constexpr double h = 0.01;
  const auto u1 = view.locate({210.0 + h, 450.0}), u0 = view.locate({210.0 - h, 450.0}), v1 = view.locate({210.0, 450.0 + h}),
             v0 = view.locate({210.0, 450.0 - h});
  ASSERT_TRUE(u1 && u0 && v1 && v0);
  const double a = (u1->x_m - u0->x_m) / (2 * h), b = (v1->x_m - v0->x_m) / (2 * h), c = (u1->y_m - u0->y_m) / (2 * h),
               d = (v1->y_m - v0->y_m) / (2 * h);
  EXPECT_NEAR(metric.covariance[0], a * a * 0.01 + 2 * a * b * 0.002 + b * b * 0.03, 1e-15);
  EXPECT_NEAR(metric.covariance[1], a * c * 0.01 + (a * d + b * c) * 0.002 + b * d * 0.03, 1e-15);
  EXPECT_NEAR(metric.covariance[2], c * c * 0.01 + 2 * c * d * 0.002 + d * d * 0.03, 1e-15);
}

TEST(ToPlane, InventsNothingForALostMarker) {
  const optics::PlaneView view(small_camera().lens, small_pose());
  const MetricMarker metric = to_plane(view, {false, std::nan(""), std::nan(""), 0.1, {}});
  EXPECT_TRUE(std::isnan(metric.x_m) && std::isnan(metric.y_m) && std::isnan(metric.covariance[0]));
}

}  // namespace
}  // namespace trocar::tracking
