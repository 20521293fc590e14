// kill -9 of one process at a time while the handle moves under torque: the others end in a state that has a name, in time.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <regex>

#include "running_rig.hpp"

namespace trocar::testing {
namespace {

constexpr std::uint64_t tick_limit = 100;
constexpr double limit_ms = 100.0;

// What the plant printed about a drive at its last change of state.
struct DriveLine {
  std::string state;
  double torque_nm{};
  double silence_ms{};
};

std::array<std::optional<DriveLine>, 4> last_states(const std::string& log) {
  static const std::regex line(R"(drive (\d) (.+) at ([\d.]+) ms, motor torque (\S+) N m, ([\d.]+) ms after)");
  std::array<std::optional<DriveLine>, 4> found;
  for (std::sregex_iterator it(log.begin(), log.end(), line), end; it != end; ++it)
    found[std::stoul((*it)[1]) - 1] = DriveLine{(*it)[2], std::stod((*it)[4]), std::stod((*it)[5])};
  return found;
}

bool all_in(const std::string& log, const std::string& state, bool in) {
  const auto drives = last_states(log);
  return std::all_of(drives.begin(), drives.end(), [&](const auto& d) { return d && (d->state == state) == in; });
}

const std::string enabled = "Operation enabled";

using Kill = RunningRig;

TEST_F(Kill, DrivesLoseTorqueWhenTheRigIsGone) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  ASSERT_TRUE(all_in(plant->out(), enabled, true)) << plant->out();
  rig->signal(SIGKILL);
  ASSERT_TRUE(until(react_s, [&] { return all_in(plant->out(), enabled, false); })) << plant->out();
  for (const auto& drive : last_states(plant->out())) {
    EXPECT_EQ(drive->state, "Fault");
    EXPECT_EQ(drive->torque_nm, 0.0);
    EXPECT_LE(drive->silence_ms, limit_ms);
  }
  EXPECT_TRUE(plant->running());
  const auto log = finish_recording();
  ASSERT_FALSE(log.samples.empty());
  EXPECT_EQ(log.samples.back().mode, Mode::Position);  // cut off in the middle of its motion, as it was
  EXPECT_EQ(log.samples.back().moving, 1);

  Program look(scratch, "trocar", {"rig", "status", "--domain", domain});
  EXPECT_EQ(look.wait(start_s), 1);
  EXPECT_NE(look.errors().find("no rig answers on DDS domain " + domain), std::string::npos) << look.errors();
}

TEST_F(Kill, RigLatchesFeedbackLostWhenThePlantIsGone) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  plant->signal(SIGKILL);
  ASSERT_TRUE(until(react_s, [&] { return event(EventKind::FaultLatched) != nullptr && status.mode == Mode::Fault; }));
  const auto* latched = event(EventKind::FaultLatched);
  EXPECT_EQ(latched->event.fault, Fault::FeedbackLost) << latched->text;
  EXPECT_EQ(status.fault, Fault::FeedbackLost);
  EXPECT_NE(status.text.find("FeedbackLost"), std::string::npos) << status.text;
  EXPECT_LE(latched->event.tick - last_feedback_tick, tick_limit);
  EXPECT_TRUE(until(react_s, [&] { return sample.tick > latched->event.tick + tick_limit; }));
  armed = false;

  const auto log = finish_recording();
  const auto recorded =
      std::find_if(log.events.begin(), log.events.end(), [](const auto& e) { return e.event.kind == EventKind::FaultLatched; });
  ASSERT_NE(recorded, log.events.end());
  EXPECT_EQ(recorded->event.fault, Fault::FeedbackLost);
  EXPECT_NE(recorded->text.find("encoder values missing"), std::string::npos) << recorded->text;
  std::size_t after = 0;
  for (const Sample& s : log.samples) {
    if (s.tick < recorded->event.tick) continue;
    ++after;
    EXPECT_EQ(s.mode, Mode::Fault);
    EXPECT_EQ(s.joint_torque_command_nm, (std::array<double, 4>{})) << "tick " << s.tick;
  }
  EXPECT_GT(after, 0U);
  rig->signal(SIGTERM);
  EXPECT_EQ(rig->wait(react_s), 0) << rig->errors();
}

