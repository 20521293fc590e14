#include "firmware/targets/linux/loop_watch.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

#include "firmware/safety/stall.hpp"
#include "hal/canopen/drive_setup.hpp"
#include "hal/realtime/clock.hpp"

namespace trocar {

std::int64_t stall_limit_ns(const rig::Rig& rig, bool real_time) noexcept {
  const std::uint32_t late_us = real_time ? rig.timing.late_tick_us : rig.timing.late_tick_best_effort_us;
  return std::max<std::int64_t>(10'000'000LL * hal::canopen::rpdo_timeout_ms(rig), 4'000LL * late_us);
}

LoopWatch::LoopWatch(std::int64_t limit_ns) : limit_ns_(limit_ns), thread_([this] { run(); }) {}

LoopWatch::~LoopWatch() {
  done();
  thread_.join();
}

void LoopWatch::run() noexcept {
  constexpr std::int64_t look_ns = 20'000'000;
  safety::Stall stall(limit_ns_, look_ns);
  std::uint64_t passes = 0;
  std::int64_t next_ns = hal::realtime::monotonic_now_ns();
  do {
    if (done_.load(std::memory_order_relaxed)) return;
    next_ns = std::max(next_ns + look_ns, hal::realtime::monotonic_now_ns());
    hal::realtime::sleep_until(next_ns);
    passes = passes_.load(std::memory_order_relaxed);
  } while (!stall.look(passes, hal::realtime::monotonic_now_ns()));
  if (done_.load(std::memory_order_relaxed)) return;
  // No stream, no allocation: the loop may hold a lock of either.
  std::array<char, 384> text{};
  const int size =
      std::snprintf(text.data(), text.size(),
                    "trocar-rig: LoopStalled: no tick has ended for %lld ms (%llu ended before): this process ends, so that the "
                    "buses fall silent and the drives stay without torque; look at what held the loop's core, then start again\n",
                    static_cast<long long>(limit_ns_ / 1'000'000), static_cast<unsigned long long>(passes));
  if (size > 0 && ::write(STDERR_FILENO, text.data(), std::min(static_cast<std::size_t>(size), text.size() - 1)) < 0) {
    // Nobody to tell: it ends all the same.
  }
  std::abort();
}

}  // namespace trocar
