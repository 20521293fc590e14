#include "firmware/control/display.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::control {
namespace {

using mechanism::Vec3;
constexpr double dt = 1e-3;

TEST(Display, ImpedanceReturnsTheEnvironmentsForceAtTheMaster) {
  const DisplayConfig config;
  DisplayState state;
  enter(state, Display::Impedance, {0.01, 0.12, 0.3}, Vec3::Zero());
  for (int k = 0; k < 10; ++k) {
    const Vec3 pose(0.01 + 1e-4 * k, 0.12, 0.3);
    EXPECT_EQ(slave_pose(config, state, pose), pose);
    EXPECT_EQ(update(config, state, {pose, {0.1, 0, 0}, {9, 9, 9}, {1.0, -2.0, 0.05}, dt}), Vec3(-1.0, 2.0, -0.05));
  }
}

TEST(Display, AdmittanceMovesLikeItsMassUnderTheNetForce) {
  DisplayConfig config;
  config.admittance.slave.mass = {0.5, 0.5, 1e-3};
  DisplayState state;
  enter(state, Display::Admittance, Vec3::Zero(), Vec3::Zero());
  for (int k = 0; k < 500; ++k) (void)update(config, state, {Vec3::Zero(), Vec3::Zero(), {3.0, 0, 0}, {1.0, 0, 0}, dt});
  EXPECT_NEAR(state.slave.velocity[0], 2.0 / 0.5 * 0.5, 1e-12);
  EXPECT_NEAR(state.slave.pose[0], 0.5 * 4.0 * 0.25, 0.003 * 0.5);
}

TEST(Display, AdmittanceSettlesWithItsDamping) {
  DisplayConfig config;
  config.admittance.slave.damping[0] = 5.0;
  DisplayState state;
  enter(state, Display::Admittance, Vec3::Zero(), Vec3::Zero());
  for (int k = 0; k < 2000; ++k) (void)update(config, state, {Vec3::Zero(), Vec3::Zero(), {2.0, 0, 0}, Vec3::Zero(), dt});
  EXPECT_NEAR(state.slave.velocity[0], 0.4, 1e-9);
}

TEST(Display, AdmittanceCommandIsTheTrackingController) {
  DisplayConfig config;
  DisplayState state;
  enter(state, Display::Admittance, {0.01, 0, 0}, {0.2, 0, 0});
  const Vec3 f_m = update(config, state, {{0.008, 0, 0}, {0.1, 0, 0}, Vec3::Zero(), {7.0, 0, 0}, dt});
  EXPECT_NEAR(f_m[0], 400.0 * 0.002 + 30.0 * 0.1, 1e-12);  // f_e only through the slave
}

TEST(Display, EntersWithoutAnyCoupling) {
  const DisplayConfig config;
  const Vec3 pose(0.01, 0.12, 7.0), velocity(0.1, -0.2, 1.0);
  for (const Display d : {Display::Impedance, Display::Admittance, Display::FourChannel}) {
    DisplayState state;
    enter(state, d, pose, velocity);
    EXPECT_EQ(slave_pose(config, state, pose), pose);
    EXPECT_EQ(update(config, state, {pose, velocity, Vec3::Zero(), Vec3::Zero(), dt}), Vec3::Zero());
  }
}

// The environment may be a needle in tissue, with a history: its pose must not jump.
TEST(Display, EnvironmentsPoseDoesNotJumpWhenTheDisplayChanges) {
  const DisplayConfig config;
  for (const Display from : {Display::Impedance, Display::Admittance, Display::FourChannel})
    for (const Display to : {Display::Impedance, Display::Admittance, Display::FourChannel}) {
      DisplayState state;
      Vec3 pose(0.0, 0.12, 0.3);
      const Vec3 velocity(0.05, 0.0, 0.5);
      enter(state, from, pose, velocity);
      Vec3 last = slave_pose(config, state, pose);
      double away = 0.0;
      for (int k = 0; k < 2000; ++k) {
        if (k == 1000) change(config, state, to, pose, velocity);
        const Vec3 at = slave_pose(config, state, pose);
        EXPECT_LT((at - last).cwiseAbs().maxCoeff(), 1e-3) << k;  // 0.5 rad/s and what glides
        away = std::max(away, std::abs(at[0] - pose[0]));
        last = at;
        (void)update(config, state, {pose, velocity, {0.2, 0.0, 0.0}, {k < 100 ? 0.3 : 0.2, 0.0, 0.0}, dt});
        pose += dt * velocity;
      }
      if (to == Display::Impedance) {
        EXPECT_EQ(slave_pose(config, state, pose), pose);
      }
      if (from != Display::Impedance) {
        EXPECT_GT(away, 1e-4);  // there was something to glide
      }
    }
}

}  // namespace
}  // namespace trocar::control
