#include "firmware/control/motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trocar::control {
namespace {

using mechanism::Vec3;

constexpr double dt = 0.001;

rig::Limits limits() {
  rig::Limits l;
  l.speed_m_s = 0.1;
  l.angular_speed_rad_s = 2.0;
  l.acceleration_m_s2 = 1.0;
  l.angular_acceleration_rad_s2 = 20.0;
  l.jerk_m_s3 = 20.0;
  l.angular_jerk_rad_s3 = 400.0;
  return l;
}

Motion started(const Vec3& from, const Vec3& to, double speed = 0.05, double angular = 1.0) {
  Motion m;
  m.rest(from);
  m.start(to, speed, angular, limits());
  return m;
}

// Distance of a pose from the line through `from` and `to` in the space of all three coordinates.
double off_line(const Vec3& from, const Vec3& to, const Vec3& x) {
  const Vec3 d = (to - from).normalized();
  const Vec3 r = x - from;
  return (r - d * d.dot(r)).norm();
}

TEST(Motion, TranslationAndRotationStartAndEndTogether) {
  const Vec3 from(0.0, 0.11, 1.0);
  const Vec3 to(0.02, 0.15, 1.7);
  Motion m = started(from, to);
  int ticks = 0;
  while (m.moving() && ticks < 100000) {
    const Reference r = m.update(dt);
    ++ticks;
    EXPECT_LT(off_line(from, to, r.pose), 1e-12);
    // The same part of the way in every coordinate.
    const double part = (r.pose[0] - from[0]) / (to[0] - from[0]);
    EXPECT_NEAR((r.pose[1] - from[1]) / (to[1] - from[1]), part, 1e-9);
    EXPECT_NEAR((r.pose[2] - from[2]) / (to[2] - from[2]), part, 1e-9);
    EXPECT_LE(r.velocity.head<2>().norm(), 0.05 * (1 + 1e-9));
    EXPECT_LE(std::abs(r.velocity[2]), 1.0 * (1 + 1e-9));
    EXPECT_LE(r.acceleration.head<2>().norm(), 1.0 * (1 + 1e-9));
    EXPECT_LE(std::abs(r.acceleration[2]), 20.0 * (1 + 1e-9));
  }
  EXPECT_LT((m.reference().pose - to).norm(), 1e-15);
  EXPECT_EQ(m.reference().velocity, Vec3::Zero());
  EXPECT_EQ(m.reference().acceleration, Vec3::Zero());
  // The slower of the two decides: 44.7 mm at 50 mm/s against 0.7 rad at 1 rad/s.
  EXPECT_GT(ticks * dt, std::hypot(0.02, 0.04) / 0.05);
  EXPECT_LT(ticks * dt, std::hypot(0.02, 0.04) / 0.05 + 0.2);
}

TEST(Motion, VelocityAndAccelerationAreDerivativesOfThePose) {
  Motion m = started({0, 0.1, 0}, {-0.03, 0.14, -0.4});
  Reference before = m.reference();
  while (m.moving()) {
    const Reference now = m.update(dt);
    for (Eigen::Index i = 0; i < 3; ++i) {
      EXPECT_NEAR((now.pose[i] - before.pose[i]) / dt, (now.velocity[i] + before.velocity[i]) / 2, 4e-5);
      EXPECT_NEAR((now.velocity[i] - before.velocity[i]) / dt, (now.acceleration[i] + before.acceleration[i]) / 2, 0.1);
    }
    before = now;
  }
}

TEST(Motion, TurnsAreNotWrapped) {
  const double turn = 2 * std::numbers::pi;
  Motion m = started({0, 0.15, 0.5}, {0, 0.15, 0.5 + 2 * turn}, 0.05, 2.0);
  double turned = 0.0;
  int ticks = 0;
  while (m.moving()) {
    const double before = m.reference().pose[2];
    turned += std::abs(m.update(dt).pose[2] - before);
    ++ticks;
  }
  EXPECT_NEAR(turned, 2 * turn, 1e-9);
  EXPECT_NEAR(m.reference().pose[2], 0.5 + 2 * turn, 1e-12);
  EXPECT_GT(ticks * dt, turn);  // 2 turns at 2 rad/s
}

TEST(Motion, AskedSpeedIsClampedToTheLimits) {
  Motion m = started({0, 0.1, 0}, {0, 0.2, 0.1}, 1e9, 1e9);
  double fastest = 0.0;
  while (m.moving()) fastest = std::max(fastest, m.update(dt).velocity.head<2>().norm());
  EXPECT_NEAR(fastest, 0.1, 1e-9);
}

TEST(Motion, BrakeStaysOnTheLineAndComesToRest) {
  const Vec3 from(0, 0.1, 0);
  const Vec3 to(0.03, 0.16, 0.8);
  for (int at = 1; at < 1500; at += 37) {
    SCOPED_TRACE(at);
    Motion m = started(from, to);
    for (int i = 0; i < at; ++i) (void)m.update(dt);
    Reference before = m.reference();
    m.brake(limits());
    int ticks = 0;
    while (m.moving() && ticks < 1000) {
      const Reference r = m.update(dt);
      ++ticks;
      EXPECT_LT(off_line(from, to, r.pose), 1e-12);
      EXPECT_LE((r.acceleration - before.acceleration).head<2>().norm() / dt, 20.0 * (1 + 1e-6));
      EXPECT_LE((r.velocity - before.velocity).head<2>().norm() / dt, 1.0 * (1 + 1e-6));
      before = r;
    }
    EXPECT_LT(ticks, 300);
    EXPECT_EQ(m.reference().velocity, Vec3::Zero());
    EXPECT_LE((m.reference().pose - from).norm(), (to - from).norm() + 1e-9);
  }
}

TEST(Motion, BrakeAtRestDoesNothing) {
  Motion m;
  m.rest({0.01, 0.12, 0.3});
  m.brake(limits());
  EXPECT_FALSE(m.moving());
  EXPECT_EQ(m.update(dt).pose, Vec3(0.01, 0.12, 0.3));
}

TEST(Motion, TargetWhereItStandsIsNoMotion) {
  Motion m = started({0, 0.1, 0}, {0, 0.1, 0});
  EXPECT_FALSE(m.moving());
  EXPECT_TRUE(m.update(dt).pose.allFinite());
}

TEST(Motion, TinyMovesStayFinite) {
  for (const double d : {1e-3, 1e-9, 1e-30, 1e-150}) {
    SCOPED_TRACE(d);
    Motion m = started({0, 0, 0}, {d, 0, 0});
    for (int i = 0; i < 200; ++i) {
      const Reference& r = m.update(dt);
      ASSERT_TRUE(r.pose.allFinite() && r.velocity.allFinite() && r.acceleration.allFinite());
    }
    EXPECT_FALSE(m.moving());
    EXPECT_EQ(m.reference().pose[0], d);
  }
}

}  // namespace
}  // namespace trocar::control
