// How long a classic CAN frame occupies the bus, in bit times, intermission (3 bits) included.
//   stuffed part  S = 34 + 8 n (11-bit identifier), 54 + 8 n (29-bit): start of frame … CRC; n data bytes, 0 for a remote frame
//   fixed part    13: CRC delimiter, acknowledge (2), end of frame (7), intermission (3)
//   worst case    S + floor((S - 1) / 4) + 13: after the first five equal bits, one stuff bit every four
// Source: ISO 11898-1 (Bosch CAN 2.0, part A section 5 and part B); CRC-15 polynomial 0x4599.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"

namespace trocar::hal {

// Of this very frame.
[[nodiscard]] std::uint32_t can_bits(const CanFrame& frame) noexcept;

// Of any frame of that many data bytes.
[[nodiscard]] constexpr std::uint32_t worst_case_can_bits(std::uint32_t data_bytes, bool extended = false) noexcept {
  const std::uint32_t stuffed = (extended ? 54u : 34u) + 8u * data_bytes;
  return stuffed + (stuffed - 1) / 4 + 13;
}

inline constexpr std::uint32_t intermission_bits = 3;  // the frame is valid for its receivers this much earlier

}  // namespace trocar::hal
