#include "sim_plant/mechanism/twin_body.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "sim_plant/mechanism/imperfection.hpp"

namespace trocar::sim_plant {
namespace {

using Vec3 = TwinBody::Vec3;
using Vec4 = TwinBody::Vec4;

mechanism::TwinModel twin() {
  mechanism::TwinModel model;
  for (mechanism::FiveBarModel& linkage : model.linkage) {
    linkage.base_m = 0.08;
    for (mechanism::Link& link : linkage.proximal) link = {0.105, 0.024, 0.048, 5.4e-5};
    for (mechanism::Link& link : linkage.distal) link = {0.155, 0.020, 0.074, 8.3e-5};
    linkage.end_point_mass_kg = 0.02;
    linkage.reflected_inertia_kg_m2 = {4e-4, 4e-4};
  }
  model.coupling_m = 0.05;
  model.handle_m = 0.025;
  model.handle_mass_kg = 0.15;
  model.handle_com_m = 0.025;
  model.handle_inertia_kg_m2 = 1e-4;
  return model;
}

TwinBodyConfig frictionless() {
  TwinBodyConfig config;
  config.model = twin();
  config.stop = {{-0.055, 0.055}, {0.095, 0.205}, 5e4, 150.0, 0.2};
  return config;
}

TwinBodyConfig rubbing() {
  TwinBodyConfig config = frictionless();
  config.friction.fill({0.015, 0.002, 60.0, 0.01});
  return config;
}

TwinBody at(const TwinBodyConfig& config, const Vec3& pose) {
  TwinBody body(config);
  EXPECT_EQ(body.place(pose), mechanism::Status::Ok);
  return body;
}

const Vec3 centre(0.0, 0.15, 0.5 * std::numbers::pi);

// A conservative spring to the centre keeps the handle in its workspace.
const Vec3 spring_stiffness(100.0, 100.0, 0.05);
Vec3 spring(const Vec3& pose) { return -spring_stiffness.cwiseProduct(pose - centre); }
double spring_energy(const Vec3& pose) { return 0.5 * (pose - centre).dot(spring_stiffness.cwiseProduct(pose - centre)); }

Vec3 swing(double step_s, double duration_s, double* worst_energy_error = nullptr) {
  TwinBody body = at(frictionless(), {0.03, 0.17, 1.2});
  body.set_velocity({0.2, -0.3, 4.0});
  const double energy = body.kinetic_energy_j() + spring_energy(body.pose());
  const int steps = static_cast<int>(std::lround(duration_s / step_s));
  for (int i = 0; i < steps; ++i) {
    body.step(Vec4::Zero(), spring(body.middle(step_s)), step_s);
    if (worst_energy_error != nullptr)
      *worst_energy_error = std::max(*worst_energy_error, std::abs(body.kinetic_energy_j() + spring_energy(body.pose()) - energy) / energy);
  }
  EXPECT_EQ(body.counters().caught, 0u);
  EXPECT_EQ(body.counters().stopped, 0u);
  return body.pose();
}

TEST(TwinBody, KeepsItsEnergyWithoutFriction) {
  double error = 0.0;
  (void)swing(1e-4, 5.0, &error);
  EXPECT_LT(error, 1e-5);
  EXPECT_GT(error, 1e-12);  // the scheme is not exact, and the test sees it
}

TEST(TwinBody, ConvergesWithTheSquareOfTheStep) {
  const Vec3 reference = swing(1e-5, 1.0);
  const double coarse = (swing(4e-4, 1.0) - reference).norm();
  const double middle = (swing(2e-4, 1.0) - reference).norm();
  const double fine = (swing(1e-4, 1.0) - reference).norm();
  EXPECT_NEAR(coarse / middle, 4.0, 0.3);
  EXPECT_NEAR(middle / fine, 4.0, 0.3);
  EXPECT_LT(fine, 1e-4);
}

TEST(TwinBody, AcceleratesTheWayItIsPushed) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    TwinBody body = at(frictionless(), centre);
    const Vec3 push = (axis < 2 ? 1.0 : 0.02) * Vec3::Unit(axis);
    for (int i = 0; i < 100; ++i) body.step(Vec4::Zero(), push, 1e-4);
    EXPECT_GT((body.pose() - centre)(axis), 0.0);
    // Work of the push is what moves now.
    EXPECT_NEAR(push.dot(body.pose() - centre), body.kinetic_energy_j(), 1e-3 * body.kinetic_energy_j());
  }
}

