// The loop around the tick: wakes up once a period, waits for the feedback, runs the tick. One loop for a rig and for `--check`.
#pragma once

#include <cstdint>
#include <span>

#include "common/core/contracts.hpp"
#include "common/rig/rig.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/safety/modes.hpp"
#include "firmware/targets/linux/allocations.hpp"
#include "firmware/targets/linux/loop_watch.hpp"
#include "hal/realtime/clock.hpp"
#include "hal/realtime/counters.hpp"

namespace trocar {

// Keeps the LoopCounters. Begun and called by the loop's thread, between ticks.
class Tally {
 public:
  void overrun() noexcept { ++counters_.overruns; }

  // What came since the last call counts as armed when there was torque at either end.
  void take(bool torque) noexcept {
    const hal::realtime::ThreadCounters kernel = hal::realtime::thread_counters();
    const std::uint64_t allocations = allocations_of_this_thread();
    const std::uint64_t minor = kernel.minor_faults - kernel_.minor_faults;
    const std::uint64_t major = kernel.major_faults - kernel_.major_faults;
    counters_.minor_faults += minor;
    counters_.major_faults += major;
    counters_.preemptions += kernel.preemptions - kernel_.preemptions;
    counters_.allocations += allocations - allocations_;
    if (torque || torque_) {
      counters_.armed_page_faults += minor + major;
      counters_.armed_allocations += allocations - allocations_;
    }
    kernel_ = kernel;
    allocations_ = allocations;
    torque_ = torque;
  }

  [[nodiscard]] bool torque() const noexcept { return torque_; }
  [[nodiscard]] const LoopCounters& counters() const noexcept { return counters_; }

 private:
  LoopCounters counters_{};
  hal::realtime::ThreadCounters kernel_ = hal::realtime::thread_counters();
  std::uint64_t allocations_ = allocations_of_this_thread();
  bool torque_{};
};

constexpr std::uint64_t ticks_per_tally = 8;

// Until `after(tick, tally)` returns false; it is called between ticks, with the tick's sample complete. `inputs`: descriptors of the link,
// to wait on. Link: what hal::RigLink is to a rig.
template <class Link, class After>
void run_loop(const rig::Rig& rig, Link& link, std::span<const int> inputs, controller::Controller& controller, LoopWatch& watch,
              After&& after) {
  namespace rt = hal::realtime;
  const auto period_ns = static_cast<std::int64_t>(1e9 / rig.timing.tick_hz);
  const std::int64_t deadline_ns = 1000 * static_cast<std::int64_t>(rig.timing.feedback_deadline_us);
  const std::int64_t start_ns = rt::monotonic_now_ns();
  std::int64_t next_ns = start_ns + period_ns;
  Tally tally;
  for (std::uint64_t tick = 0;; ++tick) {
    rt::sleep_until(next_ns);
    const std::int64_t woke_ns = rt::monotonic_now_ns();
    link.begin_tick(woke_ns);
    while (!link.poll(rt::monotonic_now_ns())) {
      const std::int64_t now = rt::monotonic_now_ns();
      if (now >= woke_ns + deadline_ns) break;
      rt::wait_for_input(inputs, woke_ns + deadline_ns);
    }
    const std::int64_t begin_ns = rt::monotonic_now_ns();
    const hal::LinkCommand& command = controller.tick({woke_ns - start_ns, woke_ns - next_ns, &link.feedback()});
    link.end_tick(rt::monotonic_now_ns(), command);
    const std::int64_t end_ns = rt::monotonic_now_ns();
    watch.pass();
    controller.sample().tick_us = static_cast<float>(1e-3 * static_cast<double>(end_ns - begin_ns));

    // A missed period is not made up for by a burst: the schedule moves on.
    next_ns += period_ns;
    if (end_ns > next_ns) tally.overrun();
    if (end_ns > next_ns + period_ns) next_ns = end_ns - (end_ns - next_ns) % period_ns + period_ns;

    const bool torque = safety::has_torque(controller.status().mode);
    if (tick % ticks_per_tally == 0 || torque != tally.torque()) tally.take(torque);
    if (!after(tick, tally.counters())) break;
  }
  watch.done();
}

}  // namespace trocar
