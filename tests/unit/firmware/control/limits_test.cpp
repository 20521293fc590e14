#include "firmware/control/limits.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace trocar::control {
namespace {

using mechanism::Vec3;
constexpr double dt = 1e-3;
constexpr OutputLimits limits{4.0, 0.1, 400.0, 10.0, 0.5, 0.9, 10.0, 18.0};

TEST(OutputLimits, LeavesWhatIsWithinThem) {
  LimitState s;
  const Vec3 u(0.2, -0.1, 0.005);
  EXPECT_EQ(update(limits, s, u, {0.4, 0.0, 5.0}, dt), u);
  EXPECT_EQ(s.force + s.slew + s.velocity, 0U);
}

TEST(OutputLimits, ForceKeepsItsDirectionAndMomentItsSign) {
  LimitState s;
  Vec3 u;
  for (int k = 0; k < 100; ++k) u = update(limits, s, {30.0, -40.0, -7.0}, Vec3::Zero(), dt);
  EXPECT_NEAR(u[0], 4.0 * 0.6, 1e-12);
  EXPECT_NEAR(u[1], -4.0 * 0.8, 1e-12);
  EXPECT_NEAR(u[2], -0.1, 1e-12);
  EXPECT_EQ(s.force, 100U);
}

TEST(OutputLimits, SlewTakesTheStraightWay) {
  LimitState s;
  const Vec3 first = update(limits, s, {3.0, 0.0, 0.1}, Vec3::Zero(), dt);
  EXPECT_NEAR(first[0], 0.4, 1e-12);
  EXPECT_NEAR(first[2], 0.01, 1e-12);
  int ticks = 1;
  while (s.last[0] < 3.0 && ticks < 100) {
    (void)update(limits, s, {3.0, 0.0, 0.1}, Vec3::Zero(), dt);
    ++ticks;
  }
  EXPECT_EQ(ticks, 8);
}

TEST(OutputLimits, OnlyWhatSpeedsUpIsTakenAwayBeyondTheSpeed) {
  const auto settled = [](const Vec3& u, const Vec3& v) {
    LimitState s;
    s.last = u;
    return update(limits, s, u, v, dt);
  };
  const Vec3 along(0.3, 0.1, 0.01);
  EXPECT_EQ(settled(along, {0.5, 0.0, 0.0}), along);             // at the limit: still whole
  EXPECT_NEAR(settled(along, {0.7, 0.0, 0.0})[0], 0.15, 1e-12);  // half way
  EXPECT_NEAR(settled(along, {0.9, 0.0, 0.0})[0], 0.0, 1e-12);   // wholly
  EXPECT_NEAR(settled(along, {5.0, 0.0, 0.0})[0], 0.0, 1e-12);   // beyond
  EXPECT_NEAR(settled(along, {5.0, 0.0, 0.0})[1], 0.1, 1e-12);   // across stays
  EXPECT_EQ(settled(along, {-5.0, 0.0, 0.0})[0], 0.3);           // brakes
  EXPECT_NEAR(settled(along, {0.0, 0.0, 14.0})[2], 0.005, 1e-12);
  EXPECT_EQ(settled(along, {0.0, 0.0, -30.0})[2], 0.01);
}

TEST(OutputLimits, EveryOutputKeepsForceAndSlew) {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  LimitState s;
  Vec3 last = Vec3::Zero();
  for (int k = 0; k < 100000; ++k) {
    const Vec3 u = update(limits, s, {20.0 * any(engine), 20.0 * any(engine), any(engine)},
                          {2.0 * any(engine), 2.0 * any(engine), 40.0 * any(engine)}, dt);
    ASSERT_LE(u.head<2>().norm(), 4.0 * (1 + 1e-12));
    ASSERT_LE(std::abs(u[2]), 0.1 * (1 + 1e-12));
    ASSERT_LE((u - last).head<2>().norm(), 0.4 * (1 + 1e-9));
    ASSERT_LE(std::abs(u[2] - last[2]), 0.01 * (1 + 1e-9));
    last = u;
  }
}

TEST(OutputLimits, ComeFromTheRig) {
  rig::Limits rig;
  rig.command_force_n = 4.0;
  rig.command_moment_nm = 0.1;
  rig.fault_speed_m_s = 1.0;
  rig.fault_angular_speed_rad_s = 20.0;
  const OutputLimits l = output_limits(rig);
  EXPECT_EQ(l.force_n, 4.0);
  EXPECT_DOUBLE_EQ(l.force_slew_n_per_s, 400.0);
  EXPECT_LT(l.full_speed_m_s, rig.fault_speed_m_s);
  EXPECT_LT(l.speed_m_s, l.full_speed_m_s);
  EXPECT_LT(l.full_angular_speed_rad_s, rig.fault_angular_speed_rad_s);
}

}  // namespace
}  // namespace trocar::control
