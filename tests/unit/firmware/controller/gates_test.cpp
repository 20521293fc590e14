// The first gate before the motors without the second one behind it: what the controller itself may hand to the link. (The second
// without the first: RigLinkTest.SecondGateStopsWhatTheControllerMustNotSend.)
#include <gtest/gtest.h>

#include <limits>

#include "fake_rig.hpp"

namespace trocar::controller {
namespace {

TEST(FirstGate, AloneTurnsANaNOfTheControlLawIntoZeroTorque) {
  FakeRig f;
  f.positioned();
  f.rig.gain_set[0].translation.proportional = std::numeric_limits<double>::quiet_NaN();  // nothing measured is wrong
  f.tick();
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.mode(), Mode::Fault);
  EXPECT_EQ(f.fault(), Fault::NotFinite);
  f.tick(500);
  EXPECT_TRUE(f.torque_free());
  EXPECT_TRUE(f.torque_finite);
}

TEST(FirstGate, AloneBoundsTorqueAndSlewOfAControlLawGoneWild) {
  FakeRig f;
  f.positioned();
  f.follows = false;
  f.rig.actuation.friction_coulomb_nm = 1e6;  // fed forward behind the law's own clamp
  ASSERT_EQ(f.move(0.01, 0.13, f.pose[2]), ReplyCode::Accepted);
  const double step_nm = 1e-3 * f.rig.limits.torque_slew_nm_per_s;
  std::array<double, 4> before = f.out.joint_torque_nm;
  double most = 0.0;
  for (int i = 0; i < 200; ++i) {
    f.tick();
    for (std::size_t k = 0; k < 4; ++k) {
      const double peak_nm = f.rig.actuation.joint_torque_nm(f.rig.actuation.peak_current_a, k);
      EXPECT_LE(std::abs(f.out.joint_torque_nm[k]), peak_nm);
      if (f.out.request == hal::DriveRequest::Enable) {
        EXPECT_LE(std::abs(f.out.joint_torque_nm[k] - before[k]), step_nm + 1e-12);
      }
      most = std::max(most, std::abs(f.out.joint_torque_nm[k]) / peak_nm);
    }
    before = f.out.joint_torque_nm;
  }
  EXPECT_GT(most, 0.5);  // it was wild indeed
}

// Nobody is armed, nor may be, before every drive has answered.
TEST(ArmingGate, IsClosedWhileTheLinkIsNotOperational) {
  for (const hal::LinkState state : {hal::LinkState::Down, hal::LinkState::BringUp}) {
    FakeRig f;
    f.homed();
    ASSERT_EQ(f.mode(), Mode::Ready);
    f.feedback.state = state;
    f.tick();
    EXPECT_EQ(f.mode(), Mode::Off);
    EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::WrongMode);
    EXPECT_TRUE(f.torque_free());
    EXPECT_EQ(f.controller->status().session, 0u);
  }
}

TEST(ArmingGate, IsClosedWhileTheDrivesBusIsOff) {
  FakeRig f;
  f.positioned();
  f.feedback.bus_off = true;
  f.feedback.state = hal::LinkState::Down;
  f.drives_answer = false;
  f.tick(30);
  EXPECT_EQ(f.mode(), Mode::Fault);
  EXPECT_EQ(f.fault(), Fault::BusOff);
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::StillFaulty);
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::WrongMode);
  f.tick(5000);
  EXPECT_EQ(f.fault(), Fault::BusOff);
  EXPECT_TRUE(f.torque_free());
}

}  // namespace
}  // namespace trocar::controller
