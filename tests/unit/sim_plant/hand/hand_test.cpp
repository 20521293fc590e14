#include "sim_plant/hand/hand.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace trocar::sim_plant {
namespace {

using Vector3 = Hand::Vector3;

constexpr double dt = 1e-4;
constexpr Vector3 home{0.01, 0.12, 1.5};

TEST(Hand, PullsByArmAndGripInSeries) {
  const HandConfig config;
  Hand hand(config, home);
  Vector3 goal = home;
  goal[0] += 0.02;
  goal[2] -= 0.3;
  hand.want({{0.0, home}, {0.5, goal}});
  for (int k = 0; k < 50'000; ++k) hand.advance(k * dt, home, {}, dt);
  const auto series = [](const ArmAxis& a) { return a.stiffness * a.grip_stiffness / (a.stiffness + a.grip_stiffness); };
  EXPECT_NEAR(hand.wrench()[0], 0.02 * series(config.translation), 1e-9);
  EXPECT_NEAR(hand.wrench()[1], 0.0, 1e-12);
  EXPECT_NEAR(hand.wrench()[2], -0.3 * series(config.rotation), 1e-9);
}

// What it feels like: force over motion of a shaken handle, against the closed form of the two in series.
TEST(Hand, HasTheImpedanceOfItsModel) {
  for (const double factor : {0.5, 1.0, 2.0})
    for (const double hz : {0.5, 2.0, 8.0, 30.0}) {
      const HandConfig config = scaled({}, factor);
      const ArmAxis& a = config.translation;
      Hand hand(config, home);
      const double w = 2.0 * std::numbers::pi * hz;
      constexpr double amplitude = 1e-3;
      std::complex<double> sum{};
      const int settle = static_cast<int>(5.0 / dt), cycles = static_cast<int>(std::round(4.0 / hz / dt));
      for (int k = 1; k <= settle + cycles; ++k) {
        const double t = k * dt;
        Vector3 pose = home;
        pose[1] += amplitude * std::sin(w * t);
        // The mean velocity of the step, as its integrator has it.
        const double before = amplitude * std::sin(w * (t - dt));
        const Vector3 f = hand.advance(t, pose, {0.0, (pose[1] - home[1] - before) / dt, 0.0}, dt);
        // The force belongs to the middle of the step.
        if (k > settle) sum += f[1] * std::polar(1.0, -w * (t - 0.5 * dt)) * 2.0 * dt / (cycles * dt);
      }
      const std::complex<double> s{0.0, w};
      const std::complex<double> arm = a.stiffness + s * a.damping + s * s * a.mass;
      const std::complex<double> grip = a.grip_stiffness + s * a.grip_damping;
      // sin is the imaginary part: force over motion = sum / (amplitude / i).
      const std::complex<double> felt = sum * std::complex<double>{0.0, 1.0} / amplitude;
      const std::complex<double> expected = -arm * grip / (arm + grip);
      EXPECT_LT(std::abs(felt - expected), 2e-3 * std::abs(expected)) << hz << " Hz, times " << factor;
    }
}

TEST(Hand, GivesNoMoreThanItCan) {
  HandConfig config;
  config.translation.largest = 12.0;
  Hand hand(config, home);
  Vector3 far = home;
  far[1] += 1.0;
  hand.want({{0.0, home}, {0.2, far}});
  double most = 0.0;
  for (int k = 0; k < 20'000; ++k) most = std::max(most, std::abs(hand.advance(k * dt, home, {}, dt)[1]));
  EXPECT_EQ(most, 12.0);
  EXPECT_TRUE(std::isfinite(hand.arm()[1]));
}

TEST(Hand, WantsAMinimumJerkWay) {
  Hand hand({}, home);
  Vector3 goal = home;
  goal[0] += 0.1;
  hand.want({{1.0, home}, {3.0, goal}});
  EXPECT_EQ(hand.wanted(0.5), home);
  EXPECT_EQ(hand.wanted(4.0), goal);
  EXPECT_NEAR(hand.wanted(2.0)[0], home[0] + 0.05, 1e-15);
  // Fastest in the middle: 15/8 of the mean speed.
  EXPECT_NEAR((hand.wanted(2.0 + 1e-5)[0] - hand.wanted(2.0 - 1e-5)[0]) / 2e-5, 1.875 * 0.05, 1e-8);
  EXPECT_NEAR((hand.wanted(1.0 + 1e-4)[0] - home[0]) / 1e-4, 0.0, 1e-8);
}

TEST(Hand, TremblesAtItsFrequencyAndStrength) {
  HandConfig config;
  config.translation.tremor = 0.2;
  config.translation.mass = 1e-9;  // so that the grip on a fixed handle shows the arm's force as it is
  config.translation.damping = 0.0;
  config.translation.stiffness = 0.0;
  Hand hand(config, home);
  double square = 0.0, before = 0.0;
  int turns = 0;
  constexpr int steps = 2'000'000;
  for (int k = 0; k < steps; ++k) {
    const double f = hand.advance(k * dt, home, {}, dt)[0];
    square += f * f;
    turns += before < 0.0 && f >= 0.0 ? 1 : 0;
    before = f;
  }
  EXPECT_NEAR(std::sqrt(square / steps), 0.2, 0.02);
  EXPECT_NEAR(turns / (steps * dt), 10.0, 0.5);
}

TEST(Hand, PlaysARecordingWhateverTheHandleDoes) {
  Hand hand({}, home);
  hand.replay({{0.1, {0.0, 2.0, 0.0}}, {0.2, {1.0, 4.0, 0.1}}});
  EXPECT_EQ(hand.advance(0.05, {0.5, 0.5, 0.5}, {9.0, 9.0, 9.0}, dt), Vector3{});
  EXPECT_EQ(hand.advance(0.1, {}, {}, dt), (Vector3{0.0, 2.0, 0.0}));
  const Vector3 between = hand.advance(0.15, home, {}, dt);
  EXPECT_NEAR(between[0], 0.5, 1e-14);
  EXPECT_NEAR(between[1], 3.0, 1e-14);
  EXPECT_EQ(hand.advance(0.21, home, {}, dt), Vector3{});
  hand.replay({});
  hand.let_go();
  EXPECT_EQ(hand.advance(0.3, {}, {}, dt), Vector3{});
}

TEST(Hand, ANewWantEndsAHabit) {
  Habit habit;
  habit.way = {{0.0, {}}, {1.0, {0.05, 0.0, 0.0}}};
  habit.period_s = 1.0;
  Hand hand({}, habit);
  hand.notice(true, 5.0, home);
  ASSERT_TRUE(hand.holds());
  hand.want({{6.0, home}, {7.0, {0.02, 0.12, 1.5}}, {8.0, {0.03, 0.12, 1.5}}});
  hand.notice(false, 6.0, home);
  EXPECT_TRUE(hand.holds());
  EXPECT_EQ(hand.wanted(7.0)[0], 0.02);
  EXPECT_EQ(hand.wanted(100.0)[0], 0.03);
}

// A handle that is thrown about in a resting hand gets no energy out of it but what is stored.
TEST(Hand, IsPassiveAroundRest) {
  Hand hand({}, home);
  double work = 0.0, most = 0.0;
  Vector3 pose = home;
  for (int k = 1; k <= 200'000; ++k) {
    const double t = k * dt;
    const double x = 0.02 * std::sin(7.0 * t) * std::sin(31.0 * t) + 0.003 * std::sin(190.0 * t);
    const double step = home[0] + x - pose[0];
    pose[0] = home[0] + x;
    work += hand.advance(t, pose, {step / dt, 0.0, 0.0}, dt)[0] * step;
    most = std::max(most, work);
  }
  EXPECT_LE(most, 1e-12);
  EXPECT_LT(work, -0.1);
}

TEST(Hand, SameSeedSameBits) {
  HandConfig config;
  config.translation.tremor = config.rotation.tremor = 0.1;
  Hand a(config, home), b(config, home);
  for (int k = 0; k < 1000; ++k) ASSERT_EQ(a.advance(k * dt, home, {}, dt), b.advance(k * dt, home, {}, dt));
  config.seed = 2;
  Hand c(config, home);
  for (int k = 0; k < 1000; ++k) c.advance(k * dt, home, {}, dt);
  EXPECT_NE(a.wrench(), c.wrench());
}

}  // namespace
}  // namespace trocar::sim_plant
