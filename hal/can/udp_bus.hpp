// A CAN bus tunnelled through UDP (cannelloni datagrams), between exactly two peers. Frames of one tick travel in one datagram: send()
// gathers, flush() transmits. Only datagrams of the configured peer are accepted.
#pragma once

#include <array>
#include <cstdint>

#include "hal/can/bus.hpp"
#include "hal/can/cannelloni.hpp"

namespace trocar::hal {

class UdpBus {
 public:
  UdpBus() noexcept = default;
  ~UdpBus() { close(); }
  UdpBus(const UdpBus&) = delete;
  UdpBus& operator=(const UdpBus&) = delete;

  // Binds host:local_port and talks to host:remote_port. The host is a name or an IPv4 address of this machine.
  [[nodiscard]] OpenStatus open(const char* host, std::uint16_t local_port, std::uint16_t remote_port) noexcept;
  void close() noexcept;

  bool send(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void flush(std::int64_t now_ns) noexcept;
  bool receive(CanFrame& frame, std::int64_t now_ns) noexcept;
  [[nodiscard]] const BusCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] int file_descriptor() const noexcept { return socket_; }

 private:
  int socket_{-1};
  std::uint8_t sequence_{};
  bool sequence_known_{};
  std::uint8_t expected_sequence_{};
  cannelloni::Writer writer_{};
  cannelloni::Reader reader_{};
  BusCounters counters_{};
  std::array<std::uint8_t, cannelloni::receive_bytes> datagram_{};
};

}  // namespace trocar::hal
