#include <gtest/gtest.h>

#include <string_view>

#include "common/core/checksum.hpp"

namespace {

std::span<const std::byte> bytes(std::string_view text) { return std::as_bytes(std::span(text.data(), text.size())); }

TEST(Crc32, MatchesThePublishedCheckValue) { EXPECT_EQ(trocar::crc32(bytes("123456789")), 0xCBF43926u); }

TEST(Crc32, ContinuesOverPieces) { EXPECT_EQ(trocar::crc32(bytes("6789"), trocar::crc32(bytes("12345"))), 0xCBF43926u); }

TEST(Crc32, SeesEverySingleBitFlip) {
  std::array<std::byte, 16> data{};
  const std::uint32_t clean = trocar::crc32(data);
  for (std::size_t bit = 0; bit < 8 * data.size(); ++bit) {
    data[bit / 8] ^= std::byte{1} << (bit % 8);
    EXPECT_NE(trocar::crc32(data), clean) << "bit " << bit;
    data[bit / 8] ^= std::byte{1} << (bit % 8);
  }
}

}  // namespace