TEST(TwinBody, JointTorqueActsThroughTheMechanism) {
  TwinBody body = at(frictionless(), {0.01, 0.14, 1.0});
  mechanism::TwinState state;
  ASSERT_EQ(mechanism::at_pose(body.model(), body.pose(), Vec4::Zero(), state), mechanism::Status::Ok);
  mechanism::Mat43 map;
  ASSERT_EQ(mechanism::velocity_map(body.model(), state, map), mechanism::Status::Ok);
  const Vec4 torque(0.1, -0.05, 0.02, 0.07);
  for (int i = 0; i < 1000; ++i) body.step(torque, -map.transpose() * torque, 1e-4);
  EXPECT_LT((body.pose() - Vec3(0.01, 0.14, 1.0)).norm(), 1e-9);
}

TEST(TwinBody, FrictionHoldsTheHandleAgainstASmallPush) {
  TwinBody body = at(rubbing(), centre);
  for (int i = 0; i < 40000; ++i) body.step(Vec4::Zero(), {0.1, 0.0, 0.0}, 1e-4);
  const Vec3 held = body.pose();
  EXPECT_LT((held - centre).norm(), 0.002);
  for (int i = 0; i < 20000; ++i) body.step(Vec4::Zero(), {0.1, 0.0, 0.0}, 1e-4);
  EXPECT_LT((body.pose() - held).norm(), 1e-7);
  for (int i = 0; i < 5000; ++i) body.step(Vec4::Zero(), {2.0, 0.0, 0.0}, 1e-4);
  EXPECT_GT(body.pose()(0), 0.02);
}

TEST(TwinBody, FrictionOnlyEverTakesEnergy) {
  TwinBody body = at(rubbing(), {0.03, 0.17, 1.2});
  body.set_velocity({0.2, -0.3, 4.0});
  double energy = body.kinetic_energy_j() + spring_energy(body.pose());
  // over 10 ms, because bristles store a little (15 uJ each when bent)
  for (int k = 0; k < 300; ++k) {
    for (int i = 0; i < 100; ++i) body.step(Vec4::Zero(), spring(body.middle(1e-4)), 1e-4);
    const double now = body.kinetic_energy_j() + spring_energy(body.pose());
    EXPECT_LT(now, energy + 4 * 0.5 * 0.015 * 0.015 / 60.0);
    energy = now;
  }
  EXPECT_LT(body.velocity().norm(), 1e-3);
}

TEST(TwinBody, StopsHoldTheHandleInTheirBox) {
  for (const Vec3& push : {Vec3(30, 0, 0), Vec3(-30, 0, 0), Vec3(0, 30, 0), Vec3(0, -30, 0), Vec3(20, 20, 0)}) {
    TwinBody body = at(rubbing(), centre);
    for (int i = 0; i < 20000; ++i) {
      body.step(Vec4::Zero(), push, 1e-4);
      ASSERT_LT(std::abs(body.pose()(0)), 0.055 + 0.02);
      ASSERT_LT(std::abs(body.pose()(1) - 0.15), 0.055 + 0.02);
    }
    EXPECT_GT(body.counters().stopped, 0u);
    EXPECT_LT(body.velocity().norm(), 0.01);
    const double depth = std::max(std::abs(body.pose()(0)), std::abs(body.pose()(1) - 0.15)) - 0.055;
    EXPECT_NEAR(depth, push.cwiseAbs().maxCoeff() / 5e4, 1e-4);
  }
}

TEST(TwinBody, IsCaughtWhereTheMechanismEndsAndComesBack) {
  TwinBodyConfig config = rubbing();
  config.stop.x_m = {-1.0, 1.0};
  config.stop.y_m = {-1.0, 1.0};  // no box: only reach and singularities end the motion
  TwinBody body = at(config, centre);
  for (int i = 0; i < 10000; ++i) {
    body.step(Vec4::Zero(), {0.0, 20.0, 0.0}, 1e-4);
    ASSERT_TRUE(body.pose().allFinite());
  }
  EXPECT_GT(body.counters().caught, 0u);
  EXPECT_LT(body.pose()(1), 0.26);
  for (int i = 0; i < 1000; ++i) body.step(Vec4::Zero(), {0.0, -20.0, 0.0}, 1e-4);
  EXPECT_LT(body.pose()(1), 0.22);
}

