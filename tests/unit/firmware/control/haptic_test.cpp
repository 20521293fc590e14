#include "firmware/control/haptic.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/reference/haptic_axis/haptic_axis.hpp"

namespace trocar::control {
namespace {

using mechanism::Vec3;
using reference::AxisPlant;
using reference::Environment;
using reference::Hand;
using reference::HapticAxis;

constexpr Display displays[] = {Display::Impedance, Display::Admittance, Display::FourChannel};
constexpr double tau = 2.0 * 3.14159265358979323846;
constexpr double arm_m = 0.105;  // proximal link: what one count of a joint moves the handle by, about
constexpr OutputLimits wide{8.0, 0.1, 800.0, 10.0, 0.5, 0.9, 10.0, 18.0};

HapticConfig chain(const AxisPlant& plant) {
  HapticConfig config;
  config.limits = wide;
  config.impedance.device_mass = true;
  config.guard.delay_ticks = plant.delay_ticks;
  config.guard.step[0] = 1.001 * plant.encoder_step_m;
  return config;
}

std::string name(Display d) { return d == Display::Impedance ? "impedance" : d == Display::Admittance ? "admittance" : "four-channel"; }

// --- bumpless -------------------------------------------------------------------------------------------------------

// A hand that moves slowly about in soft tissue, no noise: the command's steps are those of the laws and their changes.
TEST(Haptic, EveryChangeOfDisplayIsBumpless) {
  double most = 0.0;
  for (const Display from : displays)
    for (const Display to : displays) {
      const AxisPlant plant;
      HapticAxis axis(plant, {0.1, 8.0, 600.0}, chain(plant), [](double x, double v) { return 300.0 * x + 2.0 * v; });
      axis.enter(from);
      double last = 0.0, worst = 0.0, at_change = 0.0;
      for (int k = 0; k < 4000; ++k) {
        const double t = 1e-3 * k, ramp = std::min(1.0, t / 1.0);
        const double r = 0.01 * ramp + 0.002 * std::sin(tau * 0.5 * t),
                     r_dot = (t < 1.0 ? 0.01 : 0.0) + 0.002 * tau * 0.5 * std::cos(tau * 0.5 * t);
        if (k == 2000) axis.change(to);
        axis.tick(r, r_dot, 0.0);
        const double step = std::abs(axis.command_n() - last);
        if (k == 2000) at_change = step;
        if (k >= 1990) worst = std::max(worst, step);
        last = axis.command_n();
      }
      EXPECT_LT(at_change, 1e-9) << name(from) << " to " << name(to);  // the first output is the last one
      EXPECT_LT(worst, 0.05) << name(from) << " to " << name(to);
      most = std::max(most, worst);
    }
  RecordProperty("largest_step_n", std::to_string(most));
}

TEST(Haptic, ComesFromPositionControlWithoutABump) {
  double most = 0.0;
  for (const Display to : displays)
    for (const bool device_mass : {true, false}) {
      const AxisPlant plant;
      HapticConfig config = chain(plant);
      config.impedance.device_mass = device_mass;
      HapticAxis axis(plant, {0.1, 8.0, 600.0}, config, [](double x, double) { return 300.0 * x; });
      // At rest at 1 cm: the motors hold 3 N against the hand.
      axis.state.x = 0.01;
      axis.state.force_seen = -3.0;
      const double r = 0.01 - 3.0 / 600.0;
      axis.enter(to, 3.0);
      double last = 3.0, worst = 0.0;
      for (int k = 0; k < 2000; ++k) {
        axis.tick(r, 0.0, 0.0);
        const double step = std::abs(axis.command_n() - last);
        if (k == 0) {
          EXPECT_LT(step, 1e-9) << name(to);
        }
        worst = std::max(worst, step);
        last = axis.command_n();
      }
      EXPECT_LT(worst, 0.05) << name(to) << ' ' << device_mass;
      most = std::max(most, worst);
    }
  RecordProperty("largest_step_n", std::to_string(most));
}

TEST(Haptic, AStepOfOutputIsWhatHappensWithoutTheFade) {  // the two tests above can fail
  const AxisPlant plant;
  HapticConfig config = chain(plant);
  config.fade.duration_s = 0.0;
  HapticAxis axis(plant, {0.1, 8.0, 600.0}, config, [](double x, double) { return 300.0 * x; });
  axis.state.x = 0.01;
  axis.enter(Display::Impedance, 3.0);
  axis.tick(0.005, 0.0, 0.0);
  EXPECT_GT(std::abs(axis.command_n() - 3.0), 0.5);
}

// --- stability at a stiff wall --------------------------------------------------------------------------------------

struct Outcome {
  double limit_cycle_n{};  // half the swing of the hand's force in the last 2 s
  double command_cycle_n{};
  double least_energy_j{};
  bool failed{};
};

// The hand comes at 0.1 m/s, meets a one-sided wall at x = 0 and leans on it.
Outcome lean_on(double wall_n_m, Display display, const AxisPlant& plant, const Hand& hand, double end_m, bool guarded) {
  HapticConfig config = chain(plant);
  config.guard.active = guarded;
  HapticAxis axis(plant, hand, config, [wall_n_m](double x, double) { return x > 0.0 ? wall_n_m * x : 0.0; });
  axis.state.x = -0.01;
  axis.enter(display);
  Outcome o;
  double low = 1e9, high = -1e9, command_low = 1e9, command_high = -1e9;
  const double arrival_s = (end_m + 0.01) / 0.1;
  for (int k = 0; k < 6000; ++k) {
    const double t = 1e-3 * k;
    axis.tick(std::min(-0.01 + 0.1 * t, end_m), t < arrival_s ? 0.1 : 0.0, 0.0);
    o.least_energy_j = std::min(o.least_energy_j, axis.haptic.guard.energy_j);
    o.failed = o.failed || failed(config.guard, axis.haptic.guard);
    if (k < 4000) continue;
    low = std::min(low, axis.state.hand_force);
    high = std::max(high, axis.state.hand_force);
    command_low = std::min(command_low, axis.command_n());
    command_high = std::max(command_high, axis.command_n());
  }
  o.limit_cycle_n = 0.5 * (high - low);
  o.command_cycle_n = 0.5 * (command_high - command_low);
  return o;
}

struct Worst {
  Outcome guarded, bare;
};

// One tick of delay as the drive bus has it, and 1 ms more; the hand halved and doubled; three depths.
Worst worst_at(double wall_n_m, Display display, int counts_per_turn) {
  Worst worst;
  for (const std::size_t delay : {1U, 2U})
    for (const double scale : {0.5, 1.0, 2.0})
      for (const double end_m : {0.006, 0.0075, 0.01}) {
        AxisPlant plant;
        plant.delay_ticks = delay;
        plant.encoder_step_m = tau / counts_per_turn * arm_m;
        const Hand hand{0.1 * scale, 4.0 * scale, 300.0 * scale};
        for (const bool guarded : {false, true}) {
          const Outcome o = lean_on(wall_n_m, display, plant, hand, end_m, guarded);
          Outcome& w = guarded ? worst.guarded : worst.bare;
          w.limit_cycle_n = std::max(w.limit_cycle_n, o.limit_cycle_n);
          w.command_cycle_n = std::max(w.command_cycle_n, o.command_cycle_n);
          w.least_energy_j = std::min(w.least_energy_j, o.least_energy_j);
          w.failed = w.failed || o.failed;
        }
      }
  return worst;
}

void expect_calm(const Worst& worst) {
  EXPECT_FALSE(worst.guarded.failed) << worst.guarded.least_energy_j;
  EXPECT_LT(worst.guarded.limit_cycle_n, 0.1);
  ::testing::Test::RecordProperty("limit_cycle_n", std::to_string(worst.guarded.limit_cycle_n));
  ::testing::Test::RecordProperty("command_cycle_n", std::to_string(worst.guarded.command_cycle_n));
  ::testing::Test::RecordProperty("least_energy_mj", std::to_string(1e3 * worst.guarded.least_energy_j));
  ::testing::Test::RecordProperty("bare_limit_cycle_n", std::to_string(worst.bare.limit_cycle_n));
  ::testing::Test::RecordProperty("bare_least_energy_mj", std::to_string(1e3 * worst.bare.least_energy_j));
}

// Encoder of 4,000 counts: 0.165 mm a count at the handle. A wall of 1 kN/m then chatters by up to 0.08 N of command.
class CoarseEncoder : public ::testing::TestWithParam<Display> {};
TEST_P(CoarseEncoder, GuardKeepsAWallOf1kNmCalm) {
  const Worst worst = worst_at(1000.0, GetParam(), 4000);
  expect_calm(worst);
  EXPECT_TRUE(worst.bare.failed);
  EXPECT_GT(worst.bare.limit_cycle_n, 0.1);  // without the guard it is not
}
INSTANTIATE_TEST_SUITE_P(Displays, CoarseEncoder, ::testing::Values(Display::Impedance, Display::FourChannel),
                         [](const auto& p) { return p.param == Display::Impedance ? "Impedance" : "FourChannel"; });

// The haptic rig's encoder: 4,000 lines, 16,000 counts.
class RigEncoder : public ::testing::TestWithParam<std::pair<Display, double>> {};
TEST_P(RigEncoder, GuardKeepsTheWallCalm) {
  const auto [display, wall] = GetParam();
  expect_calm(worst_at(wall, display, 16000));
}
INSTANTIATE_TEST_SUITE_P(DisplaysAndWalls, RigEncoder,
                         ::testing::Values(std::pair{Display::Impedance, 500.0}, std::pair{Display::Impedance, 1000.0},
                                           std::pair{Display::Impedance, 2000.0}, std::pair{Display::Admittance, 500.0},
                                           std::pair{Display::Admittance, 1000.0}, std::pair{Display::Admittance, 2000.0},
                                           std::pair{Display::FourChannel, 500.0}, std::pair{Display::FourChannel, 1000.0},
                                           std::pair{Display::FourChannel, 2000.0}));

// --- the chain ------------------------------------------------------------------------------------------------------

TEST(Haptic, LimitsComeAfterTheGuardAndTheGuardKnowsThem) {
  const AxisPlant plant;
  HapticConfig config = chain(plant);
  config.limits.force_n = 1.0;
  HapticAxis axis(plant, {0.1, 8.0, 600.0}, config, [](double x, double) { return 500.0 * x; });
  axis.enter(Display::Impedance);
  for (int k = 0; k < 1000; ++k) {
    axis.tick(0.02, 0.0, 0.0);
    EXPECT_LE(std::abs(axis.command_n()), 1.0 + 1e-12);
    EXPECT_NEAR(axis.haptic.f_m[0], axis.command_n(), 1e-12);  // device_mass, no stiffness: the port sees what was sent
    EXPECT_EQ(axis.haptic.guard.sent[0], axis.haptic.f_m);
  }
}

TEST(Haptic, FreeSpaceIsFree) {
  // No environment, a steady push: the hand feels the mass of the device and nothing more.
  for (const Display d : {Display::Impedance, Display::FourChannel}) {
    AxisPlant plant;
    plant.coulomb_n = plant.viscous_n_s_m = 0.0;
    HapticAxis axis(plant, {0.0, 0.0, 0.0}, chain(plant), [](double, double) { return 0.0; });
    axis.enter(d);
    for (int k = 0; k < 500; ++k) axis.tick(0.0, 0.0, 0.2);
    const double mass = 0.2 * 0.5 / axis.state.v;
    EXPECT_NEAR(mass, plant.mass_kg, 0.03 * plant.mass_kg) << name(d);
  }
}

}  // namespace
}  // namespace trocar::control
