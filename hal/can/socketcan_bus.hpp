// A real CAN interface through Linux SocketCAN: one raw socket, never blocking. The bit rate is the interface's
// (ip link set can0 up type can bitrate 1000000); the rig's set-up does that, not this class.
#pragma once

#include <cstdint>

#include "hal/can/bus.hpp"

namespace trocar::hal {

class SocketCanBus {
 public:
  SocketCanBus() noexcept = default;
  ~SocketCanBus() { close(); }
  SocketCanBus(const SocketCanBus&) = delete;
  SocketCanBus& operator=(const SocketCanBus&) = delete;

  [[nodiscard]] OpenStatus open(const char* interface) noexcept;
  void close() noexcept;

  bool send(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void flush(std::int64_t) noexcept {}
  // stamp_ns is the kernel's time of reception, carried over to the caller's clock. Reports of the controller come as error frames.
  bool receive(CanFrame& frame, std::int64_t now_ns) noexcept;
  [[nodiscard]] const BusCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] int file_descriptor() const noexcept { return socket_; }

 private:
  int socket_{-1};
  BusCounters counters_{};
};

}  // namespace trocar::hal
