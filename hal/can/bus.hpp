// What every CAN bus offers. A bus object is one connection to one bus and belongs to one thread. Nothing waits or throws; time is
// always given by the caller.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>

#include "hal/can/error_report.hpp"
#include "hal/can/frame.hpp"

namespace trocar::hal {

// Monotonic; every lost or strange thing is counted exactly once.
struct BusCounters {
  std::uint64_t sent{};             // frames given to the bus
  std::uint64_t received{};         // frames given to the caller, error reports excluded
  std::uint64_t send_dropped{};     // no room, no peer, interface down, or not a valid frame
  std::uint64_t receive_dropped{};  // arrived, but the queue was full
  std::uint64_t malformed{};        // datagrams refused as a whole
  std::uint64_t unsupported{};      // CAN FD frames left out
  std::uint64_t lost_datagrams{};   // gaps in the sequence numbers of the tunnel (modulo 256)
  std::uint64_t error_frames{};     // reports of the CAN controller
  std::uint64_t no_acknowledge{};   // nobody else on the bus took what the controller sent
  std::uint64_t overflows{};        // frames that the controller itself lost
  std::uint64_t error_passive{};    // times that it fell to error passive
  std::uint64_t bus_off{};          // times that the controller left the bus
  BusCondition condition{};
  std::int32_t last_error_number{};  // errno of the last failed system call
};

constexpr void count_received(BusCounters& counters, const CanFrame& frame) noexcept {
  if (!frame.error) {
    ++counters.received;
    return;
  }
  ++counters.error_frames;
  if ((frame.id & error_class_no_acknowledge) != 0) ++counters.no_acknowledge;
  if ((frame.id & error_class_controller) != 0 && (frame.data[1] & controller_overflow) != 0) ++counters.overflows;
  const BusCondition condition = condition_after(frame, counters.condition);
  if (condition == BusCondition::Passive && counters.condition != condition) ++counters.error_passive;
  if ((frame.id & error_class_bus_off) != 0) ++counters.bus_off;
  counters.condition = condition;
}

template <class B>
concept CanBus = requires(B& bus, const B& constant, const CanFrame& frame, CanFrame& out, std::int64_t now_ns) {
  { bus.send(frame, now_ns) }
  noexcept->std::same_as<bool>;  // false: dropped and counted
  { bus.flush(now_ns) }
  noexcept;  // puts on the wire what send() may have gathered
  { bus.receive(out, now_ns) }
  noexcept->std::same_as<bool>;  // false: nothing has arrived by now
  { constant.counters() }
  noexcept->std::same_as<const BusCounters&>;
  { constant.file_descriptor() }
  noexcept->std::same_as<int>;  // to wait on; -1: none
};

// Result of opening a bus, for people. Opening is not real-time work.
struct OpenStatus {
  std::int32_t error_number{};      // errno; 0: open
  std::array<char, 256> message{};  // what is wrong, and the remedy; empty when open
  [[nodiscard]] bool ok() const noexcept { return error_number == 0; }
};

}  // namespace trocar::hal
