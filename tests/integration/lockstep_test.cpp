// The bench promises the same bytes for the same experiment and seed.
#include <gtest/gtest.h>

#include "common/capture/rig_capture.hpp"
#include "common/capture/samples_csv.hpp"
#include "harness.hpp"

namespace trocar::testing {
namespace {

constexpr double bench_s = 100.0;

TEST(Lockstep, SameSeedGivesTheSameBytesAndAnotherSeedDoesNot) {
  const Scratch scratch;
  (void)scratch.make_rig();
  const auto experiment = scratch.make_experiment();
  const auto run = [&](const char* name, const char* seed) {
    Program bench(scratch, "trocar-bench",
                  {"--experiment", experiment.string(), "--speeds", "9", "--seed", seed, "--out", (scratch / name).string()});
    EXPECT_EQ(bench.wait(bench_s), 0) << bench.errors();
    return read_text(scratch / name / "samples.csv");
  };
  const std::string first = run("first", "1");
  const std::string again = run("again", "1");
  const std::string other = run("other", "2");
  ASSERT_FALSE(first.empty());
  EXPECT_TRUE(first == again);  // not EXPECT_EQ: nobody reads megabytes
  EXPECT_FALSE(first == other);

  const auto log = capture::read_capture(scratch / "first" / "capture.mcap");
  EXPECT_TRUE(log.report.finished);
  EXPECT_TRUE(log.report.problems.empty());
  EXPECT_EQ(log.ticks.lost(), 0U);
  std::string csv{capture::samples_csv_header()};
  csv += '\n';
  for (const Sample& s : log.samples) capture::append_samples_csv(csv, s);
  EXPECT_TRUE(csv == first);
}

}  // namespace
}  // namespace trocar::testing
