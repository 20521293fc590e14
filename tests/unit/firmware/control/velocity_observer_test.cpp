#include "firmware/control/velocity_observer.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::control {
namespace {

constexpr double dt = 0.001;
constexpr double steps_of_decay = 45.0;

class VelocityObserver : public ::testing::TestWithParam<double> {};  // w dt

TEST_P(VelocityObserver, IsExactOnASteadyRamp) {
  const VelocityObserverConfig config{GetParam() / dt};
  VelocityObserverState s;
  double v = 0.0;
  const int n = static_cast<int>(steps_of_decay / GetParam()) + 50;
  for (int i = 0; i < n; ++i) v = update(config, s, 0.02 - 0.037 * i * dt, dt);
  EXPECT_NEAR(v, -0.037, 1e-8);
}

TEST_P(VelocityObserver, ReadsZeroAtRestFromTheFirstValueOn) {
  const VelocityObserverConfig config{GetParam() / dt};
  VelocityObserverState s;
  for (int i = 0; i < 100; ++i) EXPECT_EQ(update(config, s, 0.15, dt), 0.0);
}

TEST_P(VelocityObserver, SettlesAfterAStep) {
  const VelocityObserverConfig config{GetParam() / dt};
  VelocityObserverState s;
  (void)update(config, s, 0.0, dt);
  const int n = static_cast<int>(steps_of_decay / GetParam()) + 50;
  double v = 0.0;
  double most = 0.0;
  for (int i = 0; i < n; ++i) {
    v = update(config, s, 0.001, dt);
    most = std::max(most, std::abs(v));
  }
  EXPECT_NEAR(v, 0.0, 1e-10);
  EXPECT_NEAR(s.position, 0.001, 1e-12);
  EXPECT_LE(most, 1.01 * 0.001 / dt);  // never beyond what a difference of two positions would say
}

INSTANTIATE_TEST_SUITE_P(Bandwidths, VelocityObserver, ::testing::Values(0.01, 0.1, 0.3, 1.0, 5.0, 20.0));

TEST(VelocityObserverResponse, FollowsTheContinuousOneForAStepOfVelocity) {
  // Double pole at -w: v_hat = v (1 - (1 + w t) exp(-w t)).
  const double w = 20.0;
  const VelocityObserverConfig config{w};
  VelocityObserverState s;
  (void)update(config, s, 0.0, dt);
  for (int i = 1; i <= 300; ++i) {
    const double t = i * dt;
    EXPECT_NEAR(update(config, s, 0.1 * t, dt), 0.1 * (1 - (1 + w * t) * std::exp(-w * t)), 0.1 * w * dt);
  }
}

TEST(VelocityObserverResponse, OneCountDisturbsByTheBandwidthOverE) {
  const double w = 300.0;
  VelocityObserverState s;
  (void)update({w}, s, 0.0, dt);
  double most = 0.0;
  for (int i = 0; i < 100; ++i) most = std::max(most, update({w}, s, 40e-6, dt));
  EXPECT_NEAR(most, 40e-6 * w / std::exp(1.0), 0.1 * 40e-6 * w / std::exp(1.0));
}

}  // namespace
}  // namespace trocar::control
