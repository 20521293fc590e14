// What surrounds the loop of trocar-rig: its watch, its core, its counters, and `trocar rig check`. What is never asserted is a time.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/ptrace.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "harness.hpp"
#include "host/rig/client.hpp"
#include "refusal.hpp"

namespace trocar::testing {
namespace {

constexpr double start_s = 30.0;

std::vector<std::string> on(const std::filesystem::path& rig, std::vector<std::string> more = {}) {
  std::vector<std::string> all{"--rig", rig.string(), "--domain", std::to_string(own_domain()), "--best-effort"};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

// The first status that came out of a running loop.
host::RigStatus first_tick() {
  host::RigClient client(own_domain());
  host::RigStatus status = client.wait_for_rig(start_s);
  for (const double end = steady_s() + start_s; status.tick == 0 && steady_s() < end;)
    client.poll(0.05, {.status = [&](const host::RigStatus& s) { status = s; }});
  EXPECT_GT(status.tick, 0u);
  return status;
}

// The loop runs in the process's first thread. A tracer can stop that thread alone, which nobody else can: it then hangs in the middle of
// wherever it was, and the rest of the process goes on.
class StoppedThread {
 public:
  explicit StoppedThread(pid_t thread) : thread_(thread) {
    if (ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0) return;
    seized_ = true;
    int status = 0;
    stopped_ = ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr) == 0 && waitpid(thread, &status, __WALL) == thread && WIFSTOPPED(status);
  }
  ~StoppedThread() { release(); }
  StoppedThread(const StoppedThread&) = delete;
  StoppedThread& operator=(const StoppedThread&) = delete;
  void release() {
    if (seized_) ptrace(PTRACE_DETACH, thread_, nullptr, nullptr);
    seized_ = false;
  }
  [[nodiscard]] bool stopped() const noexcept { return stopped_; }

 private:
  pid_t thread_;
  bool seized_{}, stopped_{};
};

TEST(LoopWatch, EndsTheProcessByNameWhenItsLoopHangs) {
  const Scratch scratch;
  // Four times this is the watch's limit on a machine that gives no real time; the harness's own second would be four of waiting.
  const auto rig_file = scratch.make_rig({{"late_tick_best_effort_us = 1000000", "late_tick_best_effort_us = 100000"}});
  Program rig(scratch, "trocar-rig", on(rig_file));
  ASSERT_TRUE(rig.wait_for("DDS domain", start_s)) << rig.errors();
  (void)first_tick();
  {
    StoppedThread loop(rig.pid());
    if (!loop.stopped()) GTEST_SKIP() << "this machine lets no test trace a process (ptrace)";
    const double end = steady_s() + start_s;
    while (rig.errors().find("LoopStalled") == std::string::npos && steady_s() < end) usleep(5000);
  }
  EXPECT_NE(rig.errors().find("trocar-rig: LoopStalled: no tick has ended for 400 ms"), std::string::npos) << rig.errors();
  EXPECT_EQ(rig.wait(start_s), 128 + SIGABRT) << rig.errors();
}

TEST(LoopWatch, BearsAProcessThatWasStoppedAsAWhole) {
  const Scratch scratch;
  const auto rig_file = scratch.make_rig({{"late_tick_best_effort_us = 1000000", "late_tick_best_effort_us = 100000"}});
  Program rig(scratch, "trocar-rig", on(rig_file));
  ASSERT_TRUE(rig.wait_for("DDS domain", start_s)) << rig.errors();
  host::RigClient client(own_domain());
  (void)client.wait_for_rig(start_s);
  kill(rig.pid(), SIGSTOP);
  usleep(1'000'000);  // more than twice the limit
  kill(rig.pid(), SIGCONT);
  std::uint64_t tick = 0;
  const std::uint64_t before = client.wait_for_rig(start_s).tick;
  for (const double end = steady_s() + start_s; tick <= before && steady_s() < end;)
    client.poll(0.05, {.status = [&](const host::RigStatus& s) { tick = s.tick; }});
  EXPECT_GT(tick, before);
  rig.signal(SIGTERM);
  EXPECT_EQ(rig.wait(start_s), 0) << rig.errors();
}

std::vector<int> cores_of_this_process() {
  cpu_set_t set;
  std::vector<int> cores;
  if (sched_getaffinity(0, sizeof set, &set) == 0)
    for (int core = 0; core < CPU_SETSIZE; ++core)
      if (CPU_ISSET(static_cast<std::size_t>(core), &set)) cores.push_back(core);
  return cores;
}

TEST(LoopCore, BelongsToTheLoopAlone) {
  const auto cores = cores_of_this_process();
  if (cores.size() < 2) GTEST_SKIP() << "this machine gives one core only";
  const int core = cores.back();
  const Scratch scratch;
  const auto rig_file = scratch.make_rig();
  Program rig(scratch, "trocar-rig", on(rig_file, {"--cpu", std::to_string(core)}));
  ASSERT_TRUE(rig.wait_for("DDS domain", start_s)) << rig.errors();
  const std::string machine = first_tick().machine;  // and DDS has all its threads
  EXPECT_NE(machine.find("core " + std::to_string(core)), std::string::npos) << machine;
  std::size_t others = 0;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(rig.pid()) + "/task")) {
    const auto id = static_cast<pid_t>(std::stol(thread.path().filename().string()));
    cpu_set_t set;
    if (sched_getaffinity(id, sizeof set, &set) != 0) continue;  // it has ended
    const bool may = CPU_ISSET(static_cast<std::size_t>(core), &set);
    if (id == rig.pid()) {
      EXPECT_TRUE(may && CPU_COUNT(&set) == 1);
    } else {
      EXPECT_FALSE(may) << read_text(thread.path() / "comm");
      ++others;
    }
  }
  EXPECT_GE(others, 2u);  // bridge and watch, and those of DDS
}

