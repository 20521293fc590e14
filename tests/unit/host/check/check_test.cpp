#include "host/check/check.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>

#include <algorithm>
#include <fstream>
#include <functional>

#include "common/config/user_error.hpp"

namespace trocar::check {
namespace {

Figures good_figures() {
  Figures f;
  f.rig = "made_up";
  f.period_us = 1000.0;
  f.late_tick_us = 2000.0;
  f.cpu = 3;
  f.real_time = true;
  f.ticks = 30000;
  f.moving = 29000;
  f.wakeup_late = {3.0, 8.0, 20.0, 31.0};
  f.tick = {10.0, 14.0, 20.0, 40.0};
  f.setup = {{"kernel", true, true, "the kernel is PREEMPT_RT"}, {"core", true, true, "is pinned to its core"}};
  return f;
}

Machine good_machine() {
  Machine m;
  m.preempt_rt = true;
  m.clocksource = "tsc";
  m.online = {0, 1, 2, 3};
  m.isolated = m.nohz_full = {3};
  m.smt = false;
  m.governors = {"performance"};
  m.interrupt_cores = {{0, 1, 2}, {0}};
  return m;
}

rig::BusBudget fitting() {
  rig::BusBudget budget;
  budget.drives_peak_percent = 87.0;
  budget.sensor_percent = 34.0;
  return budget;
}

TEST(Verdict, IsFitWhenNothingStandsAgainstIt) {
  const Verdict v = judge(good_figures(), good_machine(), fitting(), true);
  EXPECT_TRUE(v.fit()) << v.against.front();
  EXPECT_TRUE(v.advice.empty()) << v.advice.front();
}

struct Flaw {
  const char* name;
  std::function<void(Figures&, Machine&, rig::BusBudget&, bool& load)> put;
  const char* word;  // that the one line about it holds
};
void PrintTo(const Flaw& flaw, std::ostream* out) { *out << flaw.name; }

class Against : public ::testing::TestWithParam<Flaw> {};
class Advice : public ::testing::TestWithParam<Flaw> {};

Verdict with(const Flaw& flaw) {
  Figures f = good_figures();
  Machine m = good_machine();
  rig::BusBudget budget = fitting();
  bool load = true;
  flaw.put(f, m, budget, load);
  return judge(f, m, budget, load);
}

TEST_P(Against, StandsAloneAgainstMotorsAndIsNamed) {
  const Verdict v = with(GetParam());
  ASSERT_EQ(v.against.size(), 1u);
  EXPECT_FALSE(v.fit());
  EXPECT_NE(v.against.front().find(GetParam().word), std::string::npos) << v.against.front();
  EXPECT_TRUE(v.advice.empty());
}

TEST_P(Advice, IsGivenAndLeavesTheMachineFit) {
  const Verdict v = with(GetParam());
  EXPECT_TRUE(v.fit()) << v.against.front();
  ASSERT_EQ(v.advice.size(), 1u);
  EXPECT_NE(v.advice.front().find(GetParam().word), std::string::npos) << v.advice.front();
}

const auto name_of = [](const auto& info) { return std::string(info.param.name); };

INSTANTIATE_TEST_SUITE_P(
    All, Against,
    ::testing::Values(Flaw{"RefusedItem",
                           [](Figures& f, Machine&, rig::BusBudget&, bool&) {
                             f.setup[0] = {"kernel", true, false, "not PREEMPT_RT: do"};
                           },
                           "not PREEMPT_RT"},
                      Flaw{"LateWakeUp",
                           [](Figures& f, Machine&, rig::BusBudget&, bool&) {
                             f.late = 2;
                             f.wakeup_late.max = 2100.0;
                           },
                           "2 of 30000 wake-ups"},
                      Flaw{"Overrun", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.loop.overruns = 1; },
                           "after the next one was due"},
                      Flaw{"PageFault", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.loop.armed_page_faults = 1; }, "page faults"},
                      Flaw{"Allocation", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.loop.armed_allocations = 1; }, "allocations"},
                      Flaw{"NeverMoved", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.moving = 0; }, "never came to move"},
                      Flaw{"Bus", [](Figures&, Machine&, rig::BusBudget& b, bool&) { b.sensor_percent = 101.0; }, "do not fit"},
                      Flaw{"NoLoad", [](Figures&, Machine&, rig::BusBudget&, bool& load) { load = false; }, "--load"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    All, Advice,
    ::testing::Values(Flaw{"AnyCore", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.cpu = -1; }, "--cpu"},
                      Flaw{"NotIsolated", [](Figures&, Machine& m, rig::BusBudget&, bool&) { m.isolated = {2}; }, "isolcpus=3"},
                      Flaw{"SchedulerTick", [](Figures&, Machine& m, rig::BusBudget&, bool&) { m.nohz_full.clear(); }, "nohz_full=3"},
                      Flaw{"Interrupts", [](Figures&, Machine& m, rig::BusBudget&, bool&) { m.interrupt_cores.push_back({3}); },
                           "irqbalance"},
                      Flaw{"Smt", [](Figures&, Machine& m, rig::BusBudget&, bool&) { m.smt = true; }, "hyper-threads"},
                      Flaw{"Governor",
                           [](Figures&, Machine& m, rig::BusBudget&, bool&) {
                             m.governors = {"performance", "powersave"};
                           },
                           "cpupower"},
                      Flaw{"Clock", [](Figures&, Machine& m, rig::BusBudget&, bool&) { m.clocksource = "hpet"; }, "tsc"},
                      Flaw{"FewTicks", [](Figures& f, Machine&, rig::BusBudget&, bool&) { f.ticks = 9999; }, "--seconds 10"}),
    name_of);

