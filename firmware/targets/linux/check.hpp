// `trocar-rig --check`: how this machine runs the loop, without a rig. The loop, the controller, its set-up, sockets and watch are the real
// ones; only the feedback is made up, of a handle that stands exactly where the controller wants it and goes to and fro without end. The
// sockets are UDP on loopback with nobody at the other end, whatever buses the rig has: no frame reaches a drive, and every tick waits out
// its feedback deadline, the longest that it ever waits. What it does not contain: the virtual needle (`trocar scene info IMAGE` has the
// cost of that) and the DDS thread.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"
#include "common/rig/rig.hpp"
#include "firmware/targets/linux/loop_watch.hpp"
#include "hal/realtime/setup.hpp"

namespace trocar {

struct CheckFigures {
  std::vector<float> wakeup_late_us, tick_us;  // of every tick but those of the first half second, in order
  std::uint64_t late{};                        // wake-ups beyond the rig's late_tick_us
  std::uint64_t moving{};                      // ticks on a trajectory under position control
  LoopCounters loop{};
};

// Takes `seconds`; throws config::UserError when `stop` comes first. From the thread that has the real-time set-up, with memory that
// `figures` has reserved before: see reserve().
void reserve(const rig::Rig& rig, double seconds, CheckFigures& figures);
void run_check(const rig::Rig& rig, double seconds, bool real_time, LoopWatch& watch, const std::atomic<bool>& stop, CheckFigures& figures);

// What was measured and what was granted, for `trocar rig check` to read: one TOML document.
[[nodiscard]] std::string to_toml(const rig::Rig& rig, const hal::realtime::Setup& setup, int cpu, bool real_time, CheckFigures figures);

}  // namespace trocar
