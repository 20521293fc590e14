// How long a classic CAN frame occupies the bus, in bit times, intermission (3 bits) included.
//   stuffed part  S = 34 + 8 n (11-bit identifier), 54 + 8 n (29-bit): start of frame … CRC; n data bytes, 0 for a remote frame
//   fixed part    13: CRC delimiter, acknowledge (2), end of frame (7), intermission (3)
// The worst case of any frame is in common/rig/bus_budget.hpp.
// Source: ISO 11898-1 (Bosch CAN 2.0, part A section 5 and part B); CRC-15 polynomial 0x4599.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"

namespace trocar::hal {

// Of this very frame.
[[nodiscard]] std::uint32_t can_bits(const CanFrame& frame) noexcept;

// Bit times counted on one bus, for its load: what one end has sent and received. Frames that the kernel filters out are not in it.
class BusLoad {
 public:
  void add(const CanFrame& frame) noexcept {
    const std::uint32_t bits = can_bits(frame);
    bits_ += bits;
    tick_bits_ += bits;
  }
  void end_tick() noexcept {
    most_ = tick_bits_ > most_ ? tick_bits_ : most_;
    tick_bits_ = 0;
  }
  [[nodiscard]] std::uint64_t bits() const noexcept { return bits_; }
  [[nodiscard]] std::uint32_t most_in_a_tick() const noexcept { return most_; }

 private:
  std::uint64_t bits_{};
  std::uint32_t tick_bits_{};
  std::uint32_t most_{};
};

inline constexpr std::uint32_t intermission_bits = 3;  // the frame is valid for its receivers this much earlier

}  // namespace trocar::hal
