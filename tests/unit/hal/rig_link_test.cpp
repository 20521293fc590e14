// Link, buses with bit times, simulated drives and sensor.
#include "hal/rig_link.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "common/rig/bus_budget.hpp"
#include "wired_rig.hpp"

namespace trocar::hal {
namespace {

using canopen::DriveState;

struct RigLinkTest : ::testing::Test {
  std::unique_ptr<WiredRig> owner = std::make_unique<WiredRig>();
  WiredRig& w = *owner;
  std::string step() { return w.link.bring_up_step(); }
  bool mentions(const char* text) { return step().find(text) != std::string::npos; }
};

TEST_F(RigLinkTest, BringsFourDrivesUpAndEnablesThem) {
  EXPECT_EQ(w.link.feedback().state, LinkState::Down);
  w.tick();
  EXPECT_EQ(w.link.feedback().state, LinkState::BringUp);
  ASSERT_TRUE(w.enable()) << step();
  EXPECT_LT(w.now_ns, 1'000'000'000);
  EXPECT_STREQ(w.link.bring_up_step(), "operational");
  w.tick();
  EXPECT_TRUE(w.answered);
  EXPECT_TRUE(w.link.feedback().complete);
  const LinkCounters counters = w.link.counters();
  EXPECT_EQ(counters.foreign_frames, 0u);
  EXPECT_EQ(counters.late_feedback, 0u);
  EXPECT_EQ(counters.drives_bus.send_dropped, 0u);
  for (const canopen::DriveCounters& drive : counters.drive) EXPECT_EQ(drive.sdo_aborts + drive.sdo_timeouts + drive.readback_errors, 0u);
}

TEST_F(RigLinkTest, BringsTheTwoDrivesOfASingleFiveBarUp) {
  WiredRig single{make_test_rig(rig::Kind::Single)};
  ASSERT_TRUE(single.enable());
  EXPECT_EQ(single.link.feedback().drives, 2u);
}

TEST_F(RigLinkTest, StaysWithinTheBusBudgetWhileEnabled) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm = {0.3, -0.2, 0.1, 0.4};
  const BusCounters before = w.link.counters().drives_bus;
  const std::int64_t busy_ns = w.drives_bus.busy_ns();
  const std::uint64_t bits = w.link.bus_report().drives_load.bits();
  for (int i = 0; i < 1000; ++i) w.tick();
  const double load_percent = static_cast<double>(w.drives_bus.busy_ns() - busy_ns) / 1e9 * 100;
  EXPECT_LT(load_percent, 73.0 + 1.5);  // cyclic worst case and the heartbeats
  EXPECT_GT(load_percent, 60.0);        // 6 frames of at least 47 + 64 bits
  // The link counts the same bits as the bus itself, but for the frames that are on their way at both ends of the count.
  const BusReport& report = w.link.bus_report();
  EXPECT_NEAR(static_cast<double>(report.drives_load.bits() - bits), static_cast<double>(w.drives_bus.busy_ns() - busy_ns) / 1000.0,
              5 * 135.0);
  const rig::BusBudget budget = rig::bus_budget(w.rig);
  EXPECT_LE(report.drives_load.most_in_a_tick(), budget.drives_peak_bits + 4 * rig::worst_case_can_bits(1));
  EXPECT_LE(report.sensor_load.most_in_a_tick(), budget.sensor_bits);
  EXPECT_GT(report.sensor_load.most_in_a_tick(), budget.sensor_bits * 3 / 4);
  const BusCounters after = w.link.counters().drives_bus;
  EXPECT_EQ(after.sent - before.sent, 2000u + 50u);  // SYNC, torque; a heartbeat every 20 ms
  EXPECT_EQ(after.received - before.received, 4000u + 200u);
}

TEST_F(RigLinkTest, NamesADriveThatIsAbsentAndBringsTheOthersUpToTheDoor) {
  w.powered[2] = false;
  EXPECT_FALSE(w.run_until([&] { return w.operational(); }, 1500));
  EXPECT_TRUE(mentions("drive 2 (node 3) does not answer")) << step();
  EXPECT_TRUE(mentions("supply")) << step();
  for (const std::size_t i : {0u, 1u, 3u}) EXPECT_EQ(w.drive[i].nmt_state(), canopen::NmtState::PreOperational);
  w.powered[2] = true;  // it is plugged in
  EXPECT_TRUE(w.bring_up()) << step();
}

TEST_F(RigLinkTest, RefusesAMappingThatReadsBackDifferently) {
  w.from_drive = [](std::size_t i, CanFrame& frame) {
    const bool mapping =
        i == 1 && frame.id == 0x582 && frame.data[0] == 0x43 && frame.data[1] == 0x00 && frame.data[2] == 0x1A && frame.data[3] == 2;
    if (mapping) frame.data[7] = 0x61;  // 6177h instead of 6077h
    return true;
  };
  EXPECT_FALSE(w.bring_up());
  EXPECT_TRUE(mentions("drive 1 (node 2)")) << step();
  EXPECT_TRUE(mentions("1A00h:02")) << step();
  EXPECT_TRUE(mentions("61770010h")) << step();
  EXPECT_TRUE(mentions("60770010h")) << step();
  EXPECT_GT(w.link.counters().drive[1].readback_errors, 0u);
  w.from_drive = nullptr;
  EXPECT_TRUE(w.bring_up());  // tried again by itself
}

TEST_F(RigLinkTest, RefusesARatedTorqueThatIsNotTheRigFiles) {
  rig::Rig other = make_test_rig();
  WiredRig wrong{other};
  other.actuation.continuous_current_a = 3.0;
  wrong.drive[0] = sim_plant::DriveNode{sim_plant::make_drive_config(other, 0)};
  EXPECT_FALSE(wrong.bring_up());
  const std::string text = wrong.link.bring_up_step();
  EXPECT_NE(text.find("6076h:00 reads 158"), std::string::npos) << text;
  EXPECT_NE(text.find("instead of 105"), std::string::npos) << text;
  EXPECT_NE(text.find("continuous_current_a"), std::string::npos) << text;
}

TEST_F(RigLinkTest, TellsTheAbortCodeOfARefusedObject) {
  w.from_drive = [](std::size_t i, CanFrame& frame) {
    if (i == 3 && frame.id == 0x584 && frame.data[1] == 0x07 && frame.data[2] == 0x60)
      frame = canopen::sdo_abort(0x584, {0x6007, 0, 2}, 0x06020000);
    return true;
  };
  EXPECT_FALSE(w.bring_up());
  EXPECT_TRUE(mentions("drive 3 (node 4) refused the writing of object 6007h:00 (object does not exist, abort code 06020000h)")) << step();
}

TEST_F(RigLinkTest, TellsWhichObjectWasNotAnswered) {
  w.from_drive = [](std::size_t i, CanFrame& frame) {
    return !(i == 0 && frame.id == 0x581 && frame.data[1] == 0x17 && frame.data[2] == 0x10);
  };
  EXPECT_FALSE(w.bring_up());
  EXPECT_TRUE(mentions("drive 0 (node 1) did not answer the writing of object 1017h:00")) << step();
  EXPECT_GT(w.link.counters().drive[0].sdo_timeouts, 0u);
}

TEST_F(RigLinkTest, IsNotOperationalBeforeEachFirstHeartbeat) {
  w.from_drive = [](std::size_t i, CanFrame& frame) { return !(i == 3 && frame.id == 0x704 && frame.data[0] == 5); };
  EXPECT_FALSE(w.bring_up());
  EXPECT_TRUE(mentions("drive 3 (node 4) sends no heartbeat")) << step();
}

TEST_F(RigLinkTest, TorqueActsExactlyOneSyncLater) {
  ASSERT_TRUE(w.enable());
  for (int i = 0; i < 3; ++i) w.tick();
  std::vector<std::int64_t> changes_ns;
  double last_nm = 0;
  w.each_step = [&] {
    const double torque_nm = w.drive[2].motor_torque_nm();
    if (torque_nm != last_nm) changes_ns.push_back(w.now_ns);
    last_nm = torque_nm;
  };
  w.command.joint_torque_nm = {0, 0, 0.84, 0};  // rated
  const std::int64_t decided_ns = w.now_ns;
  w.tick();
  EXPECT_TRUE(changes_ns.empty());
  w.tick();
  ASSERT_EQ(changes_ns.size(), 1u);
  EXPECT_EQ(changes_ns[0], decided_ns + 1'000'000 + 50'000);  // the step in which the next SYNC (48 us) has arrived
  EXPECT_NEAR(last_nm, 0.105, 1e-12);
  w.tick();
  EXPECT_EQ(changes_ns.size(), 1u);
}

TEST_F(RigLinkTest, FeedbackIsWhatTheSyncLatched) {
  ASSERT_TRUE(w.bring_up());
  // The angle moves during the tick; what counts is the value at the end of the SYNC, 48 us in: step 1.
  int step = 0;
  w.each_step = [&] {
    ++step;
    for (sim_plant::DriveNode& node : w.drive) node.set_shaft(step * 0.01, 0.42);
    w.sensor.set_wrench({1.0, -2.0, 3.0, 0.1, -0.2, 0.3});
  };
  w.tick();
  for (std::size_t i = 0; i < w.drive.size(); ++i) {
    const DriveFeedback& f = w.link.feedback().drive[i];
    EXPECT_TRUE(f.fresh);
    EXPECT_EQ(f.position_counts,
              static_cast<std::int32_t>(std::floor(0.01 * 16000 / (2 * std::numbers::pi))) + 1000 * static_cast<std::int32_t>(i));
    EXPECT_NEAR(f.joint_torque_nm, 0.42, 0.00042);  // half a permille of the rated torque
  }
  w.tick();
  const SensorFeedback& s = w.link.feedback().sensor;
  EXPECT_TRUE(s.fresh);
  EXPECT_FALSE(s.saturated);
  const std::array<double, 6> expected{1.0, -2.0, 3.0, 0.1, -0.2, 0.3};
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(s.force_torque[i], expected[i], i < 3 ? 0.5 / 400 : 0.5 / 20000);
}

TEST_F(RigLinkTest, SecondGateStopsWhatTheControllerMustNotSend) {
  ASSERT_TRUE(w.enable());
  const auto motor_after = [&](std::array<double, capacity::drives> torque_nm) {
    w.command.joint_torque_nm = torque_nm;
    for (int i = 0; i < 3; ++i) w.tick();
    return w.drive[0].motor_torque_nm();
  };
  EXPECT_NEAR(motor_after({0.21, 0, 0, 0}), 0.0525, 1e-12);
  EXPECT_EQ(motor_after({0.21, std::numeric_limits<double>::quiet_NaN(), 0, 0}), 0.0);
  EXPECT_NEAR(motor_after({1e6, 0, 0, 0}), 0.525, 1e-12);  // the peak
  EXPECT_EQ(w.link.counters().gate.clamped, 3u);
  EXPECT_EQ(w.link.counters().gate.not_finite, 3u);
  w.command.request = DriveRequest::Disable;
  EXPECT_EQ(motor_after({0.21, 0, 0, 0}), 0.0);
  EXPECT_GT(w.link.counters().gate.closed, 0u);
}

TEST_F(RigLinkTest, OneFaultedDriveTakesTheTorqueOfAll) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  EXPECT_GT(w.drive[0].motor_torque_nm(), 0.0);
  w.drive[3].trigger_fault(0x2310);
  w.tick();  // seen
  w.tick();  // zero torque applied
  EXPECT_TRUE(w.link.feedback().drive[3].faulted);
  EXPECT_EQ(w.link.feedback().drive[3].emcy_code, 0x2310);
  for (const sim_plant::DriveNode& node : w.drive) EXPECT_EQ(node.motor_torque_nm(), 0.0);
  EXPECT_TRUE(w.operational());  // the wire is well; what to do is the controller's decision

  for (int i = 0; i < 50; ++i) w.tick();
  EXPECT_EQ(w.drive[3].state(), DriveState::Fault);  // latched until asked
  w.command.reset_faults = true;
  w.tick();
  w.command.reset_faults = false;
  EXPECT_TRUE(w.run_until([&] { return w.all_enabled(); }, 30));
  EXPECT_EQ(w.link.feedback().drive[3].emcy_code, 0);
}

TEST_F(RigLinkTest, QuickStopReachesEveryDriveWithinFiveTicksAndItsTorqueIsZeroAfterOne) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  w.command.request = DriveRequest::QuickStop;  // torque still asked for: the gate does not care
  w.tick();
  w.tick();
  for (const sim_plant::DriveNode& node : w.drive) EXPECT_EQ(node.motor_torque_nm(), 0.0);
  for (int i = 0; i < 3; ++i) w.tick();
  for (const sim_plant::DriveNode& node : w.drive) EXPECT_NE(node.state(), DriveState::OperationEnabled);
}

TEST_F(RigLinkTest, MissedEndOfTickTakesTheTorqueAway) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  w.controller_alive = false;
  w.tick();
  EXPECT_GT(w.drive[0].motor_torque_nm(), 0.0);  // of the last command
  w.tick();                                      // sends zero with its SYNC
  w.tick();                                      // applied
  EXPECT_EQ(w.drive[0].motor_torque_nm(), 0.0);
  EXPECT_EQ(w.link.counters().missed_ends, 2u);
}

