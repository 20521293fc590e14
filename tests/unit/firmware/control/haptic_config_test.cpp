// What a rig file says about Haptic, as the laws take it.
#include <gtest/gtest.h>

#include <filesystem>

#include "common/config/rig_file.hpp"
#include "firmware/control/force_observer.hpp"
#include "firmware/control/haptic.hpp"

namespace trocar::control {
namespace {

using mechanism::Vec3;

rig::Rig shipped() { return config::read_rig(std::filesystem::path(TROCAR_SHARE) / "rigs/ubc_twin_haptic.toml"); }

void expect_equal(const LocalController& a, const LocalController& b) {
  EXPECT_EQ(a.damping, b.damping);
  EXPECT_EQ(a.stiffness, b.stiffness);
}

// Tests and benchmarks of the laws take their defaults: these are what the shipped rig does.
TEST(HapticConfig, OfTheShippedRigIsTheDefault) {
  const HapticConfig got = haptic_config(shipped()), expected{};
  expect_equal(got.display.four_channel.master, expected.display.four_channel.master);
  expect_equal(got.display.four_channel.slave, expected.display.four_channel.slave);
  EXPECT_EQ(got.display.four_channel.adaptive.per_force_s_m, expected.display.four_channel.adaptive.per_force_s_m);
  EXPECT_EQ(got.display.four_channel.adaptive.per_moment_s_rad, expected.display.four_channel.adaptive.per_moment_s_rad);
  EXPECT_EQ(got.display.four_channel.adaptive.least, expected.display.four_channel.adaptive.least);
  EXPECT_EQ(got.display.four_channel.needle.mass, expected.display.four_channel.needle.mass);
  EXPECT_EQ(got.display.four_channel.needle.damping, expected.display.four_channel.needle.damping);
  EXPECT_EQ(got.display.admittance.slave.mass, expected.display.admittance.slave.mass);
  expect_equal(got.display.admittance.tracking, expected.display.admittance.tracking);
  EXPECT_EQ(got.display.glide.duration_s, expected.display.glide.duration_s);
  EXPECT_EQ(got.fade.duration_s, expected.fade.duration_s);
  EXPECT_EQ(got.guard.credit_j, expected.guard.credit_j);
  EXPECT_EQ(got.guard.initial_j, expected.guard.initial_j);
  EXPECT_EQ(got.guard.softest_n_m, expected.guard.softest_n_m);
  EXPECT_EQ(got.guard.bound_j, expected.guard.bound_j);
  EXPECT_EQ(got.guard.damping_n_s_m, expected.guard.damping_n_s_m);
  EXPECT_EQ(got.impedance.device_mass, expected.impedance.device_mass);
  EXPECT_EQ(got.impedance.mass, expected.impedance.mass);
  EXPECT_EQ(got.impedance.damping, expected.impedance.damping);
  EXPECT_EQ(got.impedance.stiffness, expected.impedance.stiffness);
}

TEST(HapticConfig, TakesEveryNumberFromTheRig) {
  rig::Rig rig = shipped();
  rig::Haptic& h = rig.haptic;
  h.fade_s = 0.1;
  h.observer = rig::ForceObserver::Momentum;
  h.observer_bandwidth_rad_s = 123.0;
  h.desired_mass = {1, 2};
  h.desired_damping = {3, 4};
  h.desired_stiffness = {5, 6};
  h.needle_mass = {7, 8};
  h.needle_damping = {9, 10};
  h.master = {{11, 12}, {13, 14}};
  h.slave = {{15, 16}, {17, 18}};
  h.adaptive_per_force_s_m = 19;
  h.adaptive_per_moment_s_rad = 20;
  h.adaptive_least = {21, 22};
  h.tracking = {{23, 24}, {25, 26}};
  h.guard_credit_j = 0.27;
  h.guard_softest_n_m = 28;
  h.guard_bound_j = 0.29;
  h.guard_damping_n_s_m = 30;
  const HapticConfig c = haptic_config(rig);
  EXPECT_EQ(c.fade.duration_s, 0.1);
  EXPECT_EQ(c.display.glide.duration_s, 0.1);
  EXPECT_EQ(c.impedance.mass, Vec3(1, 1, 2));
  EXPECT_EQ(c.impedance.damping, Vec3(3, 3, 4));
  EXPECT_EQ(c.impedance.stiffness, Vec3(5, 5, 6));
  EXPECT_EQ(c.impedance.rest_pose_m_rad, Vec3(rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]));
  for (const VirtualSlave& needle : {c.display.four_channel.needle, c.display.admittance.slave}) {
    EXPECT_EQ(needle.mass, Vec3(7, 7, 8));
    EXPECT_EQ(needle.damping, Vec3(9, 9, 10));
  }
  expect_equal(c.display.four_channel.master, {Vec3(11, 11, 12), Vec3(13, 13, 14)});
  expect_equal(c.display.four_channel.slave, {Vec3(15, 15, 16), Vec3(17, 17, 18)});
  EXPECT_EQ(c.display.four_channel.adaptive.per_force_s_m, 19);
  EXPECT_EQ(c.display.four_channel.adaptive.per_moment_s_rad, 20);
  EXPECT_EQ(c.display.four_channel.adaptive.least, Vec3(21, 21, 22));
  expect_equal(c.display.admittance.tracking, {Vec3(23, 23, 24), Vec3(25, 25, 26)});
  EXPECT_EQ(c.guard.credit_j, 0.27);
  EXPECT_EQ(c.guard.initial_j, 0.27);
  EXPECT_EQ(c.guard.softest_n_m, 28);
  EXPECT_EQ(c.guard.bound_j, 0.29);
  EXPECT_EQ(c.guard.damping_n_s_m, 30);
  const ForceObserverConfig observer = force_observer_config(rig);
  EXPECT_EQ(observer.kind, ObserverKind::Momentum);
  EXPECT_EQ(observer.bandwidth_rad_s, 123.0);
}

TEST(HapticConfig, TheShippedRigIsAdmittedAndACoarserOneIsNot) {
  rig::Rig rig = shipped();
  EXPECT_EQ(admit(rig).verdict, Admissible::Yes) << to_text(admit(rig).verdict);
  rig.actuation.encoder_counts_per_turn = 1000;
  EXPECT_EQ(admit(rig).verdict, Admissible::EncoderTooCoarse);
}

}  // namespace
}  // namespace trocar::control
