#include "host/camera/registration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trocar::camera {
namespace {

constexpr optics::Lens thesis{1884.0, 1884.0, 1044.0, 737.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}};
// Looking down from 0.15 m, a little tilted and turned; z of the rig towards the camera.
const optics::Pose above{{3.08, 0.11, -0.09}, {-0.01, 0.27, 0.15}};

// The tool goes about before the tissue and turns; theta about pi / 2.
ToolPose tool(double t_s, double turn_rad, double across_m = 0.02) {
  const double a = 1.3 * t_s, b = 0.9 * t_s + 0.4, c = 0.7 * t_s;
  return {t_s,
          {across_m * std::sin(a), 0.20 + 0.03 * std::sin(b), 1.57 + turn_rad * std::sin(c)},
          {across_m * 1.3 * std::cos(a), 0.03 * 0.9 * std::cos(b), turn_rad * 0.7 * std::cos(c)}};
}

struct Motion {
  std::vector<ToolPose> poses{};
  std::vector<Sighting> sightings{};
};

// 20 s at 1 kHz, watched 30 times a second by a camera whose clock is `late_s` behind.
Motion move(const std::vector<std::array<double, 2>>& marks, double noise_px, double late_s, double turn_rad, double across_m = 0.02) {
  Motion out;
  std::mt19937 random(7);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (int k = 0; k <= 20000; ++k) out.poses.push_back(tool(1e-3 * k, turn_rad, across_m));
  const optics::PlaneView view(thesis, above);
  for (int k = 10; k < 590; ++k) {
    const double t = k / 30.0;
    const auto p = tool(t, turn_rad, across_m).pose;
    for (std::size_t m = 0; m < marks.size(); ++m) {
      const double c = std::cos(p[2]), s = std::sin(p[2]);
      const auto pixel = view.project({p[0] + c * marks[m][0] - s * marks[m][1], p[1] + s * marks[m][0] + c * marks[m][1]});
      if (!pixel) continue;
      out.sightings.push_back({t - late_s, m, {pixel->u_px + noise_px * noise(random), pixel->v_px + noise_px * noise(random)}});
    }
  }
  return out;
}

double pose_error_px(const optics::Pose& found) {
  const optics::PlaneView a(thesis, above), b(thesis, found);
  double worst = 0.0;
  for (const double x : {-0.03, 0.0, 0.03})
    for (const double y : {0.22, 0.27, 0.32}) {
      const auto p = a.project({x, y}), q = b.project({x, y});
      if (!p || !q) return 1e9;
      worst = std::max(worst, std::hypot(p->u_px - q->u_px, p->v_px - q->v_px));
    }
  return worst;
}

TEST(Registration, FindsPoseDelayAndTheMarksPlace) {
  const Motion m = move({{0.07, 0.004}, {0.05, -0.006}}, 0.0, 0.012, 0.3);
  const Registration r = register_camera(thesis, m.sightings, m.poses, {});
  EXPECT_LT(r.rms_px, 1e-6);
  EXPECT_LT(pose_error_px(r.pose), 1e-5);
  EXPECT_NEAR(r.delay_s, 0.012, 1e-8);
  EXPECT_NEAR(r.offset_m[0][0], 0.07, 1e-8);
  EXPECT_NEAR(r.offset_m[0][1], 0.004, 1e-8);
  EXPECT_NEAR(r.offset_m[1][0], 0.05, 1e-8);
  EXPECT_NEAR(r.offset_m[1][1], -0.006, 1e-8);
}