TEST_F(RigLinkTest, DrivesStopByThemselvesWhenTheControllerVanishes) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  std::int64_t last_frame_ns = 0;
  w.to_drive = [&](std::size_t, CanFrame& frame) {
    if (frame.id == 0x200) last_frame_ns = w.now_ns;
    return true;
  };
  w.tick();
  ASSERT_GT(last_frame_ns, 0);
  std::int64_t off_ns = 0;
  for (int i = 0; i < 600 && off_ns == 0; ++i) {  // 30 ms without any tick
    w.step_plant();
    if (w.drive[1].motor_torque_nm() == 0.0) off_ns = w.now_ns - WiredRig::step_ns;
  }
  EXPECT_EQ(off_ns - last_frame_ns, 20'000'000);
  EXPECT_EQ(w.drive[1].state(), DriveState::Fault);
  w.tick();
  EXPECT_EQ(w.link.feedback().drive[1].emcy_code, canopen::emcy_rpdo_timeout);
}

TEST_F(RigLinkTest, LostDriveEndsOperationTorqueAndIsNamed) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  w.powered[1] = false;
  w.tick();
  EXPECT_FALSE(w.answered);
  EXPECT_FALSE(w.link.feedback().complete);
  EXPECT_FALSE(w.link.feedback().drive[1].fresh);
  EXPECT_TRUE(w.link.feedback().drive[0].fresh);
  EXPECT_TRUE(w.run_until([&] { return !w.operational(); }, 62));
  EXPECT_FALSE(w.link.feedback().drive[1].heartbeat_ok);
  EXPECT_TRUE(w.link.feedback().drive[0].heartbeat_ok);
  EXPECT_TRUE(mentions("drive 1 (node 2): its heartbeat stopped")) << step();
  w.tick();
  w.tick();
  EXPECT_EQ(w.drive[0].motor_torque_nm(), 0.0);
}

