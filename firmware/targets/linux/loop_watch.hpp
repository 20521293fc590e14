// A thread that ends the process when its loop has stopped passing: hung in an endless loop, in a system call that does not return, or on a
// core that another real-time thread never leaves.
//
// It has nothing to do with taking the torque: the drives do that, soon after the last torque frame (canopen::rpdo_timeout_ms), and latch
// it. What remains is a process that holds the buses, whose bridge goes on telling hosts about a rig in good order, and whose loop may come
// back at any time with a reference of long ago. From this thread nothing orderly can be done about it: controller and link are the loop's,
// in the middle of a tick, and frames through a socket of its own would talk to the drives beside a loop that may go on at that moment.
// Ending the process is the one thing that needs nobody's cooperation: the kernel closes the sockets, master heartbeat and torque frames
// stop for good, hosts see the rig vanish, and the way back is a new start. abort(), so that a core file can say where the loop hung.
//
// The thread is an ordinary one, on another core than the loop's where there is one. At a real-time priority below the loop's it would not
// run beside a loop that spins on the only core: the kernel's real-time throttling leaves 5 % to ordinary threads alone. Above the loop's
// it would disturb what it watches.
#pragma once

#include <atomic>
#include <cstdint>
#include <thread>

#include "common/rig/rig.hpp"

namespace trocar {

// Ten times what the drives bear, so that torque is long off; and four times what makes a tick late, so that whatever is only late is
// dealt with by the controller (Fault::LateTick).
[[nodiscard]] std::int64_t stall_limit_ns(const rig::Rig& rig, bool real_time) noexcept;

class LoopWatch {
 public:
  // Starts the thread. Call it before the real-time set-up: threads inherit priority and core from the one that starts them.
  explicit LoopWatch(std::int64_t limit_ns);
  ~LoopWatch();
  LoopWatch(const LoopWatch&) = delete;
  LoopWatch& operator=(const LoopWatch&) = delete;

  // From the loop, once a tick. The first call begins the watch.
  void pass() noexcept { passes_.store(passes_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed); }
  // From the loop, when it ends as it should.
  void done() noexcept { done_.store(true, std::memory_order_relaxed); }

 private:
  void run() noexcept;

  std::int64_t limit_ns_;
  alignas(64) std::atomic<std::uint64_t> passes_{0};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace trocar
