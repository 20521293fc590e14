// A single mass against closed forms: x = (a + d) t^2 / 2.
#include "firmware/control/disturbance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "firmware/control/friction.hpp"

namespace trocar::control {
namespace {

constexpr double a = 3.0, d = -2.0;  // m/s^2: known, unknown

struct Case {
  double bandwidth_rad_s, dt_s;
};

class SingleMass : public ::testing::TestWithParam<Case> {
 protected:
  const double w = GetParam().bandwidth_rad_s, dt = GetParam().dt_s, angle = w * dt / std::numbers::sqrt2, size = std::exp(-angle);
  const DisturbanceGains gains = disturbance_gains(w, dt);

  const int settled = static_cast<int>(60.0 / (w * dt)) + 20;
};

TEST_P(SingleMass, AnswersAStepOfForceAsTheClosedFormSays) {
  DisturbanceState s;
  (void)update(gains, s, 0.0, 0.0);
  const double sampled = std::sinh(angle) / std::sin(angle);
  for (int n = 1; n <= settled; ++n) {
    const double t = n * dt;
    const DisturbanceEstimate found = update(gains, s, 0.5 * (a + d) * t * t, a);
    ASSERT_NEAR(found.acceleration, d * (1.0 - std::exp(-n * angle) * (std::cos(n * angle) + sampled * std::sin(n * angle))), 1e-7) << n;
  }
}

TEST_P(SingleMass, IsExactInSteadyStateWhateverTheTick) {
  DisturbanceState s;
  (void)update(gains, s, 0.0, 0.0);
  DisturbanceEstimate found;
  for (int n = 1; n <= settled; ++n) found = update(gains, s, 0.5 * (a + d) * n * dt * n * dt, a);
  EXPECT_NEAR(found.acceleration, d, 1e-7);
  EXPECT_NEAR(found.velocity, (a + d) * settled * dt, 1e-9);
  // d = k_p e with the measured position ahead on the side to which the force pushes.
  EXPECT_NEAR(found.error * (1.0 - 2.0 * size * std::cos(angle) + size * size) / (dt * dt), d, 1e-7);
  EXPECT_LT(found.error, 0.0);
}

TEST_P(SingleMass, ReadsNoForceAtConstantSpeed) {
  DisturbanceState s;
  DisturbanceEstimate found;
  for (int n = 0; n <= settled; ++n) found = update(gains, s, 0.1 * n * dt, 0.0);
  EXPECT_NEAR(found.acceleration, 0.0, 1e-7);
  EXPECT_NEAR(found.velocity, 0.1, 1e-9);
}

TEST_P(SingleMass, ForgetsAnErrorWithThePolesOfTheMatrixExponential) {
  DisturbanceState s{0.01, -0.7, true};
  double e2 = update(gains, s, 0.0, 0.0).error;
  double e1 = update(gains, s, 0.0, 0.0).error;
  for (int n = 0; n < 50; ++n) {
    const double e = update(gains, s, 0.0, 0.0).error;
    ASSERT_NEAR(e, 2.0 * size * std::cos(angle) * e1 - size * size * e2, 1e-15);
    e2 = e1;
    e1 = e;
  }
}

INSTANTIATE_TEST_SUITE_P(BandwidthsAndTicks, SingleMass,
                         ::testing::Values(Case{50.0, 1e-3}, Case{390.0, 1e-3}, Case{1000.0, 1e-3}, Case{390.0, 2.5e-4}, Case{390.0, 4e-3},
                                           Case{1900.0, 1e-3}));

TEST(SingleMassResponse, ApproachesTheContinuousObserverAsTheTickShrinks) {
  const double w = 390.0, dt = 1e-5;
  const DisturbanceGains gains = disturbance_gains(w, dt);
  DisturbanceState s;
  (void)update(gains, s, 0.0, 0.0);
  for (int n = 1; n <= 3000; ++n) {
    const double t = n * dt;
    const double c = w * t / std::numbers::sqrt2;
    // (w dt)^2/6 of the transient's sine is left.
    ASSERT_NEAR(update(gains, s, 0.5 * t * t, 0.0).acceleration, 1.0 - std::exp(-c) * (std::cos(c) + std::sin(c)), 2e-6);
  }
}

TEST(SingleMassResponse, TakesNoLongerToNinetyPerCentThanItsBandwidthSays) {
  const auto ninety = [](double w, double dt) {
    const DisturbanceGains gains = disturbance_gains(w, dt);
    DisturbanceState s;
    (void)update(gains, s, 0.0, 0.0);
    for (int n = 1;; ++n)
      if (update(gains, s, 0.5 * n * dt * n * dt, 0.0).acceleration >= 0.9) return n * dt;
  };
  EXPECT_NEAR(ninety(400.0, 1e-5), 2.65348 / 400.0, 1e-5);
  EXPECT_NEAR(ninety(300.0, 1e-3), 0.009, 1e-9);
  EXPECT_NEAR(ninety(400.0, 1e-3), 0.007, 1e-9);
}

// A force that swings at the bandwidth comes through at 1/sqrt(2).
TEST(SingleMassResponse, IsThreeDecibelsDownAtItsBandwidth) {
  const double w = 390.0, dt = 1e-5;
  const DisturbanceGains gains = disturbance_gains(w, dt);
  DisturbanceState s{0.0, -1.0 / w, true};
  double most = 0.0;
  for (int n = 1; n < 10000; ++n) {
    const double found = update(gains, s, -std::sin(w * n * dt) / (w * w), 0.0).acceleration;
    if (n > 8000) most = std::max(most, found);
  }
  EXPECT_NEAR(most, 1.0 / std::numbers::sqrt2, 1e-4);
}

TEST(SingleMassResponse, TakesTicksOfAnyLength) {
  const double w = 390.0;
  DisturbanceState s{0.0, 0.1, true};
  double t = 0.0;
  for (int n = 0; n < 40; ++n) {
    const double dt = 1e-3 * (1.0 + 0.5 * std::sin(n));
    t += dt;
    const DisturbanceEstimate found = update(disturbance_gains(w, dt), s, 0.1 * t, 0.0);
    ASSERT_NEAR(found.acceleration, 0.0, 1e-8);
    ASSERT_NEAR(found.velocity, 0.1, 1e-11);
  }
}

TEST(Friction, IsOddSmoothAndReachesCoulombAndViscous) {
  const JointFriction f{0.015, 0.002, 0.1};
  EXPECT_EQ(friction_torque_nm(f, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(friction_torque_nm(f, -0.07), -friction_torque_nm(f, 0.07));
  EXPECT_NEAR(friction_torque_nm(f, 5.0), 0.015 + 0.01, 1e-12);
  EXPECT_NEAR(friction_torque_nm(f, 1e-6) / 1e-6, friction_slope_nm_s(f), 1e-9);
}

TEST(Friction, WithoutCoulombNeedsNoSmoothing) {
  const JointFriction f{0.0, 0.002, 0.0};
  EXPECT_DOUBLE_EQ(friction_torque_nm(f, 3.0), 0.006);
  EXPECT_DOUBLE_EQ(friction_slope_nm_s(f), 0.002);
}

}  // namespace
}  // namespace trocar::control