TEST_F(RigLinkTest, FeedbackOfAnEarlierTickIsNotFresh) {
  ASSERT_TRUE(w.bring_up());
  std::vector<CanFrame> held;
  w.from_drive = [&](std::size_t i, CanFrame& frame) {
    if (i != 0 || frame.id != 0x181) return true;
    held.push_back(frame);
    return false;
  };
  w.tick();
  EXPECT_FALSE(w.answered);
  w.from_drive = nullptr;
  ASSERT_EQ(held.size(), 1u);
  w.drives_bus.port(1).send(held[0], w.now_ns - 200'000);
  w.drives_bus.advance(w.now_ns);  // arrives just before the next tick begins
  const std::uint64_t late = w.link.counters().late_feedback;
  w.now_ns += 200'000;
  w.link.begin_tick(w.now_ns);
  EXPECT_EQ(w.link.counters().late_feedback, late + 1);
  EXPECT_FALSE(w.link.poll(w.now_ns));
  EXPECT_FALSE(w.link.feedback().drive[0].fresh);
}

TEST_F(RigLinkTest, SilentSensorIsNamedAndNotFresh) {
  w.sensor_powered = false;
  ASSERT_TRUE(w.bring_up());
  w.tick();
  EXPECT_FALSE(w.answered);
  EXPECT_TRUE(w.link.feedback().complete);
  EXPECT_FALSE(w.link.feedback().sensor.fresh);
  EXPECT_TRUE(mentions("force sensor does not answer to identifier 1B0h")) << step();
}

TEST_F(RigLinkTest, SaturatedSensorSaysSo) {
  ASSERT_TRUE(w.bring_up());
  w.sensor.set_wrench({100.0, 0, 0, 0, 0, 0});  // 40000 counts
  w.tick();
  w.tick();
  EXPECT_TRUE(w.link.feedback().sensor.saturated);
  EXPECT_NE(w.link.feedback().sensor.status & ati::status_saturated, 0);
}

TEST_F(RigLinkTest, ShutsDownToPreOperationalWithoutTorque) {
  ASSERT_TRUE(w.enable());
  w.command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 3; ++i) w.tick();
  w.link.shut_down(w.now_ns);
  EXPECT_EQ(w.link.feedback().state, LinkState::Down);
  for (int i = 0; i < 40; ++i) w.step_plant();
  for (const sim_plant::DriveNode& node : w.drive) {
    EXPECT_EQ(node.nmt_state(), canopen::NmtState::PreOperational);
    EXPECT_EQ(node.state(), DriveState::QuickStopActive);
    EXPECT_EQ(node.motor_torque_nm(), 0.0);
    EXPECT_EQ(node.counters().faults, 0u);
  }
  const std::uint64_t sent = w.link.counters().drives_bus.sent;
  w.tick();
  EXPECT_EQ(w.link.counters().drives_bus.sent, sent);  // silent from then on
  EXPECT_STREQ(w.link.bring_up_step(), "shut down");
}

