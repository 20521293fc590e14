// One CAN bus inside one process, on a virtual clock: the wire of the lock-step bench and of the tests.
//
// A frame occupies the bus for its stuffed bit time. Each port sends in the order of its send() calls, as a Linux CAN interface does;
// when the bus falls idle, the first frames of all ports arbitrate and the lowest identifier wins. A frame reaches every other port at
// the end of its last bit; the next one starts after the intermission. Frames sent at one and the same instant all take part in the
// arbitration of that instant, whatever the order of the calls: a transmission starts only once the clock has passed its start.
// Equal inputs give equal outputs. Step the clock finer than a frame (50 us at 1 Mbit/s) where answers should be prompt.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/core/capacities.hpp"
#include "hal/can/bus.hpp"
#include "hal/can/fifo.hpp"

namespace trocar::hal {

class MemoryBus;

class MemoryPort {
 public:
  bool send(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void flush(std::int64_t) noexcept {}
  bool receive(CanFrame& frame, std::int64_t now_ns) noexcept;
  // As if this port's CAN controller had reported an error: received next.
  void report(const CanFrame& error) noexcept { (void)received_.push(error); }
  [[nodiscard]] const BusCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] int file_descriptor() const noexcept { return -1; }

 private:
  friend class MemoryBus;
  struct Pending {
    CanFrame frame{};
    std::int64_t ready_ns{};
  };
  MemoryBus* bus_{};
  bool attached_{};  // a port that nobody asked for receives nothing
  Fifo<Pending, capacity::can_queue> pending_{};
  Fifo<CanFrame, capacity::can_queue> received_{};
  BusCounters counters_{};
};

class MemoryBus {
 public:
  static constexpr std::size_t ports = 8;

  explicit MemoryBus(std::uint32_t bitrate_bps) noexcept;
  MemoryBus(const MemoryBus&) = delete;  // the ports point at their bus
  MemoryBus& operator=(const MemoryBus&) = delete;

  // Precondition: index < ports. Attaches the port.
  [[nodiscard]] MemoryPort& port(std::size_t index) noexcept;

  // Carries out everything that ends by now. Ports call it themselves.
  void advance(std::int64_t now_ns) noexcept;

  [[nodiscard]] std::int64_t busy_ns() const noexcept { return busy_ns_; }  // bus time of all frames so far: the load
  [[nodiscard]] std::int64_t duration_ns(std::uint32_t bits) const noexcept;

 private:
  friend class MemoryPort;
  std::uint32_t bitrate_bps_;
  std::array<MemoryPort, ports> ports_{};
  std::int64_t advanced_to_ns_{};
  std::int64_t idle_from_ns_{};
  std::int64_t delivery_ns_{};
  std::int64_t busy_ns_{};
  bool in_flight_{};
  CanFrame flying_{};
  std::size_t sender_{};
};

}  // namespace trocar::hal
