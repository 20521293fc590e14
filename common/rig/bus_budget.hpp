// How much of each bus a rig needs per tick, in worst-case stuffed bits.
//   drives bus: SYNC (0 bytes), one torque RPDO and one TPDO per drive (8 bytes), at most one further frame (8 bytes)
//   sensor bus: request (1 byte), two replies (8 bytes)
// The heartbeats of the drives come in addition to the further frame; they are rare and stated as an average.
#pragma once

#include <cstdint>

#include "common/rig/rig.hpp"

namespace trocar::rig {

// Bit times that any classic CAN frame of that many data bytes takes at most, intermission (3 bits) included: its stuffed part
// S = 34 + 8 n (11-bit identifier) or 54 + 8 n (29-bit), one stuff bit every four after the first five equal bits, and a fixed part.
//   S + floor((S - 1) / 4) + 13                 ISO 11898-1
[[nodiscard]] constexpr std::uint32_t worst_case_can_bits(std::uint32_t data_bytes, bool extended = false) noexcept {
  const std::uint32_t stuffed = (extended ? 54u : 34u) + 8u * data_bytes;
  return stuffed + (stuffed - 1) / 4 + 13;
}

struct BusBudget {
  double bits_per_tick{};  // what the bit rate offers
  std::uint32_t drives_cyclic_bits{};
  std::uint32_t drives_peak_bits{};  // with the further frame
  std::uint32_t sensor_bits{};
  double drives_cyclic_percent{};
  double drives_peak_percent{};
  double sensor_percent{};
  double heartbeat_percent{};  // drives bus, average of all drives' heartbeats
  [[nodiscard]] bool fits() const noexcept { return drives_peak_percent + heartbeat_percent <= 100.0 && sensor_percent <= 100.0; }
};

[[nodiscard]] BusBudget bus_budget(const Rig& rig) noexcept;

}  // namespace trocar::rig
