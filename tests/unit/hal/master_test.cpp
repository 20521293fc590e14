// The master against simulated drives without a bus in between: every frame arrives at once, time is a number.
#include "hal/canopen/master.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "rig_fixture.hpp"
#include "sim_plant/nodes/drive_node.hpp"

namespace trocar::hal::canopen {
namespace {

struct MasterTest : ::testing::Test {
  MasterTest() {
    for (std::size_t i = 0; i < rig.drives(); ++i) drive.emplace_back(sim_plant::make_drive_config(rig, i));
  }
  void exchange() {
    for (sim_plant::DriveNode& node : drive) {
      node.advance(now_ns);
      CanFrame frame;
      while (node.transmit(frame)) {
        if (from_drive) from_drive(frame);
        master.receive(frame, now_ns);
      }
    }
  }
  bool send_one() {
    CanFrame frame;
    if (!master.next_frame(now_ns, request, false, frame)) return false;
    sent.push_back(frame);
    for (sim_plant::DriveNode& node : drive) node.receive(frame, now_ns);
    return true;
  }
  void tick() {
    for (sim_plant::DriveNode& node : drive) node.receive(CanFrame{.id = cob_sync}, now_ns);
    exchange();
    master.supervise(now_ns);
    for (sim_plant::DriveNode& node : drive) node.receive(CanFrame{.id = cob_torque, .length = 8}, now_ns);
    send_one();
    now_ns += ns_per_ms;
  }
  bool bring_up() {
    for (int i = 0; i < 2000 && !master.operational(); ++i) tick();
    return master.operational();
  }

