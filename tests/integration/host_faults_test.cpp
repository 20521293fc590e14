// What fails on the host's side of the rig, with the programs themselves: the rig stays in a state that has a name, and what led to it
// is kept. (firmware/safety/README.md lists these beside what is tried in lock-step.)
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>

#include "common/capture/samples_csv.hpp"
#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "running_rig.hpp"

namespace trocar::testing {
namespace {

constexpr std::uint64_t host_timeout_ticks = 80;  // of ubc_twin

class HostFaults : public RunningRig {
 protected:
  // A shared machine may starve plant and rig for longer than a rig would bear; what is tested here is not that.
  HostFaults() {
    rig_edits = {{"missed_feedback_ticks = 20", "missed_feedback_ticks = 500"},
                 {"missed_sensor_ticks = 50", "missed_sensor_ticks = 1000"},
                 {"heartbeat_timeout_ms = 70", "heartbeat_timeout_ms = 700"}};
  }
  [[nodiscard]] std::vector<std::filesystem::path> flights() const {
    std::vector<std::filesystem::path> files;
    std::error_code none;
    for (const auto& e : std::filesystem::directory_iterator(flight_folder, none)) files.push_back(e.path());
    return files;
  }
  // As a full disk would: what is written beyond fails.
  static void let_files_grow_to(const Program& program, rlim_t bytes) {
    const rlimit limit{bytes, RLIM_INFINITY};
    ASSERT_EQ(prlimit(program.pid(), RLIMIT_FSIZE, &limit, nullptr), 0);
  }
  // The events of the recorder's file of one kind.
  static std::vector<capture::EventRecord> of(const capture::RigLog& log, EventKind kind) {
    std::vector<capture::EventRecord> found;
    std::copy_if(log.events.begin(), log.events.end(), std::back_inserter(found), [&](const auto& e) { return e.event.kind == kind; });
    return found;
  }
};

// A row of samples.csv: tick, time, mode, fault, …
struct Row {
  std::uint64_t tick{};
  std::string mode, fault, line;
};

std::vector<Row> rows_of(const std::filesystem::path& csv) {
  std::vector<Row> rows;
  std::ifstream in(csv);
  std::string line;
  std::getline(in, line);
  EXPECT_TRUE(line.starts_with("tick,time_ns,mode,fault,")) << line;
  while (std::getline(in, line)) {
    std::istringstream cells(line);
    Row row;
    row.line = line;
    std::string tick, time;
    std::getline(cells, tick, ',');
    std::getline(cells, time, ',');
    std::getline(cells, row.mode, ',');
    std::getline(cells, row.fault, ',');
    row.tick = std::stoull(tick);
    rows.push_back(row);
  }
  return rows;
}

TEST_F(HostFaults, FlightRecordingOfALostPlantIsOnDiskAndInTheCapture) {
  ASSERT_TRUE(until(start_s, [&] { return sample.tick > capacity::flight_recorder; }));
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  plant->signal(SIGKILL);
  ASSERT_TRUE(until(react_s, [&] { return event(EventKind::FlightRecorded) != nullptr; }));
  armed = false;
  const auto log = finish_recording();
  rig->signal(SIGTERM);
  EXPECT_EQ(rig->wait(react_s), 0) << rig->errors();

  const auto latched = of(log, EventKind::FaultLatched);
  const auto told = of(log, EventKind::FlightRecorded);
  ASSERT_EQ(latched.size(), 1U);
  ASSERT_EQ(told.size(), 1U);
  const std::uint64_t fault_tick = latched[0].event.tick;
  const std::string fault = to_string(latched[0].event.fault);
  EXPECT_EQ(fault, "FeedbackLost");  // which is missed before the heartbeats
  EXPECT_EQ(told[0].event.tick, fault_tick);
  EXPECT_EQ(told[0].event.fault, latched[0].event.fault);

  const auto files = flights();
  ASSERT_EQ(files.size(), 1U);
  EXPECT_EQ(told[0].text, files[0].string());
  EXPECT_TRUE(files[0].filename().string().ends_with("_" + fault + ".csv")) << files[0];
  const auto rows = rows_of(files[0]);
  ASSERT_EQ(rows.size(), capacity::flight_recorder + capacity::flight_aftermath);
  EXPECT_EQ(told[0].event.value, static_cast<double>(rows.size()));
  EXPECT_EQ(rows[capacity::flight_recorder - 1].tick, fault_tick);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ASSERT_EQ(rows[i].tick, fault_tick + i - (capacity::flight_recorder - 1));
    ASSERT_EQ(rows[i].fault, rows[i].tick < fault_tick ? "None" : fault);
    ASSERT_EQ(rows[i].mode == "Fault", rows[i].tick >= fault_tick);
  }
  // The host has the same, to the last digit.
  ASSERT_EQ(log.flight.size(), rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::string line;
    capture::append_samples_csv(line, log.flight[i]);
    ASSERT_EQ(line, rows[i].line + "\n");
  }
}

TEST_F(HostFaults, TheReportOfARunNamesItsFlightRecording) {
  const auto experiment = scratch.make_experiment();
  const auto run = scratch / "run";
  Program host(scratch, "trocar", {"experiment", "run", experiment.string(), "--domain", domain, "--out", run.string()});
  ASSERT_TRUE(until(start_s, [&] { return (sample.mode == Mode::Position && sample.moving == 1) || !host.running(); }));
  plant->signal(SIGKILL);
  EXPECT_EQ(host.wait(start_s), 1);
  Program report(scratch, "trocar", {"report", run.string()});
  EXPECT_EQ(report.wait(start_s), 0) << report.errors();
  const std::string page = read_text(run / "report.html");
  ASSERT_EQ(flights().size(), 1U);
  EXPECT_NE(page.find("flight recording of "), std::string::npos);
  EXPECT_NE(page.find(flights()[0].string()), std::string::npos);
  EXPECT_GT(capture::read_capture(run / "capture.mcap").flight.size(), capacity::flight_aftermath);
}

TEST_F(HostFaults, AFullDiskCostsTheFlightRecordingItsFileOnly) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  let_files_grow_to(*rig, 50'000);
  plant->signal(SIGKILL);
  ASSERT_TRUE(until(react_s, [&] { return event(EventKind::FlightRecorded) != nullptr; }));
  armed = false;
  const auto* told = event(EventKind::FlightRecorded);
  EXPECT_EQ(told->event.value, 0.0);
  EXPECT_NE(told->text.find(flight_folder.string()), std::string::npos) << told->text;
  EXPECT_NE(rig->errors().find("no flight recording on disk: cannot write " + flight_folder.string()), std::string::npos) << rig->errors();
  EXPECT_NE(rig->errors().find("File too large"), std::string::npos) << rig->errors();
  EXPECT_TRUE(flights().empty());  // and no half of one
  EXPECT_TRUE(rig->running());
  EXPECT_GT(finish_recording().flight.size(), capacity::flight_aftermath);
}

// The host's machine is there, but nothing comes from it any more: no goodbye, and DDS does not know yet.
TEST_F(HostFaults, RigHoldsWhenItsHostIsPartitioned) {
  const auto experiment = scratch.make_experiment({{"approach_speed_m_s = 0.030", "approach_speed_m_s = 0.005"}});
  Program host(scratch, "trocar", {"experiment", "run", experiment.string(), "--domain", domain, "--out", (scratch / "run").string()});
  ASSERT_TRUE(until(start_s, [&] { return (sample.mode == Mode::Position && sample.moving == 1) || !host.running(); }));
  ASSERT_TRUE(host.running()) << host.errors();
  host.signal(SIGSTOP);
  ASSERT_TRUE(until(react_s, [&] { return event(EventKind::HostLost) != nullptr && sample.mode == Mode::Hold && sample.moving == 0; }))
      << to_string(sample.mode);
  EXPECT_TRUE(until(react_s, [&] { return status.mode == Mode::Hold && status.session == 0; }));
  // It comes back: what it still sends is refused, and the rig stays held until somebody arms it anew.
  host.signal(SIGCONT);
  EXPECT_EQ(host.wait(start_s), 1);
  EXPECT_TRUE(sample.mode == Mode::Hold || sample.mode == Mode::Ready) << to_string(sample.mode);  // its last word is Stop

  const auto log = finish_recording();
  const auto lost = of(log, EventKind::HostLost);
  ASSERT_EQ(lost.size(), 1U);
  EXPECT_GT(1e3 * lost[0].event.value, static_cast<double>(host_timeout_ticks));
  const auto silent_since_ns = lost[0].event.time_ns - static_cast<std::int64_t>(1e9 * lost[0].event.value);
  const auto ticks = std::count_if(log.samples.begin(), log.samples.end(),
                                   [&](const Sample& s) { return s.time_ns > silent_since_ns && s.time_ns <= lost[0].event.time_ns; });
  EXPECT_LE(static_cast<std::uint64_t>(ticks), host_timeout_ticks + 1);
}

// Somebody sends as fast as he can, for a second. The armed host's commands get through, or the rig holds; it says what happened, and
// Stop works in the midst of it.
TEST_F(HostFaults, AFloodOfForeignCommandsLeavesTheRigInASafeState) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  std::atomic<bool> flooding{true};
  std::atomic<std::uint64_t> sent{0};
  std::thread flood([&] {
    const wire::Participant participant(own_domain());
    wire::Writer<wire::Command> commands(participant);
    Command command{.session = 666, .kind = CommandKind::Home};
    while (flooding.load()) {
      ++command.id;
      (void)commands.write(wire::to_wire(command, "", 0, 0));
      sent.fetch_add(1);
    }
  });
  const double begin_s = steady_s();
  (void)until(1.0, [&] { return false; });
  const std::uint64_t after_a_second = sent.load();
  const Mode mode = sample.mode;
  // A third one stops the rig while it lasts.
  Program stop(scratch, "trocar", {"rig", "stop", "--domain", domain});
  const bool stopped = until(react_s, [&] { return sample.mode == Mode::Ready; });
  const bool told = until(react_s, [&] { return event(EventKind::CommandsLost) != nullptr; });
  flooding = false;
  flood.join();
  std::printf("%llu commands in the first second, mode %s then; stopped after %.2f s\n", static_cast<unsigned long long>(after_a_second),
              to_string(mode), steady_s() - begin_s);
  EXPECT_GT(after_a_second, 5000U);
  EXPECT_TRUE(mode == Mode::Position || mode == Mode::Hold) << to_string(mode);
  EXPECT_TRUE(stopped) << to_string(sample.mode);
  ASSERT_TRUE(told);
  EXPECT_GT(event(EventKind::CommandsLost)->event.value, 0.0);
  EXPECT_NE(event(EventKind::CommandsLost)->text.find("floods rig/command"), std::string::npos);
  EXPECT_EQ(event(EventKind::FaultLatched), nullptr);
  EXPECT_EQ(stop.wait(react_s), 0) << stop.errors();
}