TEST_F(RigLinkTest, NextControllerTakesOverFromOneThatDied) {
  ASSERT_TRUE(w.enable());
  for (int i = 0; i < 2000; ++i) w.step_plant();  // 100 ms without a controller: heartbeat lost, faults
  RigLink<MemoryPort> next{w.rig, w.drives_bus.port(0), w.sensor_bus.port(0)};
  LinkCommand command{.request = DriveRequest::Enable, .reset_faults = true};
  const auto enabled = [&] {
    for (std::size_t i = 0; i < 4; ++i)
      if (!next.feedback().drive[i].enabled) return false;
    return true;
  };
  for (int t = 0; t < 1500 && !enabled(); ++t) {
    next.begin_tick(w.now_ns);
    for (int s = 0; s < WiredRig::feedback_step; ++s) w.step_plant();
    next.poll(w.now_ns);
    next.end_tick(w.now_ns, command);
    for (int s = WiredRig::feedback_step; s < WiredRig::steps_per_tick; ++s) w.step_plant();
  }
  EXPECT_TRUE(enabled()) << next.bring_up_step();
}

// A bus that plays back what it is given: error reports never travel on a wire.
struct ScriptedBus {
  bool send(const CanFrame&, std::int64_t) noexcept {
    ++count.sent;
    return true;
  }
  void flush(std::int64_t) noexcept {}
  bool receive(CanFrame& frame, std::int64_t) noexcept { return arrived.pop(frame); }
  [[nodiscard]] const BusCounters& counters() const noexcept { return count; }
  [[nodiscard]] int file_descriptor() const noexcept { return -1; }
  Fifo<CanFrame, 4> arrived;
  BusCounters count;
};