// What was faulted before arming, and what was not asked for, is no flaw.
TEST(Verdict, BearsWhatDoesNotMatter) {
  Figures f = good_figures();
  f.loop.minor_faults = 100;
  f.loop.allocations = 3;
  f.loop.preemptions = 1;
  f.setup.push_back({"core", false, false, "not asked for"});
  EXPECT_TRUE(judge(f, good_machine(), fitting(), true).fit());
}

class Document : public ::testing::Test {
 protected:
  Document() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar-check-test-XXXXXX").string();
    folder = ::mkdtemp(name.data());
  }
  ~Document() override { std::filesystem::remove_all(folder); }
  std::filesystem::path with(const std::string& from, const std::string& to) const {
    std::string text =
        "rig = \"made_up\"\nperiod_us = 1000\nlate_tick_us = 2000\nfeedback_deadline_us = 700\ncpu = -1\nreal_time = false\nticks = 5000\n"
        "moving = 4953\nlate = 2\noverruns = 17\nminor_faults = 1\nmajor_faults = 2\npreemptions = 3\nallocations = 4\n"
        "armed_page_faults = 5\narmed_allocations = 6\n[wakeup_late_us]\np50 = 19.5\np99 = 37.8\np99_99 = 3574.4\nmax = 3574.5\n"
        "[tick_us]\np50 = 9.6\np99 = 13.5\np99_99 = 54.5\nmax = 54.6\n[[setup]]\nname = \"memory\"\nasked = true\nobtained = false\n"
        "text = \"no\"\n";
    text.replace(text.find(from), from.size(), to);
    std::ofstream(folder / "figures.toml") << text;
    return folder / "figures.toml";
  }
  std::filesystem::path folder;
};

TEST_F(Document, IsReadAsItWasWritten) {
  const Figures f = read_figures(with("", ""));
  EXPECT_EQ(f.rig, "made_up");
  EXPECT_EQ(f.cpu, -1);
  EXPECT_FALSE(f.real_time);
  EXPECT_EQ(f.ticks, 5000u);
  EXPECT_EQ(f.moving, 4953u);
  EXPECT_EQ(f.late, 2u);
  EXPECT_EQ(f.loop.overruns, 17u);
  EXPECT_EQ(f.loop.minor_faults, 1u);
  EXPECT_EQ(f.loop.major_faults, 2u);
  EXPECT_EQ(f.loop.preemptions, 3u);
  EXPECT_EQ(f.loop.allocations, 4u);
  EXPECT_EQ(f.loop.armed_page_faults, 5u);
  EXPECT_EQ(f.loop.armed_allocations, 6u);
  EXPECT_EQ(f.wakeup_late.p50, 19.5);
  EXPECT_EQ(f.wakeup_late.p99_99, 3574.4);
  EXPECT_EQ(f.tick.p99, 13.5);
  EXPECT_EQ(f.tick.max, 54.6);
  ASSERT_EQ(f.setup.size(), 1u);
  EXPECT_TRUE(f.setup[0].asked && !f.setup[0].obtained);
}

TEST_F(Document, ThatIsDamagedIsRefused) {
  EXPECT_THROW((void)read_figures(with("late = 2", "late = \"two\"")), config::UserError);
  EXPECT_THROW((void)read_figures(with("moving = 4953\n", "")), config::UserError);
  EXPECT_THROW((void)read_figures(with("late = 2", "later = 2\nlate = 2")), config::UserError);
}

}  // namespace
}  // namespace trocar::check
