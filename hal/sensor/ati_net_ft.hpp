// ATI Net F/T force/torque sensor on CAN, short data (ATI 9620-05-NET FT, section 15):
//   request:  base identifier, one byte 02h
//   replies:  base + 5: Fx Tx Fy Ty     base + 6: Fz Tz status sample      each int16, little-endian
// The status is the upper half of the sensor's 32-bit system status: bit 15 any error, bit 1 transducer saturated.
#pragma once

#include <array>
#include <cstdint>

#include "common/rig/rig.hpp"
#include "hal/can/frame.hpp"

namespace trocar::hal::ati {

inline constexpr std::uint8_t request_short = 0x02;
inline constexpr std::uint16_t status_error = 0x8000;
inline constexpr std::uint16_t status_saturated = 0x0002;

[[nodiscard]] constexpr CanFrame request_frame(std::uint32_t base_id) noexcept {
  CanFrame frame{.id = base_id, .length = 1};
  frame.data[0] = request_short;
  return frame;
}

[[nodiscard]] constexpr std::array<std::uint32_t, 2> received_ids(std::uint32_t base_id) noexcept { return {base_id + 5, base_id + 6}; }

struct Reading {
  std::array<std::int16_t, 6> counts{};  // Fx Fy Fz Tx Ty Tz
  std::uint16_t status{};
  std::uint16_t sample{};  // of the sensor's own clock, wraps

  // The sensor says so, or a channel stands at the end of its range.
  [[nodiscard]] constexpr bool saturated() const noexcept {
    if ((status & status_saturated) != 0) return true;
    for (const std::int16_t c : counts)
      if (c == 32767 || c == -32768) return true;
    return false;
  }
  // N, N, N, N m, N m, N m in the sensor's frame.
  [[nodiscard]] constexpr std::array<double, 6> force_torque(const rig::ForceSensor& sensor) const noexcept {
    std::array<double, 6> value{};
    for (std::size_t i = 0; i < 6; ++i) value[i] = counts[i] / (i < 3 ? sensor.counts_per_n : sensor.counts_per_nm);
    return value;
  }
};

// Puts the two replies together. A second half without its first, or one from before the last request, makes no reading.
class Client {
 public:
  explicit Client(std::uint32_t base_id) noexcept : base_id_{base_id} {}
  [[nodiscard]] CanFrame request() noexcept;
  bool receive(const CanFrame& frame) noexcept;  // true: reading() is new
  [[nodiscard]] const Reading& reading() const noexcept { return reading_; }
  [[nodiscard]] std::uint64_t readings() const noexcept { return readings_; }
  [[nodiscard]] std::uint64_t unexpected() const noexcept { return unexpected_; }  // wrong length, no request open, out of order

 private:
  enum class Expects : std::uint8_t { Nothing, First, Second };
  std::uint32_t base_id_;
  Expects expects_{Expects::Nothing};
  Reading partial_{};
  Reading reading_{};
  std::uint64_t readings_{};
  std::uint64_t unexpected_{};
};

}  // namespace trocar::hal::ati
