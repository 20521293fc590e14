// What the kernel has done to the calling thread.
#pragma once

#include <cstdint>

namespace trocar::hal::realtime {

struct ThreadCounters {
  std::uint64_t minor_faults{};  // page faults served from memory
  std::uint64_t major_faults{};  // page faults served from a disk
  std::uint64_t preemptions{};   // taken off its core while it had work to do
};

// Since the thread began. One system call: between ticks, never inside of one.
[[nodiscard]] ThreadCounters thread_counters() noexcept;

}  // namespace trocar::hal::realtime
