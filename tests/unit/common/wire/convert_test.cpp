#include <gtest/gtest.h>

#include <memory>
#include <tuple>

#include "common/wire/convert.hpp"

namespace {

using namespace trocar;

Sample distinct_sample() {
  Sample s;
  s.tick = 1234567890123ull;
  s.time_ns = -42;
  s.mode = Mode::Position;
  s.fault = Fault::Singular;
  s.moving = 1;
  s.gain_set = 3;
  s.command_id = 77;
  double next = 0.125;
  for (auto& v : s.position_counts) v = static_cast<std::int32_t>(-1000 * (next += 1));
  for (auto* a : {&s.joint_torque_command_nm, &s.joint_torque_measured_nm}) {
    for (auto& v : *a) v = next += 1;
  }
  for (auto* a : {&s.pose, &s.velocity, &s.setpoint_pose, &s.setpoint_velocity, &s.wrench_command, &s.base_wrench}) {
    for (auto& v : *a) v = next += 1;
  }
  s.residual_m = next += 1;
  s.singularity = next += 1;
  s.missed_feedback = 9;
  s.wakeup_late_us = 1.5f;
  s.tick_us = 2.5f;
  for (auto* a : {&s.handle_wrench, &s.virtual_pose, &s.virtual_wrench}) {
    for (auto& v : *a) v = next += 1;
  }
  s.display_energy_j = next += 1;
  s.virtual_contacts = 11;
  s.virtual_status = 7;
  return s;
}

// Distinct values in every field: an exchanged or forgotten one differs.
TEST(Convert, LoopCountersComeBackAsTheyWere) {
  const LoopCounters loop{1, 2, 3, 4, 5, 6, 7};
  wire::Status status{};
  wire::put_loop(loop, status);
  EXPECT_EQ(status.tick, 0u);
  const LoopCounters back = wire::loop_of(status);
  EXPECT_EQ(back.overruns, 1u);
  EXPECT_EQ(back.minor_faults, 2u);
  EXPECT_EQ(back.major_faults, 3u);
  EXPECT_EQ(back.preemptions, 4u);
  EXPECT_EQ(back.allocations, 5u);
  EXPECT_EQ(back.armed_page_faults, 6u);
  EXPECT_EQ(back.armed_allocations, 7u);
}

TEST(Convert, SampleSurvivesTheRoundTripFieldByField) {
  const Sample s = distinct_sample();
  const Sample r = wire::from_wire(wire::to_wire(s));
  EXPECT_EQ(r.tick, s.tick);
  EXPECT_EQ(r.time_ns, s.time_ns);
  EXPECT_EQ(r.mode, s.mode);
  EXPECT_EQ(r.fault, s.fault);
  EXPECT_EQ(r.moving, s.moving);
  EXPECT_EQ(r.gain_set, s.gain_set);
  EXPECT_EQ(r.command_id, s.command_id);
  EXPECT_EQ(r.position_counts, s.position_counts);
  EXPECT_EQ(r.joint_torque_command_nm, s.joint_torque_command_nm);
  EXPECT_EQ(r.joint_torque_measured_nm, s.joint_torque_measured_nm);
  EXPECT_EQ(r.pose, s.pose);
  EXPECT_EQ(r.velocity, s.velocity);
  EXPECT_EQ(r.setpoint_pose, s.setpoint_pose);
  EXPECT_EQ(r.setpoint_velocity, s.setpoint_velocity);
  EXPECT_EQ(r.wrench_command, s.wrench_command);
  EXPECT_EQ(r.base_wrench, s.base_wrench);
  EXPECT_EQ(r.residual_m, s.residual_m);
  EXPECT_EQ(r.singularity, s.singularity);
  EXPECT_EQ(r.missed_feedback, s.missed_feedback);
  EXPECT_EQ(r.wakeup_late_us, s.wakeup_late_us);
  EXPECT_EQ(r.tick_us, s.tick_us);
  EXPECT_EQ(r.handle_wrench, s.handle_wrench);
  EXPECT_EQ(r.virtual_pose, s.virtual_pose);
  EXPECT_EQ(r.virtual_wrench, s.virtual_wrench);
  EXPECT_EQ(r.display_energy_j, s.display_energy_j);
  EXPECT_EQ(r.virtual_contacts, s.virtual_contacts);
  EXPECT_EQ(r.virtual_status, s.virtual_status);
}

TEST(Convert, WireSampleNamesTheSameFieldsAsTheContract) {
  const Sample s = distinct_sample();
  const wire::Sample w = wire::to_wire(s);
  EXPECT_EQ(w.pose[1], s.pose[1]);
  EXPECT_EQ(w.setpoint_pose[1], s.setpoint_pose[1]);
  EXPECT_EQ(w.base_wrench[2], s.base_wrench[2]);
  EXPECT_EQ(w.wrench_command[2], s.wrench_command[2]);
  EXPECT_EQ(w.joint_torque_command_nm[3], s.joint_torque_command_nm[3]);
  EXPECT_EQ(w.mode, 3);
  EXPECT_EQ(w.fault, 13);
}

TEST(Convert, EventAndReplySurviveTheRoundTrip) {
  const Event e{5, 6, EventKind::Limited, Mode::Armed, Mode::Fault, Fault::ForceLimit, 7.5, 8.5};
  const wire::Event we = wire::to_wire(e, "force");
  EXPECT_EQ(we.protocol, protocol_version);
  EXPECT_STREQ(we.text, "force");
  const Event re = wire::from_wire(we);
  EXPECT_EQ(std::tie(re.tick, re.time_ns, re.kind, re.from, re.to, re.fault, re.value, re.limit),
            std::tie(e.tick, e.time_ns, e.kind, e.from, e.to, e.fault, e.value, e.limit));

  const Reply r{11, 12, CommandKind::Move, ReplyCode::OutOfRange, Mode::Hold, 13};
  const Reply rr = wire::from_wire(wire::to_wire(r, "too far"));
  EXPECT_EQ(std::tie(rr.session, rr.id, rr.kind, rr.code, rr.mode, rr.tick), std::tie(r.session, r.id, r.kind, r.code, r.mode, r.tick));
}

constexpr std::array<std::string_view, 2> gain_sets{"default", "thesis"};

TEST(Convert, CommandSurvivesTheRoundTripAndFindsItsGainSetByName) {
  Command c;
  c.session = 21;
  c.id = 22;
  c.kind = CommandKind::SelectGains;
  c.target_pose = {1, 2, 3};
  c.speed_m_s = 4;
  c.angular_speed_rad_s = 5;
  c.stop_force_n = 6;
  c.display = Display::Admittance;
  Command out;
  ASSERT_EQ(wire::from_wire(wire::to_wire(c, "thesis", 1000, 50), gain_sets, 1000, out), ReplyCode::Accepted);
  EXPECT_EQ(out.session, c.session);
  EXPECT_EQ(out.id, c.id);
  EXPECT_EQ(out.kind, c.kind);
  EXPECT_EQ(out.gain_set, 1);
  EXPECT_EQ(out.target_pose, c.target_pose);
  EXPECT_EQ(out.speed_m_s, c.speed_m_s);
  EXPECT_EQ(out.angular_speed_rad_s, c.angular_speed_rad_s);
  EXPECT_EQ(out.stop_force_n, c.stop_force_n);
  EXPECT_EQ(out.display, c.display);
  EXPECT_EQ(wire::from_wire(wire::to_wire(c, "nobody", 1000, 50), gain_sets, 1000, out), ReplyCode::UnknownGains);
}

TEST(Convert, CommandExpiresJustAfterItsDeadline) {
  const std::int64_t sent = 1'000'000'000;
  const wire::Command c = wire::to_wire(Command{}, "", sent, 50);
  Command out;
  EXPECT_EQ(wire::from_wire(c, gain_sets, sent + 49'999'999, out), ReplyCode::Accepted);
  EXPECT_EQ(wire::from_wire(c, gain_sets, sent + 50'000'000, out), ReplyCode::Accepted);
  EXPECT_EQ(wire::from_wire(c, gain_sets, sent + 50'000'001, out), ReplyCode::Expired);
  EXPECT_EQ(wire::from_wire(wire::to_wire(Command{}, "", sent, 0), gain_sets, sent + 3'600'000'000'000, out), ReplyCode::Accepted);
}

TEST(Convert, RefusesForeignProtocolAndUnknownCommandAndNamesBothVersions) {
  wire::Command c = wire::to_wire(Command{}, "", 0, 0);
  Command out;
  c.kind = 11;
  EXPECT_EQ(wire::from_wire(c, gain_sets, 0, out), ReplyCode::WrongVersion);
  c.kind = 0;
  c.display = 3;
  EXPECT_EQ(wire::from_wire(c, gain_sets, 0, out), ReplyCode::WrongVersion);
  c.display = 0;
  c.protocol = protocol_version + 1;
  EXPECT_EQ(wire::from_wire(c, gain_sets, 0, out), ReplyCode::WrongVersion);

  EXPECT_EQ(wire::version_problem("rig", protocol_version), "");
  const std::string text = wire::version_problem("rig ubc_twin", protocol_version + 8);
  EXPECT_NE(text.find("rig ubc_twin speaks protocol " + std::to_string(protocol_version + 8)), std::string::npos) << text;
  EXPECT_NE(text.find("this program " + std::to_string(protocol_version)), std::string::npos) << text;
}

TEST(CopyText, CutsAtACharacterAndTerminates) {
  std::array<char, 5> small{'x', 'x', 'x', 'x', 'x'};
  wire::copy_text(small, "abcdef");
  EXPECT_STREQ(small.data(), "abcd");
  wire::copy_text(small, "abc\xc3\xa9");  // e acute would be cut in half
  EXPECT_STREQ(small.data(), "abc");
  wire::copy_text(small, "");
  EXPECT_STREQ(small.data(), "");
}

TEST(BatchBuffer, FillsToTheBoundOfTheIdlAndNotBeyond) {
  auto buffer = std::make_unique<wire::BatchBuffer>();
  Sample s;
  for (std::size_t i = 0; i < wire::BatchBuffer::capacity; ++i) {
    s.tick = i;
    ASSERT_TRUE(buffer->push(s));
  }
  EXPECT_FALSE(buffer->push(s));
  const wire::SampleBatch m = buffer->message(4);
  EXPECT_EQ(m.protocol, protocol_version);
  EXPECT_EQ(m.dropped, 4u);
  ASSERT_EQ(m.samples._length, wire::BatchBuffer::capacity);
  EXPECT_EQ(m.samples._buffer[99].tick, 99u);
  buffer->clear();
  EXPECT_EQ(buffer->message(0).samples._length, 0u);
}

}  // namespace
