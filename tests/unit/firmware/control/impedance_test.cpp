#include "firmware/control/impedance.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

#include "common/mechanism/twin.hpp"

namespace trocar::control {
namespace {

using mechanism::Mat3;
using mechanism::TwinModel;
using mechanism::TwinState;
using mechanism::Vec3;
using mechanism::Vec4;

constexpr double pi = 3.14159265358979323846;

// The haptic rig's linkage.
TwinModel twin() {
  TwinModel twin;
  for (auto& linkage : twin.linkage) {
    linkage.base_m = 0.08;
    for (auto& link : linkage.proximal) link = {0.105, 0.0238, 0.0481, 5.45e-5};
    for (auto& link : linkage.distal) link = {0.155, 0.0195, 0.0735, 8.28e-5};
    linkage.end_point_mass_kg = 0.02;
    linkage.reflected_inertia_kg_m2 = {6.5e-6, 6.5e-6};
  }
  twin.coupling_m = 0.05;
  twin.handle_m = 0.025;
  twin.handle_mass_kg = 0.15;
  twin.handle_com_m = 0.025;
  twin.handle_inertia_kg_m2 = 1.0e-4;
  return twin;
}

ImpedanceConfig wanted() {
  ImpedanceConfig config;
  config.mass = {0.5, 0.25, 3e-4};
  config.damping = {4.0, 2.5, 3e-3};
  config.stiffness = {60.0, 40.0, 0.05};
  config.rest_pose_m_rad = {0.005, 0.15, 0.5 * pi};
  return config;
}

// Random poses, velocities and forces of the twin.
struct Draw {
  std::mt19937_64 engine{7};
  TwinModel model = twin();
  double uniform(double a, double b) { return std::uniform_real_distribution(a, b)(engine); }
  Vec3 vector(double xy, double theta) { return {uniform(-xy, xy), uniform(-xy, xy), uniform(-theta, theta)}; }
  DeviceState device() {
    DeviceState d;
    d.pose = {uniform(-0.04, 0.04), uniform(0.11, 0.19), uniform(0.0, 2.0 * pi)};
    d.velocity = vector(0.5, 5.0);
    d.hand_force = vector(5.0, 0.1);
    TwinState state;
    EXPECT_EQ(mechanism::at_pose(model, d.pose, Vec4::Constant(0.5 * pi), state), mechanism::Status::Ok);
    EXPECT_EQ(mechanism::dynamics(model, state, d.velocity, d.M, d.C), mechanism::Status::Ok);
    return d;
  }
};

TEST(Impedance, TurnsTheDeviceEquationIntoTheWantedOne) {
  Draw draw;
  const ImpedanceConfig config = wanted();
  for (int i = 0; i < 1000; ++i) {
    const DeviceState d = draw.device();
    const Vec3 f_m = draw.vector(5.0, 0.1);
    const Vec3 u = impedance_force(config, d, f_m);
    const Vec3 acceleration = d.M.inverse() * (d.hand_force + u - d.C * d.velocity);  // A.3
    const Vec3 residual = config.mass.cwiseProduct(acceleration) + config.damping.cwiseProduct(d.velocity) +
                          config.stiffness.cwiseProduct(d.pose - config.rest_pose_m_rad) - d.hand_force - f_m;  // A.7
    EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-11);
  }
}

TEST(Impedance, IsThePrintedLaw) {
  Draw draw;
  const ImpedanceConfig config = wanted();
  for (int i = 0; i < 100; ++i) {
    const DeviceState d = draw.device();
    const Vec3 f_m = draw.vector(5.0, 0.1);
    const Mat3 G = d.M * config.mass.cwiseInverse().asDiagonal();
    const Vec3 printed = (G - Mat3::Identity()) * d.hand_force + G * f_m + (d.C - G * Mat3(config.damping.asDiagonal())) * d.velocity -
                         G * config.stiffness.cwiseProduct(d.pose - config.rest_pose_m_rad);
    EXPECT_LT((impedance_force(config, d, f_m) - printed).cwiseAbs().maxCoeff(), 1e-11);
  }
}

TEST(Impedance, DisplayForceIsItsInverse) {
  Draw draw;
  for (const bool device_mass : {false, true}) {
    ImpedanceConfig config = wanted();
    config.device_mass = device_mass;
    for (int i = 0; i < 100; ++i) {
      const DeviceState d = draw.device();
      const Vec3 f_m = draw.vector(5.0, 0.1);
      EXPECT_LT((display_force(config, d, impedance_force(config, d, f_m)) - f_m).cwiseAbs().maxCoeff(), 1e-11);
    }
  }
}

TEST(Impedance, KeepingTheDevicesMassNeedsNoHandForce) {
  Draw draw;
  ImpedanceConfig config = wanted();
  config.device_mass = true;
  DeviceState d = draw.device();
  const Vec3 f_m(1.0, -2.0, 0.03);
  const Vec3 u = impedance_force(config, d, f_m);
  const Vec3 acceleration = d.M.inverse() * (d.hand_force + u - d.C * d.velocity);
  const Vec3 residual = d.M * acceleration + config.damping.cwiseProduct(d.velocity) +
                        config.stiffness.cwiseProduct(d.pose - config.rest_pose_m_rad) - d.hand_force - f_m;
  EXPECT_LT(residual.cwiseAbs().maxCoeff(), 1e-12);
  d.hand_force.setConstant(std::nan(""));
  EXPECT_EQ(impedance_force(config, d, f_m), u);
}

// Hand: a push, then swings at 0.5, 0.8 and 1.1 Hz. The device is the twin with all its Coriolis terms, the law runs at 1 kHz and
// its output is held; the yardstick is A.7 under the same hand force, integrated as finely.
TEST(Impedance, ReproducesTheWantedMotionToOnePercent) {
  const TwinModel model = twin();
  const ImpedanceConfig config = wanted();
  constexpr int ticks = 4000, substeps = 10;
  constexpr double dt = 1e-3, h = dt / substeps;
  const auto hand = [](double t) -> Vec3 {
    const double push = t < 0.5 ? 1.0 : 0.0;
    return {0.8 * push + std::sin(2 * pi * 0.5 * t), -0.5 * push + 0.7 * std::sin(2 * pi * 0.8 * t),
            2e-3 * push + 8e-3 * std::sin(2 * pi * 1.1 * t)};
  };
  Vec3 x = config.rest_pose_m_rad, v = Vec3::Zero(), wanted_x = x, wanted_v = v;
  Vec4 q = Vec4::Constant(0.5 * pi);
  Vec3 largest = Vec3::Zero(), worst = Vec3::Zero();
  TwinState state;
  const auto device = [&](double t, const Vec3& pose, const Vec3& velocity) {
    DeviceState d;
    d.pose = pose;
    d.velocity = velocity;
    d.hand_force = hand(t);
    EXPECT_EQ(mechanism::at_pose(model, pose, q, state), mechanism::Status::Ok);
    q = state.q;
    EXPECT_EQ(mechanism::dynamics(model, state, velocity, d.M, d.C), mechanism::Status::Ok);
    return d;
  };
  for (int k = 0; k < ticks; ++k) {
    const double t0 = k * dt;
    const Vec3 u = impedance_force(config, device(t0, x, v), Vec3::Zero());
    for (int i = 0; i < substeps; ++i) {
      const double t = t0 + i * h;
      const auto a = [&](double at, const Vec3& pose, const Vec3& velocity) -> Vec3 {
        const DeviceState d = device(at, pose, velocity);
        return d.M.inverse() * (d.hand_force + u - d.C * velocity);
      };
      const auto b = [&](double at, const Vec3& pose, const Vec3& velocity) -> Vec3 {
        return (hand(at) - config.damping.cwiseProduct(velocity) - config.stiffness.cwiseProduct(pose - config.rest_pose_m_rad))
            .cwiseQuotient(config.mass);
      };
      const auto midpoint = [&](const auto& f, Vec3& pose, Vec3& velocity) {
        const Vec3 va = velocity + 0.5 * h * f(t, pose, velocity);
        const Vec3 xa = pose + 0.5 * h * velocity;
        const Vec3 am = f(t + 0.5 * h, xa, va);
        pose += h * va;
        velocity += h * am;
      };
      midpoint(a, x, v);
      midpoint(b, wanted_x, wanted_v);
    }
    worst = worst.cwiseMax((x - wanted_x).cwiseAbs());
    largest = largest.cwiseMax((wanted_x - config.rest_pose_m_rad).cwiseAbs());
  }
  const Vec3 error = worst.cwiseQuotient(largest);
  RecordProperty("error_x", std::to_string(error[0]));
  RecordProperty("error_y", std::to_string(error[1]));
  RecordProperty("error_theta", std::to_string(error[2]));
  EXPECT_GT(largest[0], 0.015);  // it moves through much of the workspace
  EXPECT_GT(largest[2], 0.15);
  EXPECT_LT(error.maxCoeff(), 0.01) << error.transpose();
}

}  // namespace
}  // namespace trocar::control
