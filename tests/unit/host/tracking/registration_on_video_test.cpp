// The registration on what a camera would deliver: rendered frames of a marked plate on the moving tool, tracked, then registered.
#include <gtest/gtest.h>

#include <cmath>

#include "common/optics/render.hpp"
#include "host/camera/registration.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {
namespace {

const optics::Camera small{686, 514, {628.0, 628.0, 348.0, 246.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}}};

optics::MarkerGrid plate() {
  optics::MarkerGrid grid;
  grid.rows = grid.columns = 3;
  grid.spacing_m = 0.008;
  grid.diameter_m = 0.0036;
  return grid;
}

// The tool goes about and turns, 5 s, as a probing motion does.
camera::ToolPose tool(double t_s) {
  const double a = 2.1 * t_s, b = 1.6 * t_s + 0.4, c = 1.9 * t_s;
  return {t_s,
          {0.008 + 0.02 * std::sin(a), 0.008 + 0.015 * std::sin(b), 0.25 * std::sin(c)},
          {0.02 * 2.1 * std::cos(a), 0.015 * 1.6 * std::cos(b), 0.25 * 1.9 * std::cos(c)}};
}

TEST(RegistrationOnVideo, FindsTheCameraOverTheRigFromTrackedMarks) {
  const optics::MarkerGrid grid = plate();
  const optics::Pose above = optics::looking_down(small, grid, 2.37e-4);
  optics::Appearance appearance = optics::clean_appearance();
  appearance.exposure_s = 0.004;  // blurred by up to a pixel
  appearance.read_noise = 3.0;
  optics::Renderer renderer(small, above, grid, appearance, 4);
  Tracker tracker({.grid = grid, .threads = 1});
  constexpr double late_s = 0.012;
  std::vector<camera::ToolPose> poses;
  for (int k = 0; k <= 5000; ++k) poses.push_back(tool(1e-3 * k));
  std::vector<camera::Sighting> sightings;
  std::vector<optics::MarkerState> states(9);
  optics::Frame frame;
  for (std::uint64_t number = 0; number < 98; ++number) {
    const double t = 0.02 + 0.05 * static_cast<double>(number);
    const camera::ToolPose p = tool(t);
    const double c = std::cos(p.pose[2]), s = std::sin(p.pose[2]);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        const double x = 0.008 * (column - 1), y = 0.008 * (row - 1), dx = c * x - s * y, dy = s * x + c * y;
        states[grid.index(row, column)] = {
            {p.pose[0] + dx, p.pose[1] + dy}, p.velocity[0] - p.velocity[2] * dy, p.velocity[1] + p.velocity[2] * dx};
      }
    }
    renderer.render(states, {}, number, std::llround(1e9 * (t - late_s)), frame);
    if (number == 0) {
      ASSERT_EQ(tracker.start(frame), "");
    } else {
      tracker.update(frame);
    }
    for (std::size_t k = 0; k < 9; ++k) {
      const Marker& m = tracker.markers()[k];
      if (m.valid) sightings.push_back({1e-9 * static_cast<double>(frame.time_ns), k, {m.u_px, m.v_px}});
    }
  }
  EXPECT_GT(sightings.size(), 850U);
  const camera::Registration r = camera::register_camera(small.lens, sightings, poses, {});
  EXPECT_LT(r.rms_px, 0.1);
  EXPECT_NEAR(r.delay_s, late_s, 4.0 * r.delay_deviation_s + 1e-5);
  EXPECT_LT(r.delay_deviation_s, 2e-4);
  const optics::PlaneView truth(small.lens, above), found(small.lens, r.pose);
  for (const double x : {-0.02, 0.008, 0.04}) {
    for (const double y : {-0.02, 0.008, 0.04}) {
      const auto p = truth.project({x, y}), q = found.project({x, y});
      ASSERT_TRUE(p && q);
      EXPECT_LT(std::hypot(p->u_px - q->u_px, p->v_px - q->v_px), 0.25) << x << ", " << y;  // 0.06 mm
    }
  }
  for (std::size_t k = 0; k < 9; ++k) {
    EXPECT_NEAR(r.offset_m[k][0], 0.008 * (static_cast<double>(k % 3) - 1.0), 5e-5) << k;
    EXPECT_NEAR(r.offset_m[k][1], 0.008 * (static_cast<double>(k / 3) - 1.0), 5e-5) << k;
  }
  RecordProperty("rms_px", std::to_string(r.rms_px));
}

}  // namespace
}  // namespace trocar::tracking
