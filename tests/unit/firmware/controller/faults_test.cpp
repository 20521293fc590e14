#include <gtest/gtest.h>

#include <limits>
#include <string>

#include "fake_rig.hpp"

namespace trocar::controller {
namespace {

void expect_fault(const FakeRig& f, Fault fault) {
  EXPECT_EQ(f.mode(), Mode::Fault);
  EXPECT_EQ(f.fault(), fault) << to_string(f.fault());
  EXPECT_TRUE(f.torque_finite);
}

TEST(ControllerFaults, MissedFeedbackIsBorneUpToItsLimit) {
  FakeRig f;
  f.moving();
  f.drives_answer = false;
  f.follows = false;
  f.tick(20);
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_EQ(f.sample().missed_feedback, 20u);
  f.tick(1);
  expect_fault(f, Fault::FeedbackLost);
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.last_answer(), ReplyCode::Stopped);
}

TEST(ControllerFaults, FirstCauseStaysWhenASecondFollows) {
  FakeRig f;
  f.positioned();
  f.late_ns = 3 * FakeRig::ms;
  f.tick();
  expect_fault(f, Fault::LateTick);
  f.feedback.drive[1].faulted = true;
  f.tick(50);
  expect_fault(f, Fault::LateTick);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, SilentSensorHoldsUnderControl) {
  FakeRig f;
  f.moving();
  f.sensor_answers = false;
  f.tick(50);
  EXPECT_EQ(f.mode(), Mode::Position);
  f.tick(1);
  expect_fault(f, Fault::SensorLost);
  f.tick(500);
  EXPECT_EQ(f.sample().moving, 0);
  EXPECT_EQ(f.out.request, hal::DriveRequest::Enable);
  EXPECT_TRUE(std::isfinite(f.sample().setpoint_pose[0]));
}

// A handle that is held in a fault still has torque: what the measurement loses has to end it.
TEST(ControllerFaults, LosingTheEncodersWhileHeldInAFaultTakesTheTorque) {
  FakeRig f;
  f.positioned();
  f.sensor_answers = false;
  f.tick(60);
  expect_fault(f, Fault::SensorLost);
  ASSERT_EQ(f.out.request, hal::DriveRequest::Enable);
  f.drives_answer = false;
  f.tick(21);
  expect_fault(f, Fault::SensorLost);  // the first cause stays
  EXPECT_TRUE(f.torque_free());
  f.drives_answer = true;
  f.tick(10);
  EXPECT_TRUE(f.torque_free());
  // And the counts are no longer trusted after it.
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  EXPECT_FALSE(f.controller->status().homed);
}

TEST(ControllerFaults, StopTakesTheTorqueWhileHeldInAFault) {
  FakeRig f;
  f.moving();
  f.sensor_answers = false;
  f.tick(60);
  expect_fault(f, Fault::SensorLost);
  EXPECT_EQ(f.send_from(99, CommandKind::Stop), ReplyCode::Done);
  f.tick(500);
  expect_fault(f, Fault::SensorLost);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, ACommanderThatDiedInAFaultDoesNotLockTheRig) {
  FakeRig f;
  f.positioned();
  f.late_ns = 3 * FakeRig::ms;
  f.tick();
  f.late_ns = 0;
  f.host_talks = false;
  f.tick(10);
  EXPECT_EQ(f.send_from(9, CommandKind::ResetFault), ReplyCode::SessionTaken);
  f.tick(100);
  EXPECT_EQ(f.send_from(9, CommandKind::ResetFault), ReplyCode::Done);
}

struct Case {
  const char* name;
  Fault fault;
  void (*break_it)(FakeRig&);
};

struct EachFault : ::testing::TestWithParam<Case> {};

// Broken for three ticks: the fault comes with its reaction, and stays after the cause has gone.
TEST_P(EachFault, LatchesWithItsReaction) {
  for (const bool in_motion : {false, true}) {
    FakeRig f;
    in_motion ? f.moving() : f.positioned();
    ASSERT_EQ(f.mode(), Mode::Position);
    f.follows = false;
    const hal::Feedback before = f.feedback;
    GetParam().break_it(f);
    f.tick(3);
    expect_fault(f, GetParam().fault);
    EXPECT_EQ(f.count(EventKind::FaultLatched), 1u);
    f.feedback = before;
    f.late_ns = 0;
    f.tick(500);
    expect_fault(f, GetParam().fault);
    const auto reaction = safety::row(GetParam().fault).reaction;
    EXPECT_EQ(f.torque_free(), reaction != safety::Reaction::Hold);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Faults, EachFault,
    ::testing::Values(Case{"Drive", Fault::DriveFault, [](FakeRig& f) { f.feedback.drive[2].faulted = true; }},
                      Case{"Heartbeat", Fault::HeartbeatLost, [](FakeRig& f) { f.feedback.drive[3].heartbeat_ok = false; }},
                      Case{"LinkLost", Fault::DriveFault, [](FakeRig& f) { f.feedback.state = hal::LinkState::BringUp; }},
                      Case{"Late", Fault::LateTick, [](FakeRig& f) { f.late_ns = 2 * FakeRig::ms + 1; }},
                      Case{"Jump", Fault::EncoderJump, [](FakeRig& f) { f.feedback.drive[0].position_counts += 4000; }},
                      Case{"HugeCounts", Fault::EncoderJump,
                           [](FakeRig& f) {
                             f.feedback.drive[0].position_counts = std::numeric_limits<std::int32_t>::max();
                             f.feedback.drive[1].position_counts = std::numeric_limits<std::int32_t>::min();
                           }},
                      Case{"NaNForce", Fault::NotFinite,
                           [](FakeRig& f) { f.feedback.sensor.force_torque[1] = std::numeric_limits<double>::quiet_NaN(); }},
                      Case{"Saturated", Fault::SensorSaturated, [](FakeRig& f) { f.feedback.sensor.saturated = true; }},
                      Case{"Force", Fault::ForceLimit, [](FakeRig& f) { f.feedback.sensor.force_torque[0] = 10.01; }},
                      Case{"Moment", Fault::ForceLimit, [](FakeRig& f) { f.feedback.sensor.force_torque[5] = -0.101; }}),
    [](const auto& c) { return std::string(c.param.name); });

TEST(ControllerFaults, LateUpToTheLimitIsBorne) {
  FakeRig f;
  f.positioned();
  f.late_ns = 2 * FakeRig::ms;
  f.tick(5);
  EXPECT_EQ(f.mode(), Mode::Position);
  EXPECT_EQ(f.controller->status().ticks_late, 0u);
}

TEST(ControllerFaults, OneEncoderThatDriftsIsInconsistent) {
  FakeRig f;
  f.positioned();
  f.follows = false;
  // Slowly, so that neither jump nor speed tells: only the fourth encoder can.
  for (int i = 0; i < 400 && f.mode() == Mode::Position; ++i) {
    if (i % 5 == 0) f.feedback.drive[1].position_counts += 1;
    f.tick();
  }
  expect_fault(f, Fault::Inconsistent);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, HandleThatDoesNotFollowIsATrackingError) {
  FakeRig f;
  f.positioned();
  f.follows = false;
  ASSERT_EQ(f.move(0.0, 0.15, f.pose[2]), ReplyCode::Accepted);
  f.tick(600);
  expect_fault(f, Fault::TrackingError);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, HandThatThrowsTheArmedHandleIsAVelocityLimit) {
  FakeRig f;
  f.armed();
  for (int i = 0; i < 100 && f.mode() == Mode::Armed; ++i) {
    f.stand_at({0.0, f.pose[1] + 0.0004, f.pose[2]});  // 0.4 m/s
    f.tick();
  }
  expect_fault(f, Fault::VelocityLimit);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, HandThatLeavesTheWorkspaceStopsTheMachine) {
  FakeRig f;
  f.armed();
  for (int i = 0; i < 1000 && f.mode() == Mode::Armed; ++i) {
    f.stand_at({0.0, f.pose[1] - 0.0001, f.pose[2]});
    f.tick();
  }
  expect_fault(f, Fault::WorkspaceLimit);
  EXPECT_LT(f.pose[1], 0.098 - 0.0058);
  f.tick(500);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, ResetIsExplicitAndAsksForHomingAfterPositionFaults) {
  FakeRig f;
  f.positioned();
  f.follows = false;
  f.feedback.drive[0].position_counts += 4000;
  f.tick();
  expect_fault(f, Fault::EncoderJump);
  f.feedback.drive[0].position_counts -= 4000;
  f.tick(2000);
  expect_fault(f, Fault::EncoderJump);
  for (const CommandKind kind : {CommandKind::Arm, CommandKind::Move, CommandKind::Home, CommandKind::Hold, CommandKind::Tare})
    EXPECT_NE(f.send(kind), ReplyCode::Accepted) << to_string(kind);
  expect_fault(f, Fault::EncoderJump);
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  EXPECT_TRUE(f.out.reset_faults);
  EXPECT_EQ(f.fault(), Fault::None);
  f.tick();
  EXPECT_EQ(f.mode(), Mode::Ready);
  EXPECT_FALSE(f.out.reset_faults);
  EXPECT_TRUE(f.torque_free());
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::NotHomed);
}

TEST(ControllerFaults, ResetKeepsTheHomingWhenThePositionsWereNeverInDoubt) {
  FakeRig f;
  f.positioned();
  f.feedback.sensor.saturated = true;
  f.tick();
  expect_fault(f, Fault::SensorSaturated);
  f.feedback.sensor.saturated = false;
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  f.tick(60);
  EXPECT_TRUE(f.controller->status().homed);
  EXPECT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
  f.tick(5);
  EXPECT_EQ(f.mode(), Mode::Armed);
}

TEST(ControllerFaults, ResetIsRefusedWhileTheLinkIsDown) {
  FakeRig f;
  f.positioned();
  f.feedback.state = hal::LinkState::Down;
  f.tick();
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::StillFaulty);
  f.feedback.state = hal::LinkState::Operational;
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  EXPECT_FALSE(f.controller->status().homed);
}

