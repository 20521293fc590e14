// Asks the machine for what a 1 kHz loop needs and says plainly what it did not get. Call it once, from the thread that will run
// the loop, after all memory exists; the caller decides whether an incomplete result is good enough.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace trocar::hal::realtime {

struct Request {
  int priority{80};  // SCHED_FIFO, 1 … 99
  int cpu{-1};       // core to run on; -1: any
};

enum class Item : std::uint8_t {
  Kernel,      // PREEMPT_RT
  MemoryLock,  // no page is ever fetched or swapped again
  Scheduler,   // SCHED_FIFO at the asked priority
  Affinity,    // pinned to the asked core
  TimerSlack,  // timers fire when they are due
  CpuLatency,  // the cores stay out of deep sleep (/dev/cpu_dma_latency held open)
};
inline constexpr std::size_t item_count = 6;

struct Outcome {
  bool obtained{};
  bool asked{true};             // false: not wanted (Affinity without a core)
  std::int32_t error_number{};  // errno of the refusal, 0 if there is none to tell
};

// Takes a core away from the calling thread, and so from all threads that it starts from now on: the loop is to be alone on its own. The
// thread that runs the loop goes there by Setup::apply. False, and nothing has changed, when no other core is left or the kernel refuses.
bool leave_core(int cpu) noexcept;

class Setup {
 public:
  Setup() noexcept = default;
  ~Setup();
  Setup(const Setup&) = delete;
  Setup& operator=(const Setup&) = delete;

  void apply(const Request& request) noexcept;
  [[nodiscard]] const Outcome& outcome(Item item) const noexcept { return outcome_[static_cast<std::size_t>(item)]; }
  // Everything that was asked for, the kind of kernel apart: it sets the latency that can be had, not whether the request was granted.
  [[nodiscard]] bool complete() const noexcept;

 private:
  std::array<Outcome, item_count> outcome_{};
  int latency_file_{-1};  // the request lasts as long as the file is open
};

// One line: what was obtained, or what was refused, why, and the remedy. Returns the number of characters.
std::size_t describe(Item item, const Outcome& outcome, std::span<char> text) noexcept;

}  // namespace trocar::hal::realtime
