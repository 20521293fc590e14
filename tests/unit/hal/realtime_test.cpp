#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <string>
#include <thread>

#include "hal/realtime/clock.hpp"
#include "hal/realtime/setup.hpp"

namespace trocar::hal::realtime {
namespace {

TEST(Clock, NeverWakesBeforeItsTime) {
  const std::int64_t deadline_ns = monotonic_now_ns() + 2'000'000;
  sleep_until(deadline_ns);
  EXPECT_GE(monotonic_now_ns(), deadline_ns);
  sleep_until(deadline_ns);  // in the past: returns
  sleep_until(-5);
}

TEST(Clock, WaitsForInputOrUntilTheDeadline) {
  std::array<int, 2> pipe{};
  ASSERT_EQ(::pipe(pipe.data()), 0);
  const std::array<int, 2> watched{-1, pipe[0]};
  const std::int64_t deadline_ns = monotonic_now_ns() + 1'000'000;
  EXPECT_FALSE(wait_for_input(watched, deadline_ns));
  EXPECT_GE(monotonic_now_ns(), deadline_ns);
  ASSERT_EQ(::write(pipe[1], "x", 1), 1);
  EXPECT_TRUE(wait_for_input(watched, monotonic_now_ns() + 5'000'000'000));
  ::close(pipe[0]);
  ::close(pipe[1]);
}

// In a thread of its own, which takes its scheduling with it when it ends.
TEST(Setup, ReportsExactlyWhatTheKernelGranted) {
  std::thread{[] {
    realtime::Setup setup;
    setup.apply({.priority = 1, .cpu = 0});
    EXPECT_EQ(setup.outcome(Item::Scheduler).obtained, ::sched_getscheduler(0) == SCHED_FIFO);
    cpu_set_t cores;
    ::sched_getaffinity(0, sizeof cores, &cores);
    EXPECT_EQ(setup.outcome(Item::Affinity).obtained, CPU_COUNT(&cores) == 1 && CPU_ISSET(0, &cores));
    EXPECT_EQ(setup.outcome(Item::Kernel).obtained, ::access("/sys/kernel/realtime", R_OK) == 0);
    for (const Item item : {Item::MemoryLock, Item::Scheduler, Item::Affinity, Item::TimerSlack, Item::CpuLatency}) {
      const Outcome& outcome = setup.outcome(item);
      EXPECT_EQ(outcome.obtained, outcome.error_number == 0);
    }
  }}.join();
  ::munlockall();
}

TEST(Setup, IsIncompleteWhenSomethingWasRefusedAndSaysWhatAndWhy) {
  std::thread{[] {
    realtime::Setup setup;
    setup.apply({.priority = 1000, .cpu = 100000});  // neither exists
    EXPECT_FALSE(setup.complete());
    EXPECT_FALSE(setup.outcome(Item::Scheduler).obtained);
    EXPECT_FALSE(setup.outcome(Item::Affinity).obtained);
    std::array<char, 256> text{};
    EXPECT_GT(describe(Item::Scheduler, setup.outcome(Item::Scheduler), text), 0u);
    const std::string line{text.data()};
    EXPECT_NE(line.find("SCHED_FIFO (Invalid argument)"), std::string::npos) << line;
    EXPECT_NE(line.find("rtprio"), std::string::npos) << line;
    EXPECT_EQ(describe(Item::Affinity, {.obtained = false, .error_number = 1}, std::span{text}.first(8)), 7u);  // cut, not overrun
  }}.join();
  ::munlockall();
}

TEST(Setup, DoesNotCountWhatWasNotAskedFor) {
  std::thread{[] {
    realtime::Setup setup;
    setup.apply({.priority = 1, .cpu = -1});
    EXPECT_FALSE(setup.outcome(Item::Affinity).asked);
    const bool rest = setup.outcome(Item::MemoryLock).obtained && setup.outcome(Item::Scheduler).obtained &&
                      setup.outcome(Item::TimerSlack).obtained && setup.outcome(Item::CpuLatency).obtained;
    EXPECT_EQ(setup.complete(), rest);
  }}.join();
  ::munlockall();
}

}  // namespace
}  // namespace trocar::hal::realtime
