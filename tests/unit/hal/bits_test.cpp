#include "hal/can/bits.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "common/rig/bus_budget.hpp"
#include "rig_fixture.hpp"

namespace trocar::hal {
namespace {

std::string binary(std::uint32_t value, int bits) {
  std::string text;
  for (int i = bits; i-- > 0;) text += ((value >> i) & 1u) != 0 ? '1' : '0';
  return text;
}

// An independent way to the same number: the frame as text, the checksum by long division of polynomials, stuffing by replacement.
std::size_t reference_bits(const CanFrame& frame) {
  std::string text = "0";
  if (frame.extended)
    text += binary(frame.id >> 18, 11) + "11" + binary(frame.id & 0x3FFFF, 18) + (frame.remote ? "1" : "0") + "00";
  else
    text += binary(frame.id, 11) + (frame.remote ? "1" : "0") + "00";
  text += binary(frame.length, 4);
  for (std::size_t i = 0; !frame.remote && i < frame.length; ++i) text += binary(frame.data[i], 8);
  const std::string polynomial = "1100010110011001";
  std::string remainder = text + std::string(15, '0');
  for (std::size_t i = 0; i + 16 <= remainder.size(); ++i)
    if (remainder[i] == '1')
      for (std::size_t k = 0; k < 16; ++k) remainder[i + k] = remainder[i + k] == polynomial[k] ? '0' : '1';
  text += remainder.substr(remainder.size() - 15);
  std::string wire;
  for (const char bit : text) {
    wire += bit;
    const std::size_t n = wire.size();
    if (n >= 5 && std::all_of(wire.end() - 5, wire.end(), [&](char c) { return c == bit; })) wire += bit == '1' ? '0' : '1';
  }
  return wire.size() + 13;
}

TEST(CanBits, MatchFramesCountedByHand) {
  // SYNC. Stuff bits in brackets: start 0, identifier 00010000000, 000, length 0000, checksum 001110000000101
  const std::string sync = "0000100000[1]00000[1]00000[1]011100000[1]00101";
  EXPECT_EQ(can_bits(CanFrame{.id = 0x080}), static_cast<std::size_t>(std::count_if(sync.begin(), sync.end(), ::isdigit)) + 13);

  CanFrame frame{.id = 0x555, .length = 1};
  frame.data[0] = 0x55;
  const std::string alternating = "01010101010100000[1]01010101011111[0]00010010111";
  EXPECT_EQ(can_bits(frame), static_cast<std::size_t>(std::count_if(alternating.begin(), alternating.end(), ::isdigit)) + 13);
}

TEST(CanBits, AgreeWithLongDivisionAndStayBelowWorstCase) {
  std::mt19937 random{7};
  std::uint32_t most = 0;
  for (int i = 0; i < 20000; ++i) {
    CanFrame frame;
    frame.extended = random() % 2 == 0;
    frame.remote = random() % 8 == 0;
    frame.id = static_cast<std::uint32_t>(random()) & (frame.extended ? 0x1FFFFFFFu : 0x7FFu);
    frame.length = static_cast<std::uint8_t>(random() % 9);
    // Long runs of equal bits are what stuffing is about.
    for (std::uint8_t& byte : frame.data)
      byte = std::array<std::uint8_t, 4>{0x00, 0xFF, 0xF0, static_cast<std::uint8_t>(random())}[random() % 4];
    const std::uint32_t bits = can_bits(frame);
    ASSERT_EQ(bits, reference_bits(frame));
    ASSERT_LE(bits, rig::worst_case_can_bits(frame.remote ? 0 : frame.length, frame.extended));
    if (!frame.extended && frame.length == 8 && !frame.remote) most = std::max(most, bits);
  }
  EXPECT_GT(most, 111u + 13u);  // the worst case is not merely a bound: runs come close to it
}

TEST(BusBudget, IsThatOfTheDesign) {
  const rig::BusBudget twin = rig::bus_budget(make_test_rig());
  EXPECT_EQ(rig::worst_case_can_bits(0), 55u);
  EXPECT_EQ(rig::worst_case_can_bits(1), 65u);
  EXPECT_EQ(rig::worst_case_can_bits(8), 135u);
  EXPECT_NEAR(twin.drives_cyclic_percent, 73.0, 1e-9);
  EXPECT_NEAR(twin.drives_peak_percent, 86.5, 1e-9);
  EXPECT_NEAR(twin.sensor_percent, 33.5, 1e-9);
  EXPECT_TRUE(twin.fits());

  rig::Rig fast = make_test_rig();
  fast.timing.tick_hz = 1300;
  EXPECT_FALSE(rig::bus_budget(fast).fits());
  EXPECT_NEAR(rig::bus_budget(make_test_rig(rig::Kind::Single)).drives_cyclic_percent, 46.0, 1e-9);
}

}  // namespace
}  // namespace trocar::hal
