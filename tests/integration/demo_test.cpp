// `trocar demo` as a person runs it, with a short stroke: everything is there at the end, and nothing runs on.
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>

#include "common/capture/rig_capture.hpp"
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
}

TEST(Demo, EndsCleanlyOnCtrlC) {
  const Scratch scratch;
  Program program(scratch, "trocar", demo(scratch));
  ASSERT_TRUE(program.wait_for("insert", demo_s)) << program.errors();
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
