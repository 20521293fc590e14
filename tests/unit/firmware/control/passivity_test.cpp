#include "firmware/control/passivity.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "firmware/control/hysteresis.hpp"

namespace trocar::control {
namespace {

using mechanism::Vec3;
constexpr double dt = 1e-3;

PassivityConfig observer(std::size_t delay) {
  PassivityConfig config;
  config.active = false;
  config.delay_ticks = delay;
  config.credit_j = 1e9;
  config.initial_j = 0.0;
  return config;
}

PassivityConfig empty() {
  PassivityConfig config;
  config.delay_ticks = 0;
  config.initial_j = 0.0;
  return config;
}

TEST(Passivity, EnergyIsTheWorkOfWhatWasSentOverTheMotionThatFollowed) {
  for (const std::size_t delay : {0U, 1U, 2U, 3U}) {
    const PassivityConfig config = observer(delay);
    PassivityState s;
    Vec3 x(0.01, -0.02, 0.3);
    std::vector<Vec3> sent_forces;
    double work = 0.0;
    for (std::size_t k = 0; k < 200; ++k) {
      const double p = 0.05 * static_cast<double>(k);
      const Vec3 f(std::sin(p), 2.0 * std::cos(2.0 * p), 0.1 * std::sin(3.0 * p));
      (void)update(config, s, x, f, dt);
      EXPECT_NEAR(s.energy_j, -work, 1e-14);
      const Vec3 less = 0.9 * f;  // a limit acted
      sent(s, less);
      sent_forces.push_back(less);
      const Vec3 step(1e-4 * std::cos(p), 2e-4 * std::sin(p), 1e-3 * std::cos(2.0 * p));
      if (k >= delay) work += sent_forces[k - delay].dot(step);
      x += step;
    }
  }
}

// A sampled spring with a delay gives out more than it takes: over a sine of amplitude A and frequency w, pi K A^2 sin(w (T/2 + d))
// a period.
TEST(Passivity, SeesTheEnergyThatSamplingAndDelayMake) {
  const double stiffness = 1000.0, amplitude = 1e-3;
  const int per_period = 100;
  const double angle = 2.0 * 3.14159265358979323846 / per_period;
  for (const std::size_t delay : {0U, 1U, 2U}) {
    const PassivityConfig config = observer(delay);
    PassivityState s;
    for (int k = 0; k <= 10 * per_period; ++k) {
      const double x = amplitude * std::sin(angle * k);
      (void)update(config, s, {x, 0, 0}, {-stiffness * x, 0, 0}, dt);
      sent(s, {-stiffness * x, 0, 0});
    }
    const double a_period =
        3.14159265358979323846 * stiffness * amplitude * amplitude * std::sin(angle * (0.5 + static_cast<double>(delay)));
    EXPECT_NEAR(s.energy_j, -10.0 * a_period, 0.02 * 10.0 * a_period);
  }
}

TEST(Passivity, AddsExactlyTheDampingThatBalancesTheForecast) {
  PassivityConfig config = empty();
  config.damping_n_s_m = 1000.0;
  PassivityState s;
  (void)update(config, s, Vec3::Zero(), Vec3::Zero(), dt);
  sent(s, Vec3::Zero());
  // Motion along +x under a force along +x: the display would give out f v dt from an empty store.
  const Vec3 f(2.0, 0.0, 0.0);
  const Vec3 out = update(config, s, {1e-4, 0, 0}, f, dt);
  EXPECT_NEAR(out[0], 0.0, 1e-12);
  EXPECT_EQ(s.limited, 0U);
  EXPECT_EQ(s.acted, 1U);
}

TEST(Passivity, DampingIsBounded) {
  PassivityConfig config = empty();
  PassivityState s;
  (void)update(config, s, Vec3::Zero(), Vec3::Zero(), dt);
  sent(s, {5.0, 0.0, 0.0});
  (void)update(config, s, {1e-3, 0, 0}, Vec3::Zero(), dt);  // 5 mJ given out
  EXPECT_NEAR(s.energy_j, -5e-3, 1e-15);
  EXPECT_EQ(s.damping_n_s_m, config.damping_n_s_m);
  EXPECT_EQ(s.limited, 1U);
  EXPECT_FALSE(failed(config, s));
  sent(s, {10.0, 0.0, 0.0});
  (void)update(config, s, {2e-3, 0, 0}, Vec3::Zero(), dt);
  EXPECT_TRUE(failed(config, s));
}

TEST(Passivity, DampsRotationByTheArm) {
  PassivityConfig config = empty();
  PassivityState s;
  (void)update(config, s, Vec3::Zero(), Vec3::Zero(), dt);
  sent(s, {0.0, 0.0, 0.1});
  const Vec3 out = update(config, s, {0.0, 0.0, 0.01}, Vec3::Zero(), dt);
  EXPECT_EQ(out[0], 0.0);
  EXPECT_LT(out[2], 0.0);
  EXPECT_GT(out[2], -config.damping_n_s_m * config.arm_m * config.arm_m * 0.01 / dt);
}

TEST(Passivity, LeavesAPassiveDisplayAlone) {
  PassivityConfig config = empty();
  PassivityState s;
  double x = 0.0, v = 0.1;
  for (int k = 0; k < 2000; ++k) {  // a damper, exactly as sampled
    const Vec3 f(-2.0 * v, 0.0, 0.0);
    EXPECT_EQ(update(config, s, {x, 0, 0}, f, dt), f);
    sent(s, f);
    x += dt * v;
    v = 0.1 * std::cos(0.01 * k);
  }
  EXPECT_EQ(s.acted, 0U);
  const double cap = config.credit_j + 0.2 * 0.2 / (2.0 * config.softest_n_m);
  EXPECT_GT(s.energy_j, 0.9 * config.credit_j);
  EXPECT_LE(s.energy_j, cap);
}

// After any amount of dissipation: a tissue no softer than `softest` is pressed slowly and gives back what it holds, undamped.
TEST(Passivity, CapLetsTheEnvironmentGiveBackWhatItHolds) {
  for (const double stiffness : {50.0, 300.0, 2000.0}) {
    PassivityConfig config = empty();
    config.delay_ticks = 1;
    config.initial_j = 1.0;
    PassivityState s;
    const double depth = 4.0 / stiffness;
    for (int k = 0; k < 4000; ++k) {
      const double x = depth * 0.5 * (1.0 - std::cos(2.0 * 3.14159265358979323846 * k / 4000.0));
      const Vec3 f(-stiffness * x, 0.0, 0.0);
      EXPECT_EQ(update(config, s, {x, 0, 0}, f, dt), f) << k;
      sent(s, f);
    }
    EXPECT_GE(s.energy_j, 0.0);
  }
}

TEST(Passivity, TotalCountsOverTheAxes) {
  // Takes along x what it gives along y: passive as a whole.
  PassivityConfig config = empty();
  PassivityState s;
  for (int k = 0; k < 100; ++k) {
    const Vec3 f(-1.0, 0.9, 0.0);
    EXPECT_EQ(update(config, s, {1e-4 * k, 1e-4 * k, 0.0}, f, dt), f);
    sent(s, f);
  }
}

TEST(Passivity, DoesNotCountTheChatterOfOneCount) {
  const double count = 1e-4;
  PassivityConfig config = empty();
  config.step.setConstant(1.001 * count);
  PassivityState s;
  for (int k = 0; k < 1001; ++k) {  // each flip up under +1 N, each flip down under -1 N: 0.08 J if it were motion
    const Vec3 f(k < 200 ? 0.0 : k % 2 == 0 ? 1.0 : -1.0, 0.0, 0.0);
    const Vec3 out = update(config, s, {k % 2 == 0 ? 0.0 : count, 0.0, 0.0}, f, dt);
    EXPECT_EQ(out, f);
    sent(s, out);
  }
  EXPECT_EQ(s.energy_j, 0.0);
  // And counts it all once it is motion.
  PassivityState moving;
  for (int k = 0; k < 11; ++k) {
    (void)update(config, moving, {count * k, 0.0, 0.0}, Vec3::Zero(), dt);
    sent(moving, {1.0, 0.0, 0.0});
  }
  EXPECT_NEAR(moving.energy_j, -10.0 * count, 1e-15);
}

TEST(Passivity, NotANumberIsAFailure) {
  const PassivityConfig config;
  PassivityState s;
  for (int k = 0; k < 5; ++k) {
    (void)update(config, s, {1e-4 * k, 0, 0}, {std::nan(""), 0, 0}, dt);
    sent(s, {std::nan(""), 0, 0});
  }
  EXPECT_TRUE(failed(config, s));
  reset(s);
  EXPECT_FALSE(failed(config, s));
}

TEST(Hysteresis, HoldsWithinHalfAStepAndFollowsBeyond) {
  double held = 0.0;
  for (const double x : {0.4, -0.4, 0.5, 0.0}) {
    held = hysteresis(held, x, 1.0);
    EXPECT_EQ(held, 0.0);
  }
  held = hysteresis(held, 3.0, 1.0);
  EXPECT_EQ(held, 2.5);
  EXPECT_EQ(hysteresis(held, 2.0, 1.0), 2.5);
  EXPECT_EQ(hysteresis(held, 1.0, 1.0), 1.5);
  EXPECT_EQ(hysteresis(held, 1.0, 0.0), 1.0);
}

}  // namespace
}  // namespace trocar::control