TEST(LoopCounters, AreShownByTheStatus) {
  const Scratch scratch;
  const auto rig_file = scratch.make_rig();
  Program rig(scratch, "trocar-rig", on(rig_file));
  ASSERT_TRUE(rig.wait_for("DDS domain", start_s)) << rig.errors();
  (void)first_tick();
  for (const bool json : {false, true}) {
    std::vector<std::string> arguments{"rig", "status", "--domain", std::to_string(own_domain())};
    if (json) arguments.emplace_back("--json");
    Program status(scratch, "trocar", arguments);
    EXPECT_EQ(status.wait(start_s), 0) << status.errors();
    const std::string said = status.out();
    for (const char* word : {json ? "\"armed_page_faults\": 0" : "while armed 0 page faults, 0 allocations", "Linux"})
      EXPECT_NE(said.find(word), std::string::npos) << said;
  }
}

// A socket in the place of a drive, which hears what it is sent.
class Listener {
 public:
  explicit Listener(std::uint16_t port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    good_ = bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~Listener() { close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  [[nodiscard]] bool good() const noexcept { return good_; }
  [[nodiscard]] bool heard() const noexcept {
    char byte = 0;
    return recv(socket_, &byte, 1, 0) >= 0;
  }

 private:
  int socket_ = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  bool good_{};
};

std::uint16_t plant_port(const std::filesystem::path& rig_file) {
  static const std::regex line(R"(plant_port = (\d+))");
  const std::string text = read_text(rig_file);
  std::smatch found;
  return std::regex_search(text, found, line) ? static_cast<std::uint16_t>(std::stoi(found[1])) : std::uint16_t{0};
}

class RigCheck : public ::testing::Test {
 protected:
  std::pair<int, std::string> run(const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"rig", "check", rig_file.string(), "--seconds", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    Program check(scratch, "trocar", arguments);
    const int code = check.wait(60.0);
    EXPECT_EQ(check.errors().find("trocar: "), std::string::npos) << check.errors();
    return {code, check.out()};
  }
  Scratch scratch;
  std::filesystem::path rig_file = scratch.make_rig();
};

TEST_F(RigCheck, PrintsFiguresAndVerdictAndTalksToNobody) {
  const Listener drives(plant_port(rig_file));
  ASSERT_TRUE(drives.good());
  const auto [code, text] = run({});
  EXPECT_EQ(code, 1) << text;  // without load nothing is fit
  for (const char* word : {"wake-up, late by", "tick, execution", "p99.99", "overruns", "page faults", "real-time set-up", "bus load",
                           "drives 73 % (peak 86 %", "sensor 34 %", "only for simulation, because:", "without load: add --load"})
    EXPECT_NE(text.find(word), std::string::npos) << word << " is missing:\n" << text;
  EXPECT_EQ(text.find("never came to move"), std::string::npos) << text;
  EXPECT_FALSE(drives.heard());
}

TEST_F(RigCheck, PrintsOneDocumentWhoseCodeIsItsVerdict) {
  const auto [code, text] = run({"--json", "--load"});
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << text;
  const bool fit = text.find("\"fit_for_motors\": true") != std::string::npos;
  EXPECT_NE(fit, text.find("\"fit_for_motors\": false") != std::string::npos);
  EXPECT_EQ(code, fit ? 0 : 1);
  EXPECT_NE(text.find("\"ticks\": 1000,"), std::string::npos) << text;
  EXPECT_NE(text.find("\"load\": \""), std::string::npos) << text;
  EXPECT_NE(text.find(std::string("\"preempt_rt\": ") + (access("/sys/kernel/realtime", R_OK) == 0 ? "true" : "false")), std::string::npos)
      << text;
  EXPECT_NE(text.find("\"allocations\": 0, \"armed_page_faults\":"), std::string::npos) << text;
  EXPECT_NE(text.find("\"armed_allocations\": 0,"), std::string::npos) << text;
}

TEST_F(RigCheck, RefusesWhatItCannotCheck) {
  const auto bad = scratch.make_rig({{"tick_hz = 1000.0", "tick_hz = \"fast\""}});
  expect_refusal(scratch, "trocar", {"rig", "check", bad.string()}, {bad.string(), "tick_hz"});
  expect_refusal(scratch, "trocar-rig", {"--rig", bad.string(), "--check", "1"}, {bad.string(), "tick_hz"});
  expect_refusal(scratch, "trocar-rig", {"--check", "1", "--out", "/nowhere/figures.toml"}, {"/nowhere"});
}

TEST_F(RigCheck, LeavesNothingWhenItIsStopped) {
  Program check(scratch, "trocar", {"rig", "check", rig_file.string(), "--seconds", "600", "--load"});
  ASSERT_TRUE(check.wait_for("measuring for", start_s));
  const double end = steady_s() + start_s;
  const auto child = [&] {
    const auto all = processes_mentioning(rig_file.string());
    return std::any_of(all.begin(), all.end(), [&](pid_t p) { return p != check.pid(); });
  };
  while (!child() && steady_s() < end) usleep(5000);
  check.signal(SIGINT);
  EXPECT_EQ(check.wait(start_s), 1);
  EXPECT_NE(check.errors().find("stopped"), std::string::npos) << check.errors();
  EXPECT_FALSE(child());
}

}  // namespace
}  // namespace trocar::testing
