#include "hal/realtime/counters.hpp"

#include <sys/resource.h>

namespace trocar::hal::realtime {

ThreadCounters thread_counters() noexcept {
  rusage usage{};
  ::getrusage(RUSAGE_THREAD, &usage);
  return {static_cast<std::uint64_t>(usage.ru_minflt), static_cast<std::uint64_t>(usage.ru_majflt),
          static_cast<std::uint64_t>(usage.ru_nivcsw)};
}

}  // namespace trocar::hal::realtime