TEST(TwinBody, NeverLosesItsNumbers) {
  TwinBody body = at(rubbing(), centre);
  unsigned state = 12345;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / 16777216.0 - 0.5;
  };
  for (int k = 0; k < 300; ++k) {
    const Vec4 torque = 8.0 * Vec4(random(), random(), random(), random());
    for (int i = 0; i < 100; ++i) body.step(torque, {200 * random(), 200 * random(), 2 * random()}, 1e-4);
    ASSERT_TRUE(body.pose().allFinite() && body.velocity().allFinite() && body.joint_angle_rad().allFinite()) << k;
  }
  const double nan = std::numeric_limits<double>::quiet_NaN();
  body.step({nan, 0, 0, 0}, Vec3::Zero(), 1e-4);
  body.step(Vec4::Zero(), {0, std::numeric_limits<double>::infinity(), 0}, 1e-4);
  for (int i = 0; i < 10; ++i) body.step(Vec4::Zero(), Vec3::Zero(), 1e-4);
  EXPECT_TRUE(body.pose().allFinite() && body.velocity().allFinite());
}

TEST(TwinBody, TurnsWithoutEnd) {
  TwinBody body = at(frictionless(), centre);
  Vec4 before = body.joint_angle_rad();
  for (int i = 0; i < 20000; ++i) {
    const Vec3 middle = body.middle(1e-4);
    body.step(Vec4::Zero(), {-300 * middle(0), -300 * (middle(1) - 0.15), 0.01}, 1e-4);
    const Vec4 now = body.joint_angle_rad();
    ASSERT_LT((now - before).cwiseAbs().maxCoeff(), 0.05) << i;
    before = now;
  }
  EXPECT_GT(body.pose()(2), 4 * 2 * std::numbers::pi);
}

TEST(TwinBody, RefusesAPoseThatTheMechanismCannotTake) {
  TwinBody body(frictionless());
  EXPECT_NE(body.place({0.0, 0.9, 1.5}), mechanism::Status::Ok);
  EXPECT_NE(body.place({std::nan(""), 0.1, 1.5}), mechanism::Status::Ok);
}

TEST(Imperfection, ChangesWhatItSays) {
  Imperfection imperfection;
  imperfection.mass_factor = 1.1;
  imperfection.link_error_m[1] = {1e-5, 2e-5, 3e-5, 4e-5};
  imperfection.coupling_error_m = -1e-5;
  const mechanism::TwinModel real = imperfect(twin(), imperfection);
  EXPECT_DOUBLE_EQ(real.linkage[1].distal[0].length_m, 0.155 + 3e-5);
  EXPECT_DOUBLE_EQ(real.linkage[1].proximal[1].length_m, 0.105 + 2e-5);
  EXPECT_DOUBLE_EQ(real.linkage[0].distal[1].length_m, 0.155);
  EXPECT_DOUBLE_EQ(real.coupling_m, 0.05 - 1e-5);
  EXPECT_DOUBLE_EQ(real.handle_mass_kg, 0.165);
  EXPECT_DOUBLE_EQ(real.linkage[0].reflected_inertia_kg_m2[1], 4.4e-4);
  const TwinBodyConfig nominal = frictionless();
  TwinBodyConfig heavy = nominal;
  heavy.model = imperfect(twin(), {1.1, {}, 0.0});
  TwinBody light_body = at(nominal, centre);
  TwinBody heavy_body = at(heavy, centre);
  light_body.set_velocity({0.1, 0.2, 1.0});
  heavy_body.set_velocity({0.1, 0.2, 1.0});
  EXPECT_NEAR(heavy_body.kinetic_energy_j(), 1.1 * light_body.kinetic_energy_j(), 1e-12);
}

}  // namespace
}  // namespace trocar::sim_plant