TEST_F(Kill, RigHoldsUnderTorqueWhenTheHostIsGone) {
  const auto experiment = scratch.make_experiment({{"approach_speed_m_s = 0.030", "approach_speed_m_s = 0.005"}});
  std::optional<Program> host;
  host.emplace(scratch, "trocar",
               std::vector<std::string>{"experiment", "run", experiment.string(), "--domain", domain, "--out", (scratch / "run").string()});
  ASSERT_TRUE(until(start_s, [&] { return (sample.mode == Mode::Position && sample.moving == 1) || !host->running(); }));
  ASSERT_TRUE(host->running()) << host->errors();
  const std::uint64_t seen_before = sample.tick;
  host->signal(SIGKILL);
  ASSERT_TRUE(until(react_s, [&] { return event(EventKind::HostLost) != nullptr && sample.mode == Mode::Hold && sample.moving == 0; }))
      << to_string(sample.mode);
  const std::uint64_t came_to_rest = sample.tick;
  ASSERT_TRUE(until(react_s, [&] { return sample.tick > came_to_rest + 300; }));
  EXPECT_EQ(sample.mode, Mode::Hold);
  EXPECT_TRUE(all_in(plant->out(), enabled, true)) << plant->out();
  EXPECT_TRUE(until(react_s, [&] { return status.mode == Mode::Hold && status.session == 0; }));

  const auto log = finish_recording();
  const auto lost = std::find_if(log.events.begin(), log.events.end(), [](const auto& e) { return e.event.kind == EventKind::HostLost; });
  ASSERT_NE(lost, log.events.end());
  EXPECT_GT(lost->event.tick, seen_before);
  EXPECT_NE(lost->text.find("no sign of life"), std::string::npos) << lost->text;
  // The event's value is the silence in seconds: how many ticks ran in it?
  const auto silent_since_ns = lost->event.time_ns - static_cast<std::int64_t>(1e9 * lost->event.value);
  const auto ticks = std::count_if(log.samples.begin(), log.samples.end(),
                                   [&](const Sample& s) { return s.time_ns > silent_since_ns && s.time_ns <= lost->event.time_ns; });
  EXPECT_GT(ticks, 0);
  EXPECT_LE(static_cast<std::uint64_t>(ticks), tick_limit);
  double most_torque_nm = 0.0;
  for (const Sample& s : log.samples) {
    if (s.tick <= came_to_rest) continue;
    for (const double t : s.joint_torque_command_nm) most_torque_nm = std::max(most_torque_nm, std::abs(t));
  }
  EXPECT_GT(most_torque_nm, 0.0);

  // The host's own recorder does not outlive it, and its file is readable.
  EXPECT_TRUE(until(react_s, [&] { return processes_mentioning((scratch / "run").string()).empty(); }));
  EXPECT_GT(capture::read_capture(scratch / "run/capture.mcap").samples.size(), 100U);
}

TEST_F(Kill, CaptureIsReadableWhenTheRecorderIsGone) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  const std::uint64_t begin = sample.tick;
  ASSERT_TRUE(until(react_s, [&] { return sample.tick > begin + 1000; }));
  recorder->signal(SIGKILL);
  EXPECT_EQ(recorder->wait(react_s), 128 + SIGKILL);
  const auto log = capture::read_capture(capture_file);
  EXPECT_FALSE(log.report.finished);
  EXPECT_FALSE(log.report.problems.empty());  // it says that it was cut off
  EXPECT_EQ(log.report.damaged_chunks, 0U);
  ASSERT_FALSE(log.samples.empty());
  EXPECT_GT(log.samples.back().tick, begin);
  const std::uint64_t then = sample.tick;
  EXPECT_TRUE(until(react_s, [&] { return sample.tick > then + 200; }));
  EXPECT_EQ(sample.mode, Mode::Position);  // nobody minds
}

}  // namespace
}  // namespace trocar::testing
