// A real CAN interface through Linux SocketCAN: one raw socket, never blocking. The bit rate is the interface's
// (ip link set can0 up type can bitrate 1000000); the rig's set-up does that, not this class. Classic frames only: CAN FD frames of
// others are counted and left out.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>

#include "hal/can/bus.hpp"

namespace trocar::hal {

// Carries time stamps of the CAN hardware, whose clock started anywhere and runs at its own rate, over to the kernel's: the frame that
// was handed over with the least delay tells how far the two are apart.
class HardwareClock {
 public:
  // Both stamps are of one frame. Never later than kernel_ns.
  [[nodiscard]] std::int64_t carry_over(std::int64_t hardware_ns, std::int64_t kernel_ns) noexcept {
    // Two quartzes may run 200 ppm apart: what has been the least delay is believed a little less every moment.
    apart_ns_ += apart_ns_ == unknown ? 0 : (hardware_ns - last_ns_) / 5000;
    last_ns_ = hardware_ns;
    if (kernel_ns - hardware_ns < apart_ns_) apart_ns_ = kernel_ns - hardware_ns;
    return hardware_ns + apart_ns_;
  }

 private:
  static constexpr std::int64_t unknown = std::numeric_limits<std::int64_t>::max();
  std::int64_t apart_ns_{unknown};
  std::int64_t last_ns_{};
};

class SocketCanBus {
 public:
  SocketCanBus() noexcept = default;
  ~SocketCanBus() { close(); }
  SocketCanBus(const SocketCanBus&) = delete;
  SocketCanBus& operator=(const SocketCanBus&) = delete;

  // ids: the 11-bit identifiers whose data frames the kernel hands over, at most 512; none: every frame.
  [[nodiscard]] OpenStatus open(const char* interface, std::span<const std::uint32_t> ids = {}) noexcept;
  void close() noexcept;

  bool send(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void flush(std::int64_t) noexcept {}
  // stamp_ns is the time of reception carried over to the caller's clock: the CAN hardware's where it gives one, else the kernel's.
  // Reports of the controller come as error frames.
  bool receive(CanFrame& frame, std::int64_t now_ns) noexcept;
  [[nodiscard]] const BusCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] int file_descriptor() const noexcept { return socket_; }

 private:
  void fill(std::int64_t now_ns) noexcept;

  static constexpr std::size_t batch = 16;
  int socket_{-1};
  std::array<CanFrame, batch> received_{};
  std::size_t next_{};
  std::size_t filled_{};
  std::uint32_t overflowed_{};  // frames that found the socket's queue full, as the kernel counts
  HardwareClock hardware_clock_{};
  BusCounters counters_{};
};

}  // namespace trocar::hal
