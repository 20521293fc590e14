#include "sim_plant/mechanism/joint_friction.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::sim_plant {
namespace {

constexpr JointFrictionConfig joint{0.015, 0.002, 60.0, 0.01};
constexpr double inertia = 1e-3;
constexpr double dt = 1e-4;

// One free joint under a torque, stepped as the body does it.
struct Joint {
  void step(double torque) {
    const LinearFriction f = linearise(joint, friction, velocity + 0.5 * dt * acceleration, dt);
    const double next = ((inertia / dt - 0.5 * f.slope_nm_s) * velocity + torque - f.offset_nm) / (inertia / dt + 0.5 * f.slope_nm_s);
    const double mean = 0.5 * (velocity + next);
    angle += dt * mean;
    work += torque * mean * dt;
    friction = update(joint, friction, mean, dt);
    acceleration = (next - velocity) / dt;
    velocity = next;
  }
  double angle{}, velocity{}, acceleration{}, work{};
  JointFrictionState friction{};
};

TEST(JointFriction, HoldsBelowTheCoulombTorqueForAsLongAsItTakes) {
  Joint held;
  for (int i = 0; i < 20000; ++i) held.step(0.010);
  const double after_two_seconds = held.angle;
  EXPECT_NEAR(held.friction.bristle_rad, 0.010 / 60.0, 1e-9);
  for (int i = 0; i < 100000; ++i) held.step(0.010);
  EXPECT_NEAR(held.angle, after_two_seconds, 1e-9);  // no creep
  EXPECT_LT(held.angle, 0.001);

  // Nor under vibration that stays below breaking loose, where a plain Dahl bristle drifts.
  for (int i = 0; i < 100000; ++i) held.step(0.010 + 0.001 * std::sin(0.05 * i));
  EXPECT_NEAR(held.angle, after_two_seconds, 0.002 / 60.0);
}

TEST(JointFriction, SlidesAgainstCoulombAndViscousTorque) {
  Joint sliding;
  for (int i = 0; i < 100000; ++i) sliding.step(0.025);
  EXPECT_NEAR(sliding.velocity, (0.025 - 0.015) / 0.002, 1e-6);
  for (int i = 0; i < 200000; ++i) sliding.step(-0.025);
  EXPECT_NEAR(sliding.velocity, -(0.025 - 0.015) / 0.002, 1e-6);
}

TEST(JointFriction, ComesToRestAndStaysThere) {
  Joint thrown;
  thrown.velocity = 5.0;
  for (int i = 0; i < 20000; ++i) thrown.step(0.0);
  const double stopped_at = thrown.angle;
  // Against Coulomb torque alone it would run v^2 J / 2 g; viscous drag shortens that.
  EXPECT_LT(stopped_at, 5.0 * 5.0 * inertia / (2 * 0.015));
  EXPECT_GT(stopped_at, 0.5 * 5.0 * 5.0 * inertia / (2 * 0.015));
  for (int i = 0; i < 20000; ++i) thrown.step(0.0);
  EXPECT_NEAR(thrown.angle, stopped_at, 1e-8);
}

TEST(JointFriction, TakesEnergyOverEveryCycle) {
  Joint driven;
  double before = 0.0;
  for (int cycle = 0; cycle < 5; ++cycle) {
    for (int i = 0; i < 2000; ++i) driven.step(0.03 * std::sin(2 * 3.14159265358979 * i / 2000.0));
    EXPECT_GT(driven.work, before);
    before = driven.work;
  }
}

TEST(JointFriction, BristleFollowsItsClosedForm) {
  JointFrictionState state;
  for (int i = 0; i < 30; ++i) state = update(joint, state, 0.5, 1e-5);
  const double most = 0.015 / 60.0;
  EXPECT_NEAR(state.bristle_rad, 0.5 * 30e-5, 1e-15);  // bending
  for (int i = 0; i < 30; ++i) state = update(joint, state, 0.5, 1e-5);
  EXPECT_NEAR(state.bristle_rad, most * (1.0 - 0.2 * std::exp(-(0.5 * 60e-5 / most - 0.8) / 0.2)), 1e-15);  // sliding
  const JointFrictionConfig none{0.0, 0.002, 0.0, 0.0};
  EXPECT_EQ(update(none, {}, 3.0, 1e-4).bristle_rad, 0.0);
  EXPECT_EQ(linearise(none, {}, 3.0, 1e-4).slope_nm_s, 0.002);
}

}  // namespace
}  // namespace trocar::sim_plant
