#include "firmware/control/pid.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::control {
namespace {

constexpr double dt = 0.001;
constexpr double wide = 1e6;

TEST(Pid, ProportionalAndDerivativeHaveNoMemory) {
  PidState s;
  const rig::AxisGains g{800.0, 0.0, 10.0};
  EXPECT_DOUBLE_EQ(update(g, s, 0.002, 0.0, wide, dt), 1.6);
  EXPECT_DOUBLE_EQ(update(g, s, 0.0, 0.05, wide, dt), 0.5);
  EXPECT_DOUBLE_EQ(update(g, s, -0.002, 0.05, wide, dt), -1.1);
  EXPECT_DOUBLE_EQ(update(g, s, 0.0, 0.0, wide, dt), 0.0);
}

TEST(Pid, IntegralOfAConstantIsARamp) {
  PidState s;
  const rig::AxisGains g{0.0, 2000.0, 0.0};
  double u = 0.0;
  for (int i = 0; i < 500; ++i) u = update(g, s, 0.001, 0.0, wide, dt);
  EXPECT_NEAR(u, 2000.0 * 0.001 * 0.5, 1e-12);
}

TEST(Pid, IntegralOfASineIsItsCosine) {
  PidState s;
  const rig::AxisGains g{0.0, 3.0, 0.0};
  const double w = 10.0;
  double u = 0.0;
  const int n = 777;
  for (int i = 0; i < n; ++i) u = update(g, s, std::sin(w * (i + 0.5) * dt), 0.0, wide, dt);
  EXPECT_NEAR(u, 3.0 / w * (1 - std::cos(w * n * dt)), 1e-5);
}

TEST(Pid, OutputStaysWithinItsLimit) {
  PidState s;
  const rig::AxisGains g{800.0, 2000.0, 10.0};
  for (const double e : {1.0, -1.0, 1e9, -1e9, 0.0}) EXPECT_LE(std::abs(update(g, s, e, 0.0, 12.0, dt)), 12.0);
}

TEST(Pid, IntegralStaysBoundedAndRecoversAtOnce) {
  for (const double sign : {1.0, -1.0}) {
    PidState s;
    const rig::AxisGains g{100.0, 2000.0, 0.0};
    // Ten seconds against a stop; an unbounded integral would be 2000 * 0.1 * 10 = 2000 N.
    for (int i = 0; i < 10000; ++i) (void)update(g, s, sign * 0.1, 0.0, 12.0, dt);
    EXPECT_LE(std::abs(s.integral), 12.0);
    // Free again: an error of the other sign is acted upon within the 12 N / (2000 * 0.1 N/s) = 60 ms that the bound allows.
    int ticks = 0;
    while (sign * update(g, s, -sign * 0.1, 0.0, 12.0, dt) > 0.0 && ticks < 10000) ++ticks;
    EXPECT_LE(ticks, 60);
  }
}

TEST(Pid, SaturatedByTheOthersTheIntegralWaits) {
  PidState s;
  const rig::AxisGains g{1000.0, 2000.0, 0.0};
  for (int i = 0; i < 1000; ++i) EXPECT_DOUBLE_EQ(update(g, s, 0.1, 0.0, 12.0, dt), 12.0);
  EXPECT_EQ(s.integral, 0.0);
}

TEST(Pid, NaNDoesNotStayInTheState) {
  PidState s{1.5};
  const rig::AxisGains g{800.0, 2000.0, 10.0};
  (void)update(g, s, std::nan(""), 0.0, 12.0, dt);
  EXPECT_EQ(s.integral, 1.5);
}

}  // namespace
}  // namespace trocar::control
