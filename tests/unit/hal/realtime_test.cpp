#include <gtest/gtest.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <string>
#include <thread>

#include "hal/realtime/clock.hpp"
#include "hal/realtime/counters.hpp"
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

// In threads of their own, which take their cores with them.
TEST(LeaveCore, LeavesTheOthersAndTheNextThreadsToo) {
  std::thread{[] {
    cpu_set_t before;
    ASSERT_EQ(::sched_getaffinity(0, sizeof before, &before), 0);
    if (CPU_COUNT(&before) < 2) GTEST_SKIP() << "this machine gives one core only";
    int core = 0;
    while (!CPU_ISSET(static_cast<std::size_t>(core), &before)) ++core;
    EXPECT_TRUE(leave_core(core));
    cpu_set_t after;
    std::thread{[&after] { ::sched_getaffinity(0, sizeof after, &after); }}.join();
    CPU_CLR(static_cast<std::size_t>(core), &before);
    EXPECT_TRUE(CPU_EQUAL(&before, &after));
  }}.join();
}

TEST(LeaveCore, KeepsTheLastOneAndRefusesWhatIsNone) {
  std::thread{[] {
    cpu_set_t cores;
    ASSERT_EQ(::sched_getaffinity(0, sizeof cores, &cores), 0);
    int core = 0;
    while (!CPU_ISSET(static_cast<std::size_t>(core), &cores)) ++core;
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(core), &one);
    ASSERT_EQ(::sched_setaffinity(0, sizeof one, &one), 0);
    EXPECT_FALSE(leave_core(core));
    EXPECT_FALSE(leave_core(-1));
    EXPECT_FALSE(leave_core(100000));
    cpu_set_t after;
    ::sched_getaffinity(0, sizeof after, &after);
    EXPECT_TRUE(CPU_EQUAL(&one, &after));
  }}.join();
}

// Memory that was never touched costs a fault a page, in the thread that touches it and in no other.
TEST(Counters, CountThePageFaultsOfTheThreadThatHasThem) {
  constexpr std::size_t pages = 64;
  const auto size = pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  void* memory = ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  ::madvise(memory, size, MADV_NOHUGEPAGE);
  const ThreadCounters before = thread_counters();
  std::thread{[&] {
    const ThreadCounters mine = thread_counters();
    for (std::size_t i = 0; i < pages; ++i) static_cast<volatile char*>(memory)[i * size / pages] = 1;
    EXPECT_GE(thread_counters().minor_faults - mine.minor_faults, pages);
  }}.join();
  EXPECT_LT(thread_counters().minor_faults - before.minor_faults, pages);
  ::munmap(memory, size);
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
