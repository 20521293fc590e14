#include "host/tracking/metric.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "host/tracking/plane_pose.hpp"
#include "scenes.hpp"

namespace trocar::tracking {
namespace {

// Markers as a perfect tracker would see them, with noise.
std::vector<Marker> seen(const optics::PlaneView& view, const optics::MarkerGrid& grid, double noise_px) {
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<Marker> out;
  for (int row = 0; row < grid.rows; ++row)
    for (int column = 0; column < grid.columns; ++column) {
      const auto p = view.project(grid.at_rest(row, column));
      out.push_back({true, p->u_px + noise_px * noise(random), p->v_px + noise_px * noise(random), 1.0, {1e-2, 2e-3, 4e-2}});
    }
  return out;
}
const optics::Pose tilted{{3.05, 0.08, -0.1}, {-0.052, 0.047, 0.149}};

TEST(PlanePose, IsFoundFromTheMarkers) {
  const optics::Camera camera = testing::thesis_camera();
  const optics::PlaneView view(camera.lens, tilted);
  const optics::MarkerGrid grid;
  const auto exact = fit_plane(camera.lens, grid, seen(view, grid, 0.0));
  ASSERT_TRUE(exact);
  EXPECT_LT(exact->rms_px, 1e-4);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(exact->pose.translation_m[k], tilted.translation_m[k], 1e-8);
  const auto noisy = fit_plane(camera.lens, grid, seen(view, grid, 0.05));
  ASSERT_TRUE(noisy);
  EXPECT_NEAR(noisy->rms_px, 0.05 * std::sqrt(2.0), 0.01);
  // Where the plane is, to some micrometres.
  const optics::PlaneView found(camera.lens, noisy->pose);
  for (const Marker& m : seen(view, grid, 0.0)) {
    const auto a = view.locate({m.u_px, m.v_px}), b = found.locate({m.u_px, m.v_px});
    EXPECT_LT(std::hypot(a->x_m - b->x_m, a->y_m - b->y_m), 3e-6);
  }
}

TEST(PlanePose, TooFewOrALineDetermineNothing) {
  const optics::Camera camera = testing::thesis_camera();
  const optics::PlaneView view(camera.lens, tilted);
  const optics::MarkerGrid grid;
  std::vector<Marker> markers = seen(view, grid, 0.0);
  for (std::size_t k = 3; k < markers.size(); ++k) markers[k].valid = false;
  EXPECT_FALSE(fit_plane(camera.lens, grid, markers));
}

TEST(Metric, CovarianceFollowsTheMarkersThroughThePlane) {
  const optics::Camera camera = testing::thesis_camera();
  const optics::PlaneView view(camera.lens, tilted);
  const Marker marker{true, 400.0, 1200.0, 1.0, {0.04, 0.01, 0.09}};
  const MetricMarker m = to_plane(view, marker);
  // Samples of the same normal distribution, located one by one.
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0.0, 1.0);
  const double l11 = 0.2, l21 = 0.01 / 0.2, l22 = std::sqrt(0.09 - l21 * l21);
  double xx = 0, xy = 0, yy = 0;
  constexpr int n = 20000;
  for (int k = 0; k < n; ++k) {
    const double a = normal(random), b = normal(random);
    const auto p = view.locate({400.0 + l11 * a, 1200.0 + l21 * a + l22 * b});
    xx += std::pow(p->x_m - m.x_m, 2) / n;
    xy += (p->x_m - m.x_m) * (p->y_m - m.y_m) / n;
    yy += std::pow(p->y_m - m.y_m, 2) / n;
  }
  EXPECT_NEAR(m.covariance[0] / xx, 1.0, 0.05);
  EXPECT_NEAR(m.covariance[2] / yy, 1.0, 0.05);
  EXPECT_NEAR(m.covariance[1], xy, 0.05 * std::sqrt(xx * yy));
}

TEST(Metric, WhatWasNotSeenHasNoPlace) {
  const optics::PlaneView view(testing::thesis_camera().lens, tilted);
  EXPECT_TRUE(std::isnan(to_plane(view, {}).x_m));
}

}  // namespace
}  // namespace trocar::tracking
