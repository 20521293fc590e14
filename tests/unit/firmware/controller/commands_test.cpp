#include <gtest/gtest.h>

#include <limits>

#include "fake_rig.hpp"

namespace trocar::controller {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(ControllerCommands, ReadyWithoutTorqueOnceTheLinkIsUp) {
  FakeRig f;
  f.feedback.state = hal::LinkState::BringUp;
  f.tick(10);
  EXPECT_EQ(f.mode(), Mode::Off);
  f.feedback.state = hal::LinkState::Operational;
  f.tick();
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_TRUE(f.torque_free());
  EXPECT_TRUE(std::isnan(f.sample().pose[0]));
}

TEST(ControllerCommands, HomingTakesThePoseOfTheJigWhateverTheCounts) {
  FakeRig f;
  f.homed();
  ASSERT_EQ(f.answer(1), ReplyCode::Done);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(f.sample().pose[i], f.rig.homing_pose[i], 1e-9);
  f.stand_at({0.01, 0.13, 1.4});
  f.tick();
  EXPECT_NEAR(f.sample().pose[0], 0.01, 1e-4);
  EXPECT_NEAR(f.sample().pose[1], 0.13, 1e-4);
  EXPECT_NEAR(f.sample().pose[2], 1.4, 2e-3);
}

TEST(ControllerCommands, HomingIsRefusedBeforeTheLinkIsUpAndInMotion) {
  FakeRig f;
  f.feedback.state = hal::LinkState::BringUp;
  EXPECT_EQ(f.send(CommandKind::Home), ReplyCode::WrongMode);
  f.feedback.state = hal::LinkState::Operational;
  f.tick();
  for (int i = 0; i < 100; ++i) {
    f.feedback.drive[2].position_counts += 3;
    f.tick();
  }
  EXPECT_EQ(f.send(CommandKind::Home), ReplyCode::NotAtRest);
  f.tick(60);
  EXPECT_EQ(f.send(CommandKind::Home), ReplyCode::Done);
}

TEST(ControllerCommands, ArmNeedsHomingRestAndASession) {
  FakeRig f;
  f.tick(60);
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::NotHomed);
  ASSERT_EQ(f.send(CommandKind::Home), ReplyCode::Done);
  f.mail->commands.push({.session = 0, .id = 99, .kind = CommandKind::Arm});
  f.tick();
  EXPECT_EQ(f.answer(99), ReplyCode::NoSession);
  f.stand_at({0.0, 0.115, f.pose[2]});
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::NotAtRest);
  f.tick(60);
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
  f.tick(2);
  EXPECT_EQ(f.last_answer(), ReplyCode::Done);
  EXPECT_EQ(f.mode(), Mode::Armed);
  EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
  EXPECT_EQ(f.out.joint_torque_nm, (std::array<double, 4>{}));
}

TEST(ControllerCommands, DrivesThatDoNotEnableAreAFaultAfterASecond) {
  FakeRig f;
  f.homed();
  f.drives_enable = false;
  ASSERT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
  f.tick(1000);
  EXPECT_EQ(f.mode(), Mode::Ready);
  f.tick(1);
  EXPECT_EQ(f.mode(), Mode::Fault);
  EXPECT_EQ(f.fault(), Fault::DriveFault);
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.last_answer(), ReplyCode::Stopped);  // the Arm is answered
}

TEST(ControllerCommands, AnotherSessionMayHoldAndStopButNotCommand) {
  FakeRig f;
  f.positioned();
  for (const CommandKind kind :
       {CommandKind::Home, CommandKind::Tare, CommandKind::Arm, CommandKind::Disarm, CommandKind::Move, CommandKind::SelectGains})
    EXPECT_EQ(f.send_from(8, kind), ReplyCode::SessionTaken) << to_string(kind);
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_EQ(f.send_from(8, CommandKind::Hold), ReplyCode::Done);
  EXPECT_EQ(f.mode(), Mode::Hold);
  EXPECT_EQ(f.send_from(8, CommandKind::Stop), ReplyCode::Done);
  f.tick(2);
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerCommands, MoveArrivesAndIsAnsweredTwice) {
  FakeRig f;
  f.armed();
  ASSERT_EQ(f.move(0.02, 0.15, 1.9), ReplyCode::Accepted);
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_EQ(f.sample().moving, 1);
  f.tick(1500);
  EXPECT_EQ(f.last_answer(), ReplyCode::Done);
  EXPECT_EQ(f.sample().moving, 0);
  EXPECT_NEAR(f.sample().setpoint_pose[0], 0.02, 1e-12);
  EXPECT_NEAR(f.sample().setpoint_pose[1], 0.15, 1e-12);
  EXPECT_NEAR(f.sample().setpoint_pose[2], 1.9, 1e-12);
  EXPECT_EQ(f.mode(), Mode::Position);
}