TEST(ControllerFaults, DrivesThatLostTheirPowerInAFaultAreHomedAgain) {
  FakeRig f;
  f.positioned();
  f.late_ns = 3 * FakeRig::ms;
  f.tick();
  f.late_ns = 0;
  expect_fault(f, Fault::LateTick);
  f.feedback.state = hal::LinkState::BringUp;
  f.drives_answer = false;
  f.tick(100);
  f.feedback.state = hal::LinkState::Operational;
  f.drives_answer = true;
  f.tick(10);
  EXPECT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  EXPECT_FALSE(f.controller->status().homed);
}

TEST(ControllerFaults, StopStaysAskedForWhenAFaultComesWhileItBrakes) {
  FakeRig f;
  f.moving();
  ASSERT_EQ(f.send(CommandKind::Stop), ReplyCode::Done);
  ASSERT_EQ(f.sample().moving, 1);
  f.feedback.sensor.saturated = true;
  f.tick();
  expect_fault(f, Fault::SensorSaturated);
  f.tick(500);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, DisarmTakesTheTorqueWhileHeldInAFault) {
  FakeRig f;
  f.positioned();
  f.feedback.sensor.saturated = true;
  f.tick(2);
  expect_fault(f, Fault::SensorSaturated);
  ASSERT_FALSE(f.torque_free());
  EXPECT_EQ(f.send(CommandKind::Disarm), ReplyCode::Done);
  EXPECT_TRUE(f.torque_free());
}

TEST(ControllerFaults, RigWorksAgainAfterANaNOfTheSensor) {
  FakeRig f;
  f.positioned();
  f.feedback.sensor.force_torque[0] = std::numeric_limits<double>::quiet_NaN();
  f.tick(3);
  expect_fault(f, Fault::NotFinite);
  f.feedback.sensor.force_torque[0] = 0.0;
  ASSERT_EQ(f.send(CommandKind::ResetFault), ReplyCode::Done);
  f.tick(60);
  ASSERT_EQ(f.send(CommandKind::Tare), ReplyCode::Accepted);
  f.tick(300);
  ASSERT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
  f.tick(5);
  EXPECT_EQ(f.move(0.0, 0.13, f.pose[2]), ReplyCode::Accepted);
  f.tick(500);
  EXPECT_EQ(f.mode(), Mode::Position) << to_string(f.fault());
  EXPECT_TRUE(f.torque_finite);
}

}  // namespace
}  // namespace trocar::controller
