// A course on the machine's clock: absolute deadlines, one thread under SCHED_FIFO if that is granted, everything recorded. What the
// machine takes away is told apart from what a tick costs in three ways: the thread's own CPU time, the involuntary context switches
// within a tick, and the same ticks executed again at no pace.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "tests/benchmarks/realtime/course.hpp"

namespace trocar::bench {

// Ours and cyclictest's, so that neither runs in the other's way; -1 for both where only one core may be used.
struct Cores {
  int ours{-1}, other{-1};
};
[[nodiscard]] Cores cores();

// Nanoseconds. A tick of a course does the same in every execution.
struct Tick {
  std::int64_t late_ns{};   // wake-up against the schedule
  std::int64_t wall_ns{};   // controller.tick alone
  std::int64_t cpu_ns{};    // the thread's CPU time over it, with the two readings of the clock
  std::int64_t plant_ns{};  // simulated machine and hand, outside of the tick, in what is left of the period
  std::int64_t least_ns{};  // least of wall_ns and of the executions at no pace
  std::int32_t switches{};  // involuntary, within the tick
  Counts counts{};
  [[nodiscard]] bool deep() const { return counts.contacts >= contacts_goal; }
};

struct Paced {
  double tick_hz{}, wall_s{};
  std::int64_t missed_periods{};  // of the schedule, which moved on
  double steal_s{};               // of all cores, by /proc/stat
  std::vector<std::string> refused{};
  bool fifo{};
  bool haptic{true};  // from the first tick to the last
  bool same{true};    // each execution counted the same in every tick
  std::vector<Tick> tick{};
};

// `begins` is called when the thread has its priority (or not), just before the first tick. Throws std::runtime_error.
[[nodiscard]] Paced run_paced(double tick_hz, double seconds, const model::Image& image, const std::function<void(bool fifo)>& begins);

// The same course at no pace, `times` over: fills least_ns and `same`.
void repeat(Paced& paced, const model::Image& image, int times);

}  // namespace trocar::bench
