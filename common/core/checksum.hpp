// CRC-32 (polynomial 0x04C11DB7 reflected, initial and final value ~0), as in IEEE 802.3, zlib and MCAP.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace trocar {

namespace detail {
consteval std::array<std::uint32_t, 256> crc32_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value & 1u) != 0 ? 0xEDB88320u ^ (value >> 1) : value >> 1;
    table[i] = value;
  }
  return table;
}
}  // namespace detail

// Continues `crc` (0 to start) over `bytes`: crc32(b, crc32(a)) equals crc32 of a followed by b.
[[nodiscard]] constexpr std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0) noexcept {
  constexpr auto table = detail::crc32_table();
  std::uint32_t value = ~crc;
  for (const std::byte byte : bytes) value = table[(value ^ std::to_integer<std::uint32_t>(byte)) & 0xFFu] ^ (value >> 8);
  return ~value;
}

}  // namespace trocar