TEST(ControllerCommands, MoveWithoutASessionIsRefused) {
  FakeRig f;
  f.homed();
  EXPECT_EQ(f.move(0.0, 0.15, 1.5), ReplyCode::NoSession);
  EXPECT_EQ(f.mode(), Mode::Ready);
}

TEST(ControllerCommands, MoveOutOfRangeIsRefusedAndNothingMoves) {
  FakeRig f;
  f.armed();
  for (const double bad : {nan, infinity, -infinity, 1.0, -1.0, 0.0521}) EXPECT_EQ(f.move(bad, 0.15, 1.5), ReplyCode::OutOfRange) << bad;
  for (const double bad : {nan, infinity, 0.0, 0.097, 0.203}) EXPECT_EQ(f.move(0.0, bad, 1.5), ReplyCode::OutOfRange) << bad;
  for (const double bad : {nan, infinity, -infinity}) EXPECT_EQ(f.move(0.0, 0.15, bad), ReplyCode::OutOfRange) << bad;
  for (const double bad : {nan, infinity, 0.0, -0.01}) {
    EXPECT_EQ(f.move(0.0, 0.15, 1.5, bad), ReplyCode::OutOfRange) << bad;
    EXPECT_EQ(f.move(0.0, 0.15, 1.5, 0.01, bad), ReplyCode::OutOfRange) << bad;
  }
  for (const double bad : {nan, infinity, -1.0}) EXPECT_EQ(f.move(0.0, 0.15, 1.5, 0.01, 1.0, bad), ReplyCode::OutOfRange) << bad;
  EXPECT_EQ(f.mode(), Mode::Armed);
  EXPECT_EQ(f.out.joint_torque_nm, (std::array<double, 4>{}));
}

TEST(ControllerCommands, CommandsThatWantRestAreRefusedInMotion) {
  FakeRig f;
  f.moving();
  ASSERT_EQ(f.sample().moving, 1);
  EXPECT_EQ(f.move(0.0, 0.15, 1.5), ReplyCode::NotAtRest);
  for (const CommandKind kind : {CommandKind::Tare, CommandKind::Disarm, CommandKind::SelectGains})
    EXPECT_EQ(f.send(kind), ReplyCode::NotAtRest) << to_string(kind);
  EXPECT_EQ(f.send(CommandKind::Home), ReplyCode::WrongMode);
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::WrongMode);
}

TEST(ControllerCommands, HoldBrakesOnTheLineAndEndsTheMove) {
  FakeRig f;
  f.moving();
  const std::uint32_t move_id = f.next_id - 1;
  const auto at = f.sample().setpoint_pose;
  EXPECT_EQ(f.send(CommandKind::Hold), ReplyCode::Done);
  f.tick(300);
  EXPECT_EQ(f.mode(), Mode::Hold);
  EXPECT_EQ(f.sample().moving, 0);
  EXPECT_EQ(f.answer(move_id, true), ReplyCode::Stopped);
  const auto end = f.sample().setpoint_pose;
  // From (0, 0.12) towards (0.02, 0.16): dy = 2 dx, and on from where the command met it.
  EXPECT_NEAR(end[1] - 0.12, 2 * end[0], 1e-9);
  EXPECT_GT(end[0], at[0]);
  EXPECT_LT(end[0], 0.02);
  EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
  EXPECT_EQ(f.move(0.0, 0.15, 1.5), ReplyCode::Accepted);  // the same session goes on
}

TEST(ControllerCommands, StopBrakesThenTakesTheTorqueAndFreesTheSession) {
  FakeRig f;
  f.moving();
  const std::uint32_t move_id = f.next_id - 1;
  EXPECT_EQ(f.send_from(99, CommandKind::Stop), ReplyCode::Done);
  EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);  // still braking
  f.tick(300);
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.answer(move_id, true), ReplyCode::Stopped);
  EXPECT_EQ(f.controller->status().session, 0u);
}

TEST(ControllerCommands, StopFreesTheSessionInEveryMode) {
  {
    FakeRig f;  // while the drives enable
    f.homed();
    f.drives_enable = false;
    ASSERT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
    const std::uint32_t arm_id = f.next_id - 1;
    EXPECT_EQ(f.send_from(99, CommandKind::Stop), ReplyCode::Done);
    EXPECT_EQ(f.answer(arm_id, true), ReplyCode::Stopped);
    EXPECT_EQ(f.controller->status().session, 0u);
    EXPECT_TRUE(f.torque_free());
  }
  FakeRig f;
  f.armed();
  EXPECT_EQ(f.send_from(99, CommandKind::Stop), ReplyCode::Done);
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_EQ(f.controller->status().session, 0u);
  EXPECT_EQ(f.send_from(99, CommandKind::Arm), ReplyCode::Accepted);
}

TEST(ControllerCommands, DisarmTakesTheTorque) {
  FakeRig f;
  f.positioned();
  EXPECT_EQ(f.send(CommandKind::Disarm), ReplyCode::Done);
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.send(CommandKind::Disarm), ReplyCode::NoSession);
}

