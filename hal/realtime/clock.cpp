#include "hal/realtime/clock.hpp"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>

namespace trocar::hal::realtime {
namespace {

constexpr std::int64_t ns_per_s = 1'000'000'000;

timespec to_timespec(std::int64_t ns) noexcept { return {static_cast<time_t>(ns / ns_per_s), static_cast<long>(ns % ns_per_s)}; }

}  // namespace

std::int64_t monotonic_now_ns() noexcept {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * ns_per_s + now.tv_nsec;
}

void sleep_until(std::int64_t deadline_ns) noexcept {
  const timespec deadline = to_timespec(std::max<std::int64_t>(deadline_ns, 0));
  while (::clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &deadline, nullptr) == EINTR) {
  }
}

bool wait_for_input(std::span<const int> descriptors, std::int64_t deadline_ns) noexcept {
  std::array<pollfd, 4> watched{};
  const std::size_t count = std::min(descriptors.size(), watched.size());
  for (std::size_t i = 0; i < count; ++i) watched[i] = {descriptors[i], POLLIN, 0};
  const timespec left = to_timespec(std::max<std::int64_t>(deadline_ns - monotonic_now_ns(), 0));
  return ::ppoll(watched.data(), static_cast<nfds_t>(count), &left, nullptr) > 0;
}

}  // namespace trocar::hal::realtime