// The recorder's disk is full: it ends with one sentence, its file is readable so far, and the rig does not notice.
TEST_F(HostFaults, AFullDiskEndsTheRecordingOnly) {
  ASSERT_NO_FATAL_FAILURE(arm_and_move());
  let_files_grow_to(*recorder, std::filesystem::file_size(capture_file) + 200'000);
  ASSERT_TRUE(until(start_s, [&] { return !recorder->running(); }));
  EXPECT_EQ(recorder->wait(react_s), 1);
  const std::string text = recorder->errors();
  EXPECT_NE(text.find(capture_file.string()), std::string::npos) << text;
  EXPECT_NE(text.find("File too large"), std::string::npos) << text;
  EXPECT_NE(text.find("everything before is readable"), std::string::npos) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  const auto log = capture::read_capture(capture_file);
  EXPECT_EQ(log.report.damaged_chunks, 0U);
  EXPECT_GT(log.samples.size(), 100U);
  EXPECT_EQ(log.ticks.lost(), 0U);
  const std::uint64_t then = sample.tick;
  EXPECT_TRUE(until(react_s, [&] { return sample.tick > then + 200; }));
  EXPECT_EQ(sample.mode, Mode::Position);
  EXPECT_EQ(event(EventKind::FaultLatched), nullptr);
  EXPECT_EQ(event(EventKind::HostLost), nullptr);
}

}  // namespace
}  // namespace trocar::testing
