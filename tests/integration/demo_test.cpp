// `trocar demo` as a person runs it, with a short stroke: everything is there at the end, and nothing runs on.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>

#include "common/capture/rig_capture.hpp"
#include "common/wire/topics.hpp"
#include "harness.hpp"

namespace trocar::testing {
namespace {

constexpr double demo_s = 150.0;
constexpr double end_s = 20.0;

std::vector<std::string> demo(const Scratch& scratch, std::vector<std::string> more = {}) {
  // A shared machine may starve the plant for longer than a rig would bear; what is tested here is not that.
  (void)scratch.make_rig({{"missed_feedback_ticks = 20", "missed_feedback_ticks = 1000"}});
  std::vector<std::string> arguments{"demo",
                                     "--experiment",
                                     scratch.make_experiment().string(),
                                     "--domain",
                                     std::to_string(own_domain()),
                                     "--out",
                                     (scratch / "run").string(),
                                     "--speeds",
                                     "20"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

bool nothing_runs(const Scratch& scratch) {
  const double end = steady_s() + end_s;
  while (!processes_mentioning(scratch.folder().string()).empty())
    if (steady_s() > end) return false;
  return true;
}

std::size_t figures(const std::filesystem::path& folder) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".svg") continue;
    ++count;
    EXPECT_GT(entry.file_size(), 500U) << entry.path();
  }
  return count;
}

// For the message of a test that failed.
std::string recorded_faults(const std::filesystem::path& run) {
  std::string text;
  if (std::filesystem::exists(run / "capture.mcap"))
    for (const auto& e : capture::read_capture(run / "capture.mcap").events)
      if (e.event.kind == EventKind::FaultLatched) text += std::string(to_string(e.event.fault)) + ": " + e.text + "\n";
  return text;
}

TEST(Demo, LeavesAReportAndNoProcess) {
  const Scratch scratch;
  Program program(scratch, "trocar", demo(scratch));
  ASSERT_EQ(program.wait(demo_s), 0) << program.errors() << recorded_faults(scratch / "run");
  EXPECT_TRUE(processes_mentioning(scratch.folder().string()).empty());
  const auto run = scratch / "run";
  const std::string report = read_text(run / "report.html");
  EXPECT_NE(report.find("</html>"), std::string::npos);
  EXPECT_GE(figures(run), 4U);
  const auto log = capture::read_capture(run / "capture.mcap");
  EXPECT_TRUE(log.report.finished);
  EXPECT_TRUE(log.report.problems.empty());
  const std::string csv = read_text(run / "samples.csv");
  EXPECT_EQ(static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')), log.samples.size() + 1);
  EXPECT_NE(program.out().find((run / "report.html").string()), std::string::npos) << program.out();
  // Its eyes: tracked on the rig's clock, recorded, and in the report beside the truth.
  const std::string summary = read_text(run / "markers.toml");
  EXPECT_NE(summary.find("clock = \"rig\""), std::string::npos) << summary;
  EXPECT_TRUE(log.messages.contains(wire::markers_topic.name));
  EXPECT_NE(report.find("What the camera saw"), std::string::npos);
  EXPECT_NE(report.find("data:image/jpeg;base64,"), std::string::npos);
  EXPECT_NE(report.find("Tracked less true place"), std::string::npos);
  EXPECT_NE(program.out().find("camera: "), std::string::npos) << program.out();
}

// The camera's part in lock-step: every frame is tracked, and the same bytes come twice.
TEST(Demo, SeesTheSameTwiceInLockStep) {
  const Scratch scratch;
  const auto arguments = [&](const char* out, const char* experiment) {
    return std::vector<std::string>{"demo",     "--lockstep", "--json", "--experiment",          experiment,
                                    "--speeds", "20",         "--out",  (scratch / out).string()};
  };
  (void)scratch.make_rig();
  const std::string experiment = scratch.make_experiment().string();
  std::string seen[2];
  for (int k = 0; k < 2; ++k) {
    const std::string out = k == 0 ? "first" : "again";
    Program program(scratch, "trocar", arguments(out.c_str(), experiment.c_str()));
    ASSERT_EQ(program.wait(demo_s), 0) << program.errors();
    EXPECT_NE(program.out().find("\"frames_lost\": 0, \"frames_dropped\": 0"), std::string::npos) << program.out();
    const std::size_t error = program.out().find("\"rms_px\": ");
    ASSERT_NE(error, std::string::npos) << program.out();
    EXPECT_LT(std::stod(program.out().substr(error + 10)), 0.05);
    seen[k] = read_text(scratch / out / "markers.csv");
  }
  EXPECT_GT(seen[0].size(), 100'000U);
  EXPECT_TRUE(seen[0] == seen[1]);  // not EXPECT_EQ: nobody reads megabytes
}

TEST(Demo, GoesBlindWhenItIsTold) {
  const Scratch scratch;
  (void)scratch.make_rig();
  Program program(scratch, "trocar",
                  {"demo", "--lockstep", "--no-camera", "--experiment", scratch.make_experiment().string(), "--speeds", "20", "--out",
                   (scratch / "run").string()});
  ASSERT_EQ(program.wait(demo_s), 0) << program.errors();
  EXPECT_FALSE(std::filesystem::exists(scratch / "run/markers.csv"));
  EXPECT_EQ(read_text(scratch / "run/report.html").find("What the camera saw"), std::string::npos);
}

TEST(Demo, EndsCleanlyOnCtrlC) {
  const Scratch scratch;
  Program program(scratch, "trocar", demo(scratch));
  ASSERT_TRUE(program.wait_for("insert", demo_s)) << program.errors() << recorded_faults(scratch / "run");
  program.signal(SIGINT);
  EXPECT_EQ(program.wait(end_s), 1) << program.errors();
  EXPECT_TRUE(processes_mentioning(scratch.folder().string()).empty());
  EXPECT_NE(program.errors().find("stopped by the user"), std::string::npos) << program.errors();
  const auto log = capture::read_capture(scratch / "run/capture.mcap");
  EXPECT_TRUE(log.report.finished);
  EXPECT_GT(log.samples.size(), 1000U);
  EXPECT_FALSE(std::filesystem::exists(scratch / "run/.run.toml.part"));
}

TEST(Demo, ReportsARunThatWasStoppedBeforeHoming) {
  const Scratch scratch;
  Program program(scratch, "trocar", demo(scratch));
  ASSERT_TRUE(program.wait_for("waiting for the drives", demo_s)) << program.errors();
  program.signal(SIGINT);
  EXPECT_EQ(program.wait(end_s), 1) << program.errors();
  EXPECT_NE(program.errors().find("stopped by the user"), std::string::npos) << program.errors();
  EXPECT_EQ(program.errors().find("gnuplot"), std::string::npos) << program.errors();
  EXPECT_TRUE(std::filesystem::exists(scratch / "run/report.html"));
  EXPECT_TRUE(nothing_runs(scratch));
}

TEST(Demo, LeavesNoProcessWhenItIsKilled) {
  const Scratch scratch;
  Program program(scratch, "trocar", demo(scratch));
  ASSERT_TRUE(program.wait_for("%", demo_s)) << program.errors();  // the experiment has begun
  EXPECT_GE(processes_mentioning(scratch.folder().string()).size(), 4U);
  program.signal(SIGKILL);
  (void)program.wait(end_s);
  EXPECT_TRUE(nothing_runs(scratch));
  EXPECT_TRUE(capture::read_capture(scratch / "run/capture.mcap").report.finished);  // the recorder was told, and closed it
}

}  // namespace
}  // namespace trocar::testing
