#include "host/check/machine.hpp"

#include <gtest/gtest.h>
#include <stdlib.h>
#include <sys/resource.h>

#include <fstream>

namespace trocar::check {
namespace {

namespace fs = std::filesystem;

class Tree : public ::testing::Test {
 protected:
  Tree() {
    std::string name = (fs::temp_directory_path() / "trocar-machine-XXXXXX").string();
    root = ::mkdtemp(name.data());
  }
  ~Tree() override { fs::remove_all(root); }
  void put(const std::string& file, const std::string& text) const {
    fs::create_directories((root / file).parent_path());
    std::ofstream(root / file) << text << '\n';
  }
  fs::path root;
};

TEST(Cores, ReadsTheListsThatKernelsPrint) {
  EXPECT_EQ(cores_of("0-2,5"), (std::vector<int>{0, 1, 2, 5}));
  EXPECT_EQ(cores_of("7"), (std::vector<int>{7}));
  for (const char* none : {"", "(null)", "-1", "3-1", "1;2", "0-99999999", "1,x"}) EXPECT_TRUE(cores_of(none).empty()) << none;
}

TEST(Cores, ReadBackAsTheyAreWritten) {
  for (const char* list : {"0-2,5", "7", "1,3,5-6"}) EXPECT_EQ(to_text(cores_of(list)), list);
  EXPECT_EQ(to_text({}), "none");
}

TEST_F(Tree, IsReadAsARealTimeMachine) {
  put("proc/sys/kernel/osrelease", "6.1.0-56-rt-amd64");
  put("sys/kernel/realtime", "1");
  put("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc");
  put("sys/devices/system/cpu/online", "0-3");
  put("sys/devices/system/cpu/isolated", "2-3");
  put("sys/devices/system/cpu/nohz_full", "3");
  put("sys/devices/system/cpu/smt/active", "1");
  put("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave");
  put("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave");
  put("sys/devices/system/cpu/cpu3/cpufreq/scaling_governor", "performance");
  put("proc/irq/9/effective_affinity_list", "0");
  put("proc/irq/24/effective_affinity_list", "1,3");
  const Machine m = look_at_machine(root);
  EXPECT_EQ(m.kernel, "6.1.0-56-rt-amd64");
  EXPECT_TRUE(m.preempt_rt);
  EXPECT_EQ(m.clocksource, "tsc");
  EXPECT_EQ(to_text(m.online), "0-3");
  EXPECT_EQ(to_text(m.isolated), "2-3");
  EXPECT_EQ(to_text(m.nohz_full), "3");
  EXPECT_EQ(m.smt, true);
  EXPECT_EQ(m.governors, (std::vector<std::string>{"powersave", "performance"}));
  EXPECT_EQ(m.interrupt_cores.size(), 2u);
}

TEST_F(Tree, ThatIsEmptyIsAMachineOfWhichNothingIsKnown) {
  const Machine m = look_at_machine(root);
  EXPECT_FALSE(m.preempt_rt);
  EXPECT_TRUE(m.kernel.empty() && m.clocksource.empty() && m.online.empty() && m.isolated.empty() && m.governors.empty());
  EXPECT_FALSE(m.smt.has_value());
  rlimit limit{};
  ASSERT_EQ(getrlimit(RLIMIT_MEMLOCK, &limit), 0);
  EXPECT_EQ(m.memlock_bytes, limit.rlim_cur == RLIM_INFINITY ? unlimited : limit.rlim_cur);
}

}  // namespace
}  // namespace trocar::check
