#include "firmware/control/profile.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trocar::control {
namespace {

struct Extremes {
  double velocity{};
  double acceleration{};
  double jerk{};
  double slope_error{};     // |dx/dt - velocity|, by central differences
  double velocity_error{};  // |dv/dt - acceleration|
};

// Everything from differences of neighbouring states: a jump of any of them shows as an excess of the next derivative.
Extremes measure(const Profile& profile, int steps = 20000) {
  Extremes most;
  const double dt = profile.duration_s() / steps;
  for (int i = 1; i < steps; ++i) {
    const PathState a = profile.at((i - 1) * dt);
    const PathState b = profile.at(i * dt);
    const PathState c = profile.at((i + 1) * dt);
    most.velocity = std::max(most.velocity, std::abs(c.position - b.position) / dt);
    most.acceleration = std::max(most.acceleration, std::abs(c.velocity - b.velocity) / dt);
    most.jerk = std::max(most.jerk, std::abs(c.acceleration - b.acceleration) / dt);
    most.slope_error = std::max(most.slope_error, std::abs((c.position - a.position) / (2 * dt) - b.velocity));
    most.velocity_error = std::max(most.velocity_error, std::abs((c.velocity - a.velocity) / (2 * dt) - b.acceleration));
  }
  return most;
}

void expect_within(const Extremes& most, const PathLimits& limits) {
  EXPECT_LE(most.velocity, limits.velocity * (1 + 1e-8));
  EXPECT_LE(most.acceleration, limits.acceleration * (1 + 1e-8));
  EXPECT_LE(most.jerk, limits.jerk * (1 + 1e-5));
  EXPECT_LT(most.slope_error, 1e-4 * limits.velocity);
  EXPECT_LT(most.velocity_error, 2e-3 * limits.acceleration);
}

void expect_rest_at(const Profile& profile, double distance) {
  for (const double late : {0.0, 1e-9, 1.0, 1e6}) {
    const PathState end = profile.at(profile.duration_s() + late);
    EXPECT_EQ(end.position, distance);
    EXPECT_EQ(end.velocity, 0.0);
    EXPECT_EQ(end.acceleration, 0.0);
  }
  // The pieces themselves lead there; the end is not a jump.
  const PathState before = profile.at(profile.duration_s() * (1 - 1e-9));
  EXPECT_NEAR(before.position, distance, 1e-9 * std::max(1.0, distance));
  EXPECT_NEAR(before.velocity, 0.0, 1e-6 + 1e-8 * profile.duration_s());
}

constexpr PathLimits limits{0.1, 1.0, 20.0};

TEST(Profile, CruisesWhenThereIsRoom) {
  const double d = 0.08;
  const Profile p = Profile::rest_to_rest(d, limits);
  EXPECT_NEAR(p.duration_s(), d / 0.1 + 0.1 / 1.0 + 1.0 / 20.0, 1e-12);
  EXPECT_NEAR(p.at(p.duration_s() / 2).velocity, 0.1, 1e-12);
  expect_rest_at(p, d);
  expect_within(measure(p), limits);
}

TEST(Profile, StaysBelowTheVelocityLimitOnAShortPath) {
  // Peak velocity 0.08 with a piece at full acceleration: distance = v (v/a + a/j).
  const double v = 0.08;
  const double d = v * (v / 1.0 + 1.0 / 20.0);
  const Profile p = Profile::rest_to_rest(d, limits);
  EXPECT_NEAR(p.duration_s(), 2 * (v / 1.0 + 1.0 / 20.0), 1e-10);
  EXPECT_NEAR(p.at(p.duration_s() / 2).velocity, v, 1e-10);
  expect_rest_at(p, d);
  const Extremes most = measure(p);
  expect_within(most, limits);
  EXPECT_NEAR(most.acceleration, 1.0, 1e-6);
}

TEST(Profile, StaysBelowTheAccelerationLimitOnAVeryShortPath) {
  // Jerk alone: peak velocity v below a^2/j, distance = v 2 sqrt(v/j).
  const double v = 0.02;
  const double d = v * 2 * std::sqrt(v / 20.0);
  const Profile p = Profile::rest_to_rest(d, limits);
  EXPECT_NEAR(p.duration_s(), 4 * std::sqrt(v / 20.0), 1e-10);
  expect_rest_at(p, d);
  const Extremes most = measure(p);
  expect_within(most, limits);
  EXPECT_NEAR(most.jerk, 20.0, 1e-3);
  EXPECT_NEAR(most.acceleration, std::sqrt(v * 20.0), 1e-3);
}

TEST(Profile, KeepsLimitsOverManyScales) {
  for (const double d : {1e-9, 1e-6, 1e-4, 0.0049, 0.005, 0.0051, 0.0149, 0.015, 0.0151, 1.0, 100.0})
    for (const PathLimits& l : {limits, PathLimits{0.001, 10.0, 1000.0}, PathLimits{10.0, 0.1, 0.5}, PathLimits{0.05, 1.0, 20.0}}) {
      SCOPED_TRACE(d);
      const Profile p = Profile::rest_to_rest(d, l);
      expect_rest_at(p, d);
      const Extremes most = measure(p, 3001);
      EXPECT_LE(most.velocity, l.velocity * (1 + 1e-6));
      EXPECT_LE(most.acceleration, l.acceleration * (1 + 1e-6));
      EXPECT_LE(most.jerk, l.jerk * (1 + 1e-3));
    }
}

TEST(Profile, NothingToDoForNoDistance) {
  for (const double d : {0.0, -1.0, std::nan("")}) {
    const Profile p = Profile::rest_to_rest(d, limits);
    EXPECT_EQ(p.duration_s(), 0.0);
    EXPECT_EQ(p.at(1.0).position, 0.0);
    EXPECT_EQ(p.at(1.0).velocity, 0.0);
  }
}

void expect_brake(const PathState& start, const PathLimits& l, double velocity_allowed) {
  const Profile p = Profile::brake(start, l);
  const PathState first = p.at(0.0);
  EXPECT_EQ(first.position, start.position);
  if (p.duration_s() == 0.0) return;
  EXPECT_NEAR(first.velocity, start.velocity, 1e-12);
  const PathState end = p.at(p.duration_s());
  EXPECT_EQ(end.velocity, 0.0);
  EXPECT_EQ(end.acceleration, 0.0);
  const PathState before = p.at(p.duration_s() * (1 - 1e-12));
  EXPECT_NEAR(before.velocity, 0.0, 1e-9);
  EXPECT_NEAR(before.acceleration, 0.0, 1e-6);
  EXPECT_NEAR(before.position, end.position, 1e-9);
  const Extremes most = measure(p, 2000);
  EXPECT_LE(most.velocity, velocity_allowed * (1 + 1e-6) + 1e-12);
  EXPECT_LE(most.acceleration, std::max(l.acceleration, std::abs(start.acceleration)) * (1 + 1e-6));
  EXPECT_LE(most.jerk, l.jerk * (1 + 1e-3));
}

TEST(Profile, BrakesFromEveryStateOfAMotion) {
  for (const double d : {0.001, 0.01, 0.08}) {
    const Profile p = Profile::rest_to_rest(d, limits);
    for (int i = 0; i <= 200; ++i) {
      SCOPED_TRACE(i);
      const PathState s = p.at(p.duration_s() * i / 200);
      // Acceleration may not end at once, so the velocity still grows by a^2/(2 j).
      expect_brake(s, limits, std::abs(s.velocity) + s.acceleration * s.acceleration / (2 * limits.jerk));
      const double stop = Profile::brake(s, limits).at(1e9).position;
      EXPECT_GE(stop, s.position - 1e-12);
      EXPECT_LE(stop, d + 1e-9);
    }
  }
}

TEST(Profile, BrakesFromStatesBeyondTheLimits) {
  for (const double v : {-0.5, -0.1, 0.0, 0.003, 0.1, 0.5})
    for (const double a : {-3.0, -1.0, 0.0, 0.4, 1.0, 3.0}) {
      SCOPED_TRACE(testing::Message() << v << ' ' << a);
      expect_brake({0.3, v, a}, limits, std::abs(v) + a * a / (2 * limits.jerk));
    }
}

TEST(Profile, BrakeDistanceIsTheAreaUnderItsVelocity) {
  const Profile p = Profile::brake({0.0, 0.1, 0.5}, limits);
  const int n = 200000;
  const double dt = p.duration_s() / n;
  double area = 0.0;
  for (int i = 0; i < n; ++i) area += dt * p.at((i + 0.5) * dt).velocity;
  EXPECT_NEAR(p.at(p.duration_s()).position, area, 1e-9);
}

}  // namespace
}  // namespace trocar::control