TEST(ControllerCommands, TareRemovesTheMeanOfTheSensor) {
  FakeRig f;
  f.homed();
  f.feedback.sensor.force_torque = {0.4, -0.3, 0, 0, 0, 0.01};
  ASSERT_EQ(f.send(CommandKind::Tare), ReplyCode::Accepted);
  EXPECT_EQ(f.send(CommandKind::Tare), ReplyCode::WrongMode);
  const std::uint32_t id = f.next_id - 2;
  f.tick(260);
  EXPECT_EQ(f.answer(id, true), ReplyCode::Done);
  for (const double w : f.sample().base_wrench) EXPECT_NEAR(w, 0.0, 1e-12);
  // One newton more along the needle, which points along +y.
  f.feedback.sensor.force_torque[0] += 1.0;
  f.tick();
  EXPECT_NEAR(f.sample().base_wrench[0], 0.0, 1e-9);
  EXPECT_NEAR(f.sample().base_wrench[1], 1.0, 1e-9);
}

TEST(ControllerCommands, TareIsAnsweredWhenAFaultEndsIt) {
  FakeRig f;
  f.positioned();
  ASSERT_EQ(f.send(CommandKind::Tare), ReplyCode::Accepted);
  const std::uint32_t id = f.next_id - 1;
  f.late_ns = 10 * FakeRig::ms;
  f.tick(5);
  ASSERT_EQ(f.mode(), Mode::Fault);
  EXPECT_EQ(f.answer(id, true), ReplyCode::Stopped);
}

TEST(ControllerCommands, MoveEndsAtItsForceThreshold) {
  FakeRig f;
  f.positioned();
  ASSERT_EQ(f.move(0.0, 0.18, 1.57, 0.02, 1.0, 1.5), ReplyCode::Accepted);
  f.feedback.sensor.force_torque[0] = 1.49;
  f.tick(200);
  EXPECT_EQ(f.sample().moving, 1);
  f.feedback.sensor.force_torque[0] = 1.51;
  f.tick(200);
  EXPECT_EQ(f.sample().moving, 0);
  EXPECT_EQ(f.last_answer(), ReplyCode::Stopped);
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_LT(f.sample().setpoint_pose[1], 0.14);
}

TEST(ControllerCommands, GainsAreSelectedByIndex) {
  FakeRig f;
  f.positioned();
  EXPECT_EQ(f.send(Command{.kind = CommandKind::SelectGains, .gain_set = 1}), ReplyCode::Done);
  EXPECT_EQ(f.sample().gain_set, 1);
  EXPECT_EQ(f.send(Command{.kind = CommandKind::SelectGains, .gain_set = 2}), ReplyCode::UnknownGains);
  EXPECT_EQ(f.sample().gain_set, 1);
}

TEST(ControllerCommands, UnknownKindsAreRefused) {
  FakeRig f;
  f.homed();
  f.mail->commands.push({.session = FakeRig::host, .id = 500, .kind = static_cast<CommandKind>(200)});
  f.tick();
  ASSERT_FALSE(f.replies.empty());
  EXPECT_EQ(f.replies.back().id, 500u);
  EXPECT_EQ(f.replies.back().code, ReplyCode::WrongVersion);
}

struct HostSilence : ::testing::TestWithParam<int> {};

TEST_P(HostSilence, HoldsBeyondTheTimeoutAndIsNeverTorqueFree) {
  FakeRig f;
  f.moving();
  f.host_talks = false;
  const int silent_ms = GetParam();
  for (int i = 0; i < silent_ms; ++i) {
    f.tick();
    ASSERT_EQ(f.out.request, hal::DriveRequest::Enable);
  }
  const bool expired = silent_ms > 80;
  EXPECT_EQ(f.mode(), expired ? Mode::Hold : Mode::Position);
  EXPECT_EQ(f.count(EventKind::HostLost), expired ? 1u : 0u);
  EXPECT_EQ(f.fault(), Fault::None);
  for (int i = 0; i < 1000; ++i) {
    f.tick();
    ASSERT_EQ(f.out.request, hal::DriveRequest::Enable);
  }
  EXPECT_EQ(f.mode(), Mode::Hold);
  EXPECT_EQ(f.sample().moving, 0);
  // Another commander takes over where the handle stands.
  EXPECT_EQ(f.send_from(9, CommandKind::Arm), ReplyCode::Done);
  EXPECT_EQ(f.controller->status().session, 9u);
}
INSTANTIATE_TEST_SUITE_P(Milliseconds, HostSilence, ::testing::Values(79, 80, 81));

TEST(ControllerCommands, ASilentHostHoldsAnArmedHandleToo) {
  FakeRig f;
  f.armed();
  f.host_talks = false;
  f.tick(81);
  EXPECT_EQ(f.mode(), Mode::Hold);
  EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
}

}  // namespace
}  // namespace trocar::controller
