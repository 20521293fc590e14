// Plant, rig and recorder as a person starts them, and a host that arms the rig and moves its handle.
#pragma once

#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "common/capture/rig_capture.hpp"
#include "harness.hpp"
#include "host/rig/client.hpp"

namespace trocar::testing {

inline constexpr double start_s = 30.0;
inline constexpr double react_s = 10.0;  // wall time that a busy machine may take for 100 ticks

class RunningRig : public ::testing::Test {
 protected:
  void SetUp() override {
    rig_file = scratch.make_rig(rig_edits).string();
    plant.emplace(scratch, "trocar-plant", std::vector<std::string>{"--rig", rig_file, "--log-drives"});
    ASSERT_TRUE(plant->wait_for("before scene", start_s)) << plant->errors();
    rig.emplace(scratch, "trocar-rig",
                std::vector<std::string>{"--rig", rig_file, "--domain", domain, "--best-effort", "--flight", flight_folder.string()});
    ASSERT_TRUE(rig->wait_for("DDS domain", start_s)) << rig->errors();
    recorder.emplace(scratch, "trocar", std::vector<std::string>{"record", "--out", capture_file.string(), "--domain", domain});
    ASSERT_TRUE(recorder->wait_for("recording to", start_s)) << recorder->errors();
  }

  // Polls, and keeps the session alive, until the condition holds.
  template <class Condition>
  bool until(double timeout_s, Condition&& condition) {
    const double end = steady_s() + timeout_s;
    while (!condition()) {
      if (steady_s() > end) return false;
      client.poll(0.005, {.sample =
                              [&](const Sample& s) {
                                if (s.missed_feedback == 0) last_feedback_tick = s.tick;
                                sample = s;
                              },
                          .reply = [&](const host::RigReply& r) { replies.push_back(r); },
                          .event = [&](const host::RigEvent& e) { events.push_back(e); },
                          .status = [&](const host::RigStatus& s) { status = s; }});
      if (armed) client.keep_alive();
    }
    return true;
  }

  void arm_and_move() {
    (void)client.wait_for_rig(start_s);
    ASSERT_TRUE(until(start_s, [&] { return status.mode == Mode::Ready; })) << status.text;
    ASSERT_TRUE(until(start_s, [&] { return client.ask(CommandKind::Home, 5.0).reply.code == ReplyCode::Done; }));
    const auto reply = client.ask(CommandKind::Arm, 5.0);
    ASSERT_EQ(reply.reply.code, ReplyCode::Done) << reply.text;
    armed = true;
    client.send({.session = client.session(),
                 .id = 1,
                 .kind = CommandKind::Move,
                 .target_pose = {0.0, 0.19, 1.5707963267948966},
                 .speed_m_s = 0.01,
                 .angular_speed_rad_s = 1.0});
    ASSERT_TRUE(until(react_s, [&] { return sample.mode == Mode::Position && sample.velocity[1] > 0.005; }))
        << to_string(sample.mode) << ": " << status.text;
  }

  [[nodiscard]] const host::RigEvent* event(EventKind kind) const {
    const auto at = std::find_if(events.begin(), events.end(), [&](const auto& e) { return e.event.kind == kind; });
    return at == events.end() ? nullptr : &*at;
  }

  // The recorder's file after an orderly end of the recorder.
  capture::RigLog finish_recording() {
    // What the client has heard may still be on its way to the recorder.
    (void)until(0.3, [] { return false; });
    recorder->signal(SIGINT);
    EXPECT_EQ(recorder->wait(react_s), 0) << recorder->errors();
    auto log = capture::read_capture(capture_file);
    EXPECT_TRUE(log.report.finished);
    EXPECT_TRUE(log.report.problems.empty());
    return log;
  }

  Scratch scratch;
  std::string domain = std::to_string(own_domain());
  Edits rig_edits;  // before SetUp()
  std::string rig_file;
  std::filesystem::path flight_folder = scratch / "flight";
  std::filesystem::path capture_file = scratch / "capture.mcap";
  std::optional<Program> plant, rig, recorder;
  host::RigClient client{own_domain()};
  bool armed = false;
  Sample sample;
  std::uint64_t last_feedback_tick = 0;
  host::RigStatus status;
  std::vector<host::RigReply> replies;
  std::vector<host::RigEvent> events;
};

}  // namespace trocar::testing