TEST(RigLink, IsDownAndSilentOnceItsControllerIsOffTheBus) {
  ScriptedBus drives;
  ScriptedBus sensor;
  RigLink<ScriptedBus> link{make_test_rig(), drives, sensor};
  link.begin_tick(0);
  CanFrame report{.id = 0x04, .length = 8};  // controller warning: noted, no more
  report.error = true;
  ASSERT_TRUE(drives.arrived.push(report));
  link.poll(0);
  EXPECT_EQ(link.feedback().state, LinkState::BringUp);
  report.id = error_class_bus_off;
  ASSERT_TRUE(drives.arrived.push(report));
  link.poll(0);
  link.begin_tick(1'000'000);
  EXPECT_EQ(link.feedback().state, LinkState::Down);
  const std::uint64_t sent = drives.count.sent;
  link.end_tick(1'500'000, {.request = DriveRequest::Enable});
  link.begin_tick(2'000'000);
  EXPECT_EQ(drives.count.sent, sent);
  EXPECT_NE(std::string{link.bring_up_step()}.find("off the bus"), std::string::npos);
}

TEST_F(RigLinkTest, SameInputsGiveTheSameBusTraffic) {
  const auto trace = [] {
    WiredRig rig;
    std::uint32_t sum = 2166136261u;
    rig.to_drive = rig.from_drive = [&](std::size_t i, CanFrame& frame) {
      for (const std::uint64_t value :
           {std::uint64_t{i}, std::uint64_t{frame.id}, load<std::uint64_t>(frame, 0), static_cast<std::uint64_t>(rig.now_ns)})
        sum = (sum ^ static_cast<std::uint32_t>(value ^ (value >> 32))) * 16777619u;
      return true;
    };
    rig.enable();
    return std::pair{sum, rig.now_ns};
  };
  EXPECT_EQ(trace(), trace());
}

}  // namespace
}  // namespace trocar::hal
