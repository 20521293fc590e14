#include "hal/realtime/setup.hpp"

#include <fcntl.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

namespace trocar::hal::realtime {
namespace {

constexpr std::size_t stack_bytes = 256 * 1024;  // touched once, so that the loop never meets a new page of its stack

[[gnu::noinline]] void touch_stack() noexcept {
  std::array<char, stack_bytes> stack;
  for (std::size_t i = 0; i < stack_bytes; i += 1024) stack[i] = 0;
  asm volatile("" : : "r"(stack.data()) : "memory");  // or the compiler drops it all
}

Outcome result(int status) noexcept { return {.obtained = status == 0, .error_number = status == 0 ? 0 : errno}; }

struct Text {
  const char* good;
  const char* bad;
  const char* remedy;
};
constexpr std::array<Text, item_count> texts{{
    {"the kernel is PREEMPT_RT", "the kernel is not PREEMPT_RT", "install linux-image-rt-amd64 for bounded latencies"},
    {"memory is locked", "memory could not be locked",
     "raise the limit (ulimit -l unlimited, or memlock in /etc/security/limits.d) or grant CAP_IPC_LOCK"},
    {"runs under SCHED_FIFO", "did not get SCHED_FIFO", "set rtprio in /etc/security/limits.d, or grant CAP_SYS_NICE"},
    {"is pinned to its core", "could not be pinned to its core", "choose a core that exists and that this process may use (taskset -p)"},
    {"timer slack is 1 ns", "timer slack could not be set", "none needed under SCHED_FIFO"},
    {"cores stay out of deep sleep", "cores may enter deep sleep",
     "allow writing to /dev/cpu_dma_latency, or boot with processor.max_cstate=1"},
}};

}  // namespace

bool leave_core(int cpu) noexcept {
  cpu_set_t cores;
  if (cpu < 0 || cpu >= CPU_SETSIZE || ::sched_getaffinity(0, sizeof cores, &cores) != 0) return false;
  CPU_CLR(static_cast<std::size_t>(cpu), &cores);
  return CPU_COUNT(&cores) > 0 && ::sched_setaffinity(0, sizeof cores, &cores) == 0;
}

Setup::~Setup() {
  if (latency_file_ >= 0) ::close(latency_file_);
}

void Setup::apply(const Request& request) noexcept {
  const auto at = [&](Item item) -> Outcome& { return outcome_[static_cast<std::size_t>(item)]; };

  char kernel = '0';
  const int file = ::open("/sys/kernel/realtime", O_RDONLY | O_CLOEXEC);
  if (file >= 0) {
    if (::read(file, &kernel, 1) != 1) kernel = '0';
    ::close(file);
  }
  at(Item::Kernel) = {.obtained = kernel == '1'};

  touch_stack();
  at(Item::MemoryLock) = result(::mlockall(MCL_CURRENT | MCL_FUTURE));

  sched_param parameter{};
  parameter.sched_priority = request.priority;
  at(Item::Scheduler) = result(::sched_setscheduler(0, SCHED_FIFO, &parameter));

  at(Item::Affinity) = {.obtained = false, .asked = request.cpu >= 0};
  if (request.cpu >= CPU_SETSIZE) {
    at(Item::Affinity).error_number = EINVAL;
  } else if (request.cpu >= 0) {
    cpu_set_t cores;
    CPU_ZERO(&cores);
    CPU_SET(static_cast<std::size_t>(request.cpu), &cores);
    at(Item::Affinity) = result(::sched_setaffinity(0, sizeof cores, &cores));
  }

  at(Item::TimerSlack) = result(::prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL));

  if (latency_file_ < 0) latency_file_ = ::open("/dev/cpu_dma_latency", O_WRONLY | O_CLOEXEC);
  const std::int32_t microseconds = 0;
  const bool held = latency_file_ >= 0 && ::write(latency_file_, &microseconds, sizeof microseconds) == sizeof microseconds;
  at(Item::CpuLatency) = result(held ? 0 : -1);
}

bool Setup::complete() const noexcept {
  for (std::size_t i = 0; i < item_count; ++i)
    if (static_cast<Item>(i) != Item::Kernel && outcome_[i].asked && !outcome_[i].obtained) return false;
  return true;
}

std::size_t describe(Item item, const Outcome& outcome, std::span<char> text) noexcept {
  const Text& line = texts[static_cast<std::size_t>(item)];
  int size = 0;
  if (!outcome.asked)
    size = std::snprintf(text.data(), text.size(), "not asked for: %s", line.good);
  else if (outcome.obtained)
    size = std::snprintf(text.data(), text.size(), "%s", line.good);
  else if (outcome.error_number != 0)
    size = std::snprintf(text.data(), text.size(), "%s (%s): %s", line.bad, std::strerror(outcome.error_number), line.remedy);
  else
    size = std::snprintf(text.data(), text.size(), "%s: %s", line.bad, line.remedy);
  return size < 0 || text.empty() ? 0 : std::min(static_cast<std::size_t>(size), text.size() - 1);
}

}  // namespace trocar::hal::realtime
