// The monotonic clock of this machine, and the only two functions of hal that wait.
#pragma once

#include <cstdint>
#include <span>

namespace trocar::hal::realtime {

[[nodiscard]] std::int64_t monotonic_now_ns() noexcept;

// Until an absolute time, so that lateness does not add up. A time in the past returns at once.
void sleep_until(std::int64_t deadline_ns) noexcept;

// Until one of the descriptors has something to read (true), or the deadline has passed (false). Negative descriptors are ignored;
// at most four are looked at. A signal ends the waiting with false.
bool wait_for_input(std::span<const int> descriptors, std::int64_t deadline_ns) noexcept;

}  // namespace trocar::hal::realtime
