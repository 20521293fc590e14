// The bus that a rig file names: a CAN interface, or a pair of UDP ports. What the programs use.
#pragma once

#include <cstdint>
#include <span>

#include "common/rig/rig.hpp"
#include "hal/can/bus.hpp"
#include "hal/can/socketcan_bus.hpp"
#include "hal/can/udp_bus.hpp"

namespace trocar::hal {

enum class BusSide : std::uint8_t { Rig, Plant };  // which of the two UDP ports is ours

class EndpointBus {
 public:
  // ids: what to receive from a CAN interface, see SocketCanBus; a tunnel has one peer, and all of its frames come.
  [[nodiscard]] OpenStatus open(const rig::BusEndpoint& endpoint, BusSide side, std::span<const std::uint32_t> ids = {}) noexcept {
    is_socketcan_ = endpoint.interface[0] != '\0';
    if (is_socketcan_) return socketcan_.open(endpoint.interface.data(), ids);
    return side == BusSide::Rig ? udp_.open(endpoint.host.data(), endpoint.rig_port, endpoint.plant_port)
                                : udp_.open(endpoint.host.data(), endpoint.plant_port, endpoint.rig_port);
  }
  void close() noexcept {
    socketcan_.close();
    udp_.close();
  }
  bool send(const CanFrame& frame, std::int64_t now_ns) noexcept {
    return is_socketcan_ ? socketcan_.send(frame, now_ns) : udp_.send(frame, now_ns);
  }
  void flush(std::int64_t now_ns) noexcept {
    if (!is_socketcan_) udp_.flush(now_ns);
  }
  bool receive(CanFrame& frame, std::int64_t now_ns) noexcept {
    return is_socketcan_ ? socketcan_.receive(frame, now_ns) : udp_.receive(frame, now_ns);
  }
  [[nodiscard]] const BusCounters& counters() const noexcept { return is_socketcan_ ? socketcan_.counters() : udp_.counters(); }
  [[nodiscard]] int file_descriptor() const noexcept { return is_socketcan_ ? socketcan_.file_descriptor() : udp_.file_descriptor(); }

 private:
  bool is_socketcan_{};
  SocketCanBus socketcan_{};
  UdpBus udp_{};
};

static_assert(CanBus<EndpointBus> && CanBus<SocketCanBus> && CanBus<UdpBus>);

}  // namespace trocar::hal