TEST(Registration, ErrorsAreWhatTheDeviationsSay) {
  const Motion m = move({{0.07, 0.004}}, 0.2, 0.012, 0.3);
  const Registration r = register_camera(thesis, m.sightings, m.poses, {});
  EXPECT_NEAR(r.rms_px, 0.2 * std::sqrt(2.0), 0.02);
  EXPECT_EQ(r.outliers, 0u);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_GT(r.pose_deviation.translation_m[k], 0.0);
    EXPECT_LT(std::abs(r.pose.translation_m[k] - above.translation_m[k]), 4.0 * r.pose_deviation.translation_m[k]) << k;
    EXPECT_LT(std::abs(r.pose.rotation_rad[k] - above.rotation_rad[k]),
              4.0 * std::hypot(r.pose_deviation.rotation_rad[0], r.pose_deviation.rotation_rad[1], r.pose_deviation.rotation_rad[2]))
        << k;
  }
  EXPECT_LT(std::abs(r.delay_s - 0.012), 4.0 * r.delay_deviation_s);
  EXPECT_LT(std::abs(r.offset_m[0][0] - 0.07), 4.0 * r.offset_deviation_m[0][0]);
  EXPECT_LT(std::abs(r.offset_m[0][1] - 0.004), 4.0 * r.offset_deviation_m[0][1]);
  EXPECT_LT(r.pose_deviation.translation_m[0], 1e-4);
  EXPECT_LT(pose_error_px(r.pose), 1.0);
}

TEST(Registration, LeavesOutWrongSightings) {
  Motion m = move({{0.07, 0.004}}, 0.05, 0.0, 0.3);
  for (std::size_t k = 0; k < m.sightings.size(); k += 29) m.sightings[k].pixel.u_px += 25.0;
  const Registration r = register_camera(thesis, m.sightings, m.poses, {});
  EXPECT_EQ(r.outliers, (m.sightings.size() + 28) / 29);
  EXPECT_LT(pose_error_px(r.pose), 0.3);
}

TEST(Registration, AToolThatDoesNotTurnNeedsTheMarksPlace) {
  const Motion m = move({{0.07, 0.004}}, 0.0, 0.0, 0.0);
  EXPECT_THROW((void)register_camera(thesis, m.sightings, m.poses, {}), Undetermined);
  const Registration r = register_camera(thesis, m.sightings, m.poses, {{{0.07, 0.004}}, 0.0, true});
  EXPECT_LT(pose_error_px(r.pose), 1e-5);
  EXPECT_EQ(r.delay_s, 0.0);
}

TEST(Registration, ALineDoesNotDetermineAPlane) {
  const Motion m = move({{0.07, 0.004}}, 0.0, 0.0, 0.3, 1e-4);
  try {
    (void)register_camera(thesis, m.sightings, m.poses, {});
    FAIL();
  } catch (const Undetermined& e) {
    EXPECT_NE(std::string(e.what()).find("along a line"), std::string::npos) << e.what();
  }
}

TEST(Registration, SamplesOfAnotherTimeAreRefused) {
  Motion m = move({{0.07, 0.004}}, 0.0, 0.0, 0.3);
  for (Sighting& s : m.sightings) s.t_s += 100.0;
  EXPECT_THROW((void)register_camera(thesis, m.sightings, m.poses, {}), Undetermined);
}

TEST(Registration, ThePhantomIsPlacedInTheRig) {
  // Phantom frame: 30 degrees in the rig's plane, at (0.1, 0.2), 11 mm above it.
  const double a = std::numbers::pi / 6.0;
  const optics::Pose rig{{std::numbers::pi, 0.0, 0.0}, {0.0, 0.0, 0.5}};  // x right, y up in the image, z to the camera
  // Rot_x(pi) Rot_z(a) is half a turn about the axis (cos(a/2), -sin(a/2), 0).
  const optics::Pose phantom{{std::numbers::pi * std::cos(a / 2), -std::numbers::pi * std::sin(a / 2), 0.0}, {0.1, -0.2, 0.489}};
  const Placement p = place(rig, phantom);
  EXPECT_NEAR(p.x_m, 0.1, 1e-12);
  EXPECT_NEAR(p.y_m, 0.2, 1e-12);
  EXPECT_NEAR(p.height_m, 0.011, 1e-12);
  EXPECT_NEAR(p.angle_rad, a, 1e-12);
  EXPECT_NEAR(p.tilt_rad, 0.0, 1e-6);
}

}  // namespace
}  // namespace trocar::camera
