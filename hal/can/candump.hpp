// One line of the log format of can-utils (candump -L), which canplayer, log2asc and most analysers read:
//   (1436509052.249713) vcan0 181#0102030405060708      data frame, 11-bit identifier in three digits, 29-bit in eight
//   (1436509052.249713) vcan0 702#R1                    remote frame and the length that it asks for
//   (1436509052.249713) vcan0 20000040#0000000000000000 error report: class bits and the error flag
// Source: lib.h of github.com/linux-can/can-utils.
#pragma once

#include <array>
#include <cstdint>

#include "hal/can/frame.hpp"

namespace trocar::hal {

using CandumpLine = std::array<char, 80>;  // ends with a line feed and a zero

// interface: at most 15 characters. time_ns: since 1970, not negative.
[[nodiscard]] CandumpLine candump_line(const CanFrame& frame, std::int64_t time_ns, const char* interface) noexcept;

}  // namespace trocar::hal
