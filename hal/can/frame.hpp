// One classic CAN frame (ISO 11898-1, 0 to 8 data bytes) and little-endian access to its data, the byte order of CANopen and of
// the force sensor.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace trocar::hal {

struct CanFrame {
  std::uint32_t id{};     // 11 bits, or 29 when extended; of an error report its class bits (linux/can/error.h)
  std::uint8_t length{};  // 0 … 8; of a remote frame the length that it asks for
  bool extended{};
  bool remote{};
  bool error{};  // a report of the local controller, never on the wire
  std::array<std::uint8_t, 8> data{};
  std::int64_t stamp_ns{};  // when it was received, on the receiver's clock, 0 if the bus cannot tell; no part of equality

  friend constexpr bool operator==(const CanFrame& a, const CanFrame& b) noexcept {
    if (a.id != b.id || a.length != b.length || a.extended != b.extended || a.remote != b.remote || a.error != b.error) return false;
    if (a.remote) return true;
    for (std::size_t i = 0; i < a.length && i < a.data.size(); ++i)
      if (a.data[i] != b.data[i]) return false;
    return true;
  }
};

// Precondition: offset + sizeof(T) <= 8.
template <class T>
constexpr void store(CanFrame& frame, std::size_t offset, T value) noexcept {
  static_assert(std::is_integral_v<T>);
  const auto bits = static_cast<std::uint64_t>(static_cast<std::make_unsigned_t<T>>(value));
  for (std::size_t i = 0; i < sizeof(T); ++i) frame.data[offset + i] = static_cast<std::uint8_t>(bits >> (8 * i));
}

template <class T>
[[nodiscard]] constexpr T load(const CanFrame& frame, std::size_t offset) noexcept {
  static_assert(std::is_integral_v<T>);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) bits |= static_cast<std::uint64_t>(frame.data[offset + i]) << (8 * i);
  return static_cast<T>(static_cast<std::make_unsigned_t<T>>(bits));
}

}  // namespace trocar::hal
