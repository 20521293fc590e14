#include "sim_plant/plant/plant.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "machine.hpp"

namespace trocar::sim_plant {
namespace {

constexpr std::int64_t millisecond = 1'000'000;
const double quiet_nan = std::numeric_limits<double>::quiet_NaN();

PlantConfig perfect() {
  PlantConfig plant = shipped_plant();
  plant.imperfection = {};
  plant.friction = {};
  plant.gear_efficiency = shipped_rig().actuation.gear_efficiency;
  plant.force_noise_n = 0.0;
  plant.torque_noise_nm = 0.0;
  return plant;
}

TEST(Plant, StartsAtRestInTheHomingPose) {
  Machine m;
  for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(m.plant.pose()[k], m.rig.homing_pose[k]);
  m.plant.advance_to(200 * millisecond, {});
  EXPECT_EQ(m.plant.time_ns(), 200 * millisecond);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(m.plant.pose()[k], m.rig.homing_pose[k], 1e-12);
  // The joints stand where the drawing puts them but for the plant's errors of length.
  mechanism::Vec4 nominal;
  const mechanism::Vec3 home(m.rig.homing_pose[0], m.rig.homing_pose[1], m.rig.homing_pose[2]);
  ASSERT_EQ(mechanism::inverse(m.rig.twin, home, mechanism::Vec4::Zero(), nominal), mechanism::Status::Ok);
  double worst = 0.0;
  for (std::size_t i = 0; i < 4; ++i)
    worst = std::max(worst, std::abs(m.plant.joint_angle_rad()[i] - nominal(static_cast<Eigen::Index>(i))));
  EXPECT_LT(worst, 1e-3);
  EXPECT_GT(worst, 1e-6);
}

TEST(Plant, MotorsMoveTheHandleTheWayTheyPull) {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    Machine m(perfect());
    mechanism::Vec3 wrench = mechanism::Vec3::Zero();
    wrench(axis) = axis < 2 ? 1.0 : 0.02;
    m.plant.advance_to(20 * millisecond, m.motor_torque(wrench));
    const auto axis_index = static_cast<std::size_t>(axis);
    EXPECT_GT(m.plant.pose()[axis_index], m.rig.homing_pose[axis_index] + 1e-5);
    EXPECT_GT(m.plant.velocity()[axis_index], 0.0);
  }
}

TEST(Plant, CurrentLoopFollowsItsBandwidthAndItsPeak) {
  Machine m;
  const double command = 0.05;
  const double time_constant_s = 1.0 / (2 * std::numbers::pi * 600.0);
  m.plant.advance_to(300'000, {command, 0, 0, 0});
  EXPECT_NEAR(m.plant.motor_torque_nm()[0], command * (1 - std::exp(-3e-4 / time_constant_s)), 1e-12);
  m.plant.advance_to(20 * millisecond, {command, 0, 0, 0});
  EXPECT_NEAR(m.plant.motor_torque_nm()[0], command, 1e-12);
  EXPECT_NEAR(m.plant.joint_torque_nm()[0], command * 8.0 * 0.85, 1e-12);
  m.plant.advance_to(40 * millisecond, {100.0, -100.0, quiet_nan, std::numeric_limits<double>::infinity()});
  EXPECT_NEAR(m.plant.motor_torque_nm()[0], 0.525, 1e-9);
  EXPECT_NEAR(m.plant.motor_torque_nm()[1], -0.525, 1e-9);
  EXPECT_EQ(m.plant.motor_torque_nm()[2], 0.0);
  EXPECT_EQ(m.plant.motor_torque_nm()[3], 0.0);
}

TEST(Plant, TimeStandsUntilAWholeStepHasPassed) {
  Machine m;
  m.plant.advance_to(99'999, {0.1, 0, 0, 0});
  EXPECT_EQ(m.plant.time_ns(), 0);
  m.plant.advance_to(100'000, {0.1, 0, 0, 0});
  EXPECT_EQ(m.plant.time_ns(), 100'000);
  m.plant.advance_to(-5, {0.1, 0, 0, 0});
  m.plant.advance_to(50'000, {0.1, 0, 0, 0});
  EXPECT_EQ(m.plant.time_ns(), 100'000);
}

TEST(Plant, SensorTurnsWithTheNeedle) {
  for (const double angle : {0.0, 0.7}) {
    rig::Rig rig = shipped_rig();
    rig.sensor.angle_rad = angle;
    Plant plant(rig, perfect(), shipped_scene(), 1);
    // A hand pushes the needle sideways into the tissue: the base carries what the phantom answers.
    plant.set_hand_wrench({0.3, 3.0, 0.002});
    plant.advance_to(300 * millisecond, {});
    const auto& base = plant.base_wrench();
    ASSERT_GT(std::hypot(base[0], base[1]), 0.1);
    const double theta = plant.pose()[2] + angle;
    const auto& s = plant.sensor_wrench();
    EXPECT_NEAR(std::cos(theta) * s[0] - std::sin(theta) * s[1], base[0], 1e-12);
    EXPECT_NEAR(std::sin(theta) * s[0] + std::cos(theta) * s[1], base[1], 1e-12);
    EXPECT_NEAR(s[5], base[2], 1e-12);
    EXPECT_EQ(s[2], 0.0);
    EXPECT_EQ(s[3], 0.0);
    EXPECT_EQ(s[4], 0.0);
  }
}

TEST(Plant, SensorNoiseIsSeededAndAsLargeAsItSays) {
  Machine m(shipped_plant(), 42);
  Machine same(shipped_plant(), 42);
  Machine other(shipped_plant(), 43);
  double square = 0.0;
  double moment_square = 0.0;
  double sum = 0.0;
  bool differs = false;
  const int readings = 2000;
  for (int k = 1; k <= readings; ++k) {
    m.plant.advance_to(k * millisecond, {});
    other.plant.advance_to(k * millisecond, {});
    // Ten short waits instead of one: the noise belongs to the time, not to the number of questions.
    for (int part = 1; part <= 10; ++part) same.plant.advance_to((k - 1) * millisecond + part * 100'000, {});
    EXPECT_EQ(m.plant.sensor_wrench(), same.plant.sensor_wrench());
    differs = differs || m.plant.sensor_wrench() != other.plant.sensor_wrench();
    sum += m.plant.sensor_wrench()[0];
    square += m.plant.sensor_wrench()[0] * m.plant.sensor_wrench()[0];
    moment_square += m.plant.sensor_wrench()[5] * m.plant.sensor_wrench()[5];
  }
  EXPECT_TRUE(differs);
  EXPECT_NEAR(sum / readings, 0.0, 4 * 0.0125 / std::sqrt(readings));
  EXPECT_NEAR(std::sqrt(square / readings), 0.0125, 0.001);
  EXPECT_NEAR(std::sqrt(moment_square / readings), 6.25e-5, 5e-6);
}

// 8 mm/s for 5 s from home: 5 mm of air, 35 mm into the tissue.
std::array<double, 3> insertion(double time_s) { return {0.0, 0.11 + 0.008 * time_s, std::numbers::pi / 2}; }

TEST(Plant, InsertionLoadsMotorsSensorAndMechanismAlike) {
  Machine m;
  m.follow(5.0, insertion);
  const double path = m.plant.phantom().insertion().working_set().path_m();
  EXPECT_GT(path, 0.025);
  EXPECT_LT(path, 0.036);
  const double base = m.plant.base_wrench()[1];
  EXPECT_NEAR(base, m.plant.phantom().insertion().shaft_n_per_m() * path, 0.05);
  EXPECT_NEAR(m.plant.sensor_wrench()[0], base, 5 * 0.0125);  // along the needle
  EXPECT_NEAR(m.plant.velocity()[1], 0.008, 0.002);
  EXPECT_EQ(m.plant.phantom().counters().unconverged, 0u);
  EXPECT_EQ(m.plant.body().counters().caught, 0u);
  EXPECT_EQ(m.plant.body().counters().stopped, 0u);

  // In slow steady motion the motors carry tissue and friction: nothing else is there to hold.
  mechanism::TwinState state;
  mechanism::Mat43 map;
  const auto pose = m.plant.pose();
  ASSERT_EQ(mechanism::at_pose(m.plant.body().model(), {pose[0], pose[1], pose[2]}, mechanism::Vec4::Zero(), state), mechanism::Status::Ok);
  ASSERT_EQ(mechanism::velocity_map(m.plant.body().model(), state, map), mechanism::Status::Ok);
  mechanism::Vec4 torque;
  mechanism::Vec4 friction;
  const mechanism::Vec4 speed = map * mechanism::Vec3(0, 0.008, 0);
  const PlantConfig config = shipped_plant();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    torque(row) = m.plant.motor_torque_nm()[i] * 8.0 * config.gear_efficiency;
    friction(row) = std::copysign(config.friction[i].coulomb_nm, speed(row)) + config.friction[i].viscous_nm_s * speed(row);
  }
  const mechanism::Vec3 wrench = map.transpose() * (torque - friction);
  EXPECT_NEAR(wrench(1), base, 0.05);
}

TEST(Plant, HalvingTheStepChangesTheMotionLittle) {
  std::array<std::array<double, 3>, 3> pose{};
  std::array<double, 3> force{};
  std::size_t k = 0;
  for (const double hz : {10000.0, 20000.0, 40000.0}) {
    PlantConfig config = shipped_plant();
    config.step_hz = hz;
    Machine m(config);
    m.follow(2.0, [](double t) {
      return std::array<double, 3>{0.004 * std::sin(3 * t), 0.11 + 0.008 * t, std::numbers::pi / 2 + 0.05 * t};
    });
    pose[k] = m.plant.pose();
    force[k] = m.plant.base_wrench()[1];
    ++k;
  }
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(pose[0][i], pose[2][i], 2e-6);
  EXPECT_NEAR(pose[0][2], pose[2][2], 2e-5);
  EXPECT_NEAR(force[0], force[2], 2e-3);
  // Down to the steps in which the last contact's ties follow the tip: some ten nanometres here.
  EXPECT_LT(std::abs(pose[1][1] - pose[2][1]), 0.6 * std::abs(pose[0][1] - pose[2][1]) + 2e-8);
}

TEST(Plant, WithdrawalReversesTheForceAndEndsWithoutContact) {
  Machine m;
  m.follow(5.0, insertion);
  EXPECT_GT(m.plant.base_wrench()[1], 1.0);
  m.follow(2.5, [](double t) { return std::array<double, 3>{0.0, 0.15 - 0.008 * t, std::numbers::pi / 2}; });
  EXPECT_LT(m.plant.base_wrench()[1], -0.3);
  m.follow(3.0, [](double t) { return std::array<double, 3>{0.0, 0.13 - 0.008 * t, std::numbers::pi / 2}; });
  EXPECT_EQ(m.plant.phantom().contacts(), 0u);
  EXPECT_EQ(m.plant.base_wrench()[1], 0.0);
}

TEST(Plant, LosesItsMotorsAndComesToRest) {
  Machine m;
  m.follow(4.0, insertion);
  m.plant.advance_to(m.plant.time_ns() + 1000 * millisecond, {});
  const auto before = m.plant.pose();
  m.plant.advance_to(m.plant.time_ns() + 1000 * millisecond, {});
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(m.plant.pose()[k], before[k], 1e-5);
}

TEST(Plant, SameInputsAndSeedGiveTheSameBits) {
  const auto run = [] {
    Machine m(shipped_plant(), 7);
    m.follow(1.5, insertion);
    return std::pair{m.plant.joint_angle_rad(), m.plant.sensor_wrench()};
  };
  EXPECT_EQ(run(), run());
}

TEST(Plant, SurvivesFullTorqueInEveryDirection) {
  Machine m;
  unsigned state = 99;
  for (int k = 1; k <= 3000; ++k) {
    std::array<double, 4> torque{};
    for (double& t : torque) {
      state = state * 1664525u + 1013904223u;
      t = (state >> 31) != 0 ? 0.525 : -0.525;
    }
    m.plant.advance_to(k * 5 * millisecond, torque);
    for (const double q : m.plant.joint_angle_rad()) ASSERT_TRUE(std::isfinite(q)) << k;
    for (const double f : m.plant.sensor_wrench()) ASSERT_TRUE(std::isfinite(f)) << k;
  }
  m.plant.set_hand_wrench({quiet_nan, 0, 0});
  m.plant.advance_to(m.plant.time_ns() + millisecond, {});
  for (const double x : m.plant.pose()) EXPECT_TRUE(std::isfinite(x));
}

// Two seconds of the same push, with tissue in the way and without.
TEST(Plant, NothingHoldsTheNeedleWithoutTissue) {
  const auto pushed = [](const std::optional<scene::Scene>& scene) {
    Plant plant(shipped_rig(), shipped_plant(), scene, 1);
    plant.set_hand_wrench({0.0, 1.5, 0.0});
    plant.advance_to(2000 * millisecond, {});
    return std::pair{plant.pose()[1], plant.base_wrench()};
  };
  const auto [free_m, nothing] = pushed(std::nullopt);
  const auto [held_m, tissue] = pushed(shipped_scene());
  EXPECT_GT(free_m, held_m + 0.01);
  EXPECT_EQ(nothing, (std::array<double, 3>{}));
  EXPECT_GT(tissue[1], 0.1);
}

std::string refusal(const rig::Rig& rig, const PlantConfig& config) {
  try {
    const Plant plant(rig, config, shipped_scene(), 1);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

TEST(Plant, RefusesWhatItCannotSimulate) {
  const rig::Rig single = config::read_rig(shared("rigs/five_bar.toml"));
  EXPECT_NE(refusal(single, shipped_plant()).find("twin"), std::string::npos);
  EXPECT_NE(refusal(single, shipped_plant()).find(single.name.data()), std::string::npos);
  PlantConfig bad = shipped_plant();
  bad.step_hz = 3000.0;
  EXPECT_NE(refusal(shipped_rig(), bad).find("step_hz"), std::string::npos);
  bad = shipped_plant();
  bad.gear_efficiency = 1.5;
  EXPECT_NE(refusal(shipped_rig(), bad).find("gear_efficiency"), std::string::npos);
  rig::Rig astray = shipped_rig();
  astray.homing_pose[1] = 0.5;
  EXPECT_NE(refusal(astray, shipped_plant()).find("homing pose"), std::string::npos);
  EXPECT_EQ(refusal(shipped_rig(), shipped_plant()), "");
  EXPECT_EQ(refusal(config::read_rig(shared("rigs/ubc_twin_haptic.toml")), shipped_plant()), "");
}

}  // namespace
}  // namespace trocar::sim_plant