  rig::Rig rig = make_test_rig();
  Master master{rig};
  std::vector<sim_plant::DriveNode> drive;
  std::vector<CanFrame> sent;
  std::function<void(CanFrame&)> from_drive;  // may change it
  DriveRequest request{};
  std::int64_t now_ns{};
};

TEST_F(MasterTest, BringsAllDrivesUpWithinASecond) {
  ASSERT_TRUE(bring_up());
  EXPECT_LT(now_ns, 1'000 * ns_per_ms);
  EXPECT_EQ(master.blocking_drive(), master.drives());
  for (std::size_t i = 0; i < drive.size(); ++i) {
    EXPECT_EQ(drive[i].nmt_state(), NmtState::Operational);
    const sim_plant::ObjectDictionary& objects = drive[i].objects();
    EXPECT_EQ(objects.get({0x1600, static_cast<std::uint8_t>(i + 1), 4}), 0x60710010u);
    EXPECT_EQ(objects.get({0x1600, static_cast<std::uint8_t>(i == 0 ? 2 : 1), 4}), 0x00030010u);
    EXPECT_EQ(objects.get({0x1400, 1, 4}), 0x200u);
    EXPECT_EQ(objects.get({0x1401, 1, 4}), 0x301u + i);
    EXPECT_EQ(objects.get({0x1800, 1, 4}) & 0x7FF, 0x181u + i);
    EXPECT_EQ(objects.get({0x1016, 1, 4}), (127u << 16) | 60u);
    EXPECT_EQ(objects.get({0x1017, 0, 2}), 20u);
    EXPECT_EQ(objects.get({0x6061, 0, 1}), 10u);
  }
}

TEST_F(MasterTest, BringsUpADriveThatPutsEveryNumberIntoASegment) {
  CanFrame value;
  int segments = 0;
  from_drive = [&](CanFrame& frame) {
    if (frame.id != cob_sdo_response(1)) return;
    if ((frame.data[0] & 0xE2) == 0x42) {
      value = frame;
      frame = sdo_segmented_upload_answer(1, decode_sdo_answer(frame).object, 4u - ((frame.data[0] >> 2) & 3u));
    } else if (frame.data[0] == 0x80) {  // the drive itself knows of no such transfer
      ++segments;
      const std::size_t bytes = 4u - ((value.data[0] >> 2) & 3u);
      frame = sdo_segment(cob_sdo_response(1), 0, std::span{value.data}.subspan(4, bytes), true);
    }
  };
  ASSERT_TRUE(bring_up());
  EXPECT_GT(segments, 20);
  EXPECT_EQ(master.drive(0).counters().sdo_aborts, 0u);
}

TEST_F(MasterTest, TellsADriveWhyItsSegmentsAreNotTaken) {
  from_drive = [&](CanFrame& frame) {
    if (frame.id == cob_sdo_response(1) && frame.data[0] == 0x43) frame = sdo_segmented_upload_answer(1, {0x1000, 0, 4}, 5);
  };
  for (int i = 0; i < 200; ++i) tick();
  EXPECT_EQ(master.drive(0).report().problem, DriveProblem::SdoAborted);
  EXPECT_TRUE(std::any_of(sent.begin(), sent.end(), [](const CanFrame& f) { return f.id == 0x601 && f.data[0] == 0x80; }));
}

TEST_F(MasterTest, StartsNoDriveBeforeAllAreConfigured) {
  ASSERT_TRUE(bring_up());
  std::size_t last_sdo = 0;
  std::size_t first_start = sent.size();
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (sent[i].id >= 0x600 && sent[i].id < 0x680) last_sdo = i;
    if (sent[i].id == cob_nmt && sent[i].data[0] == 1 && first_start == sent.size()) first_start = i;
  }
  EXPECT_LT(last_sdo, first_start);
}

TEST_F(MasterTest, LeavesTheTickAfterARequestToItsAnswer) {
  bool request_before = false;
  for (int i = 0; i < 400; ++i) {
    const std::size_t before = sent.size();
    tick();
    ASSERT_LE(sent.size(), before + 1);
    const bool request_now = sent.size() > before && sent.back().id >= 0x600 && sent.back().id < 0x680;
    EXPECT_FALSE(request_before && request_now);
    request_before = request_now;
  }
}

TEST_F(MasterTest, ProducesItsHeartbeatOnTimeEvenDuringBringUp) {
  std::int64_t last_ns = -1;
  for (int i = 0; i < 500; ++i) {
    const std::int64_t at_ns = now_ns;
    const std::size_t before = sent.size();
    tick();
    if (sent.size() == before || sent.back().id != 0x77Fu) continue;
    EXPECT_EQ(sent.back().data[0], 5);
    if (last_ns >= 0) {
      EXPECT_LE(at_ns - last_ns, 21 * ns_per_ms);
    }
    last_ns = at_ns;
  }
  EXPECT_GE(last_ns, 479 * ns_per_ms);
}

TEST_F(MasterTest, LosesADriveAtItsHeartbeatTimeoutAndNotBefore) {
  for (const std::int64_t elapsed : {std::int64_t{-1}, std::int64_t{0}, std::int64_t{1}}) {
    Master fresh{rig};
    master = fresh;
    for (sim_plant::DriveNode& node : drive) node.restart();
    ASSERT_TRUE(bring_up());
    const std::int64_t heard_ns = now_ns;
    for (std::size_t i = 0; i < drive.size(); ++i)
      master.receive(heartbeat_frame(rig.buses.drive_node[i], NmtState::Operational), heard_ns);
    for (std::size_t i = 0; i < drive.size(); ++i)  // all others speak again
      if (i != 2) master.receive(heartbeat_frame(rig.buses.drive_node[i], NmtState::Operational), heard_ns + 30 * ns_per_ms);
    master.supervise(heard_ns + 60 * ns_per_ms + elapsed);
    EXPECT_EQ(master.drive(2).running(), elapsed < 0) << elapsed;
    EXPECT_TRUE(master.drive(1).running());
    EXPECT_EQ(master.operational(), elapsed < 0);
    if (elapsed >= 0) {
      EXPECT_EQ(master.blocking_drive(), 2u);
      EXPECT_EQ(master.drive(2).report().problem, DriveProblem::HeartbeatLost);
    }
  }
}

TEST_F(MasterTest, NoticesADriveThatRestartsOrLeavesOperational) {
  ASSERT_TRUE(bring_up());
  drive[1].restart();
  tick();
  EXPECT_FALSE(master.operational());
  EXPECT_EQ(master.drive(1).report().problem, DriveProblem::Rebooted);
  ASSERT_TRUE(bring_up());

  master.receive(heartbeat_frame(3, NmtState::PreOperational), now_ns);
  EXPECT_FALSE(master.operational());
  EXPECT_EQ(master.drive(2).report().problem, DriveProblem::LeftOperational);
  ASSERT_TRUE(bring_up());  // by itself, through a communication reset
}

TEST_F(MasterTest, EnablesDisablesAndQuickStops) {
  ASSERT_TRUE(bring_up());
  request = DriveRequest::Enable;
  for (int i = 0; i < 40; ++i) tick();
  EXPECT_TRUE(master.all_enabled());
  request = DriveRequest::QuickStop;
  for (int i = 0; i < 10; ++i) tick();
  for (const sim_plant::DriveNode& node : drive) EXPECT_EQ(node.state(), DriveState::SwitchOnDisabled);
  request = DriveRequest::Enable;
  for (int i = 0; i < 40; ++i) tick();
  EXPECT_TRUE(master.all_enabled());
  request = DriveRequest::Disable;
  for (int i = 0; i < 10; ++i) tick();
  for (const sim_plant::DriveNode& node : drive) EXPECT_EQ(node.state(), DriveState::SwitchOnDisabled);
}

TEST_F(MasterTest, RepeatsAControlwordThatHadNoEffect) {
  ASSERT_TRUE(bring_up());
  request = DriveRequest::Enable;
  // The drives do not hear it: only their old feedback comes.
  std::size_t words = 0;
  CanFrame frame;
  for (int i = 0; i < 50; ++i) {
    for (std::size_t n = 0; n < drive.size(); ++n) master.receive(heartbeat_frame(rig.buses.drive_node[n], NmtState::Operational), now_ns);
    if (master.next_frame(now_ns, request, false, frame) && frame.id == cob_controlword(1)) ++words;
    now_ns += ns_per_ms;
  }
  EXPECT_GE(words, 4u);
  EXPECT_LE(words, 6u);  // every 10 ms, not every tick
}

TEST_F(MasterTest, TakesNoNoticeOfFramesThatAreNotItsOwn) {
  EXPECT_FALSE(master.receive(CanFrame{.id = 0x185, .length = 8}, 0));  // node 5 is not in the rig
  EXPECT_FALSE(master.receive(CanFrame{.id = 0x281, .length = 8}, 0));
  CanFrame extended{.id = 0x181, .length = 8};
  extended.extended = true;
  EXPECT_FALSE(master.receive(extended, 0));
  EXPECT_TRUE(master.receive(CanFrame{.id = 0x181, .length = 7}, 0));
  EXPECT_FALSE(master.drive(0).fresh());
  EXPECT_EQ(master.drive(0).counters().malformed, 1u);
}

}  // namespace
}  // namespace trocar::hal::canopen
