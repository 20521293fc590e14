#include "sim_plant/nodes/sensor_node.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::sim_plant {
namespace {

struct SensorNodeTest : ::testing::Test {
  SensorNode node{{.base_id = 0x1B0, .counts_per_n = 100, .counts_per_nm = 1000}};
  hal::CanFrame request{.id = 0x1B0, .length = 1, .data = {0x02}};
  hal::CanFrame first, second;
  bool ask(std::int64_t now_ns = 0) {
    node.receive(request, now_ns);
    return node.transmit(first) && node.transmit(second);
  }
  std::uint16_t status() const { return hal::load<std::uint16_t>(second, 4); }
};

TEST_F(SensorNodeTest, AnswersWithTheBytesOfTheManual) {
  node.set_wrench({2.58, 2.56, -3.0, -0.002, 0.001, 0.003});
  ASSERT_TRUE(ask(1'000'000'000));
  EXPECT_EQ(first.id, 0x1B5u);
  EXPECT_EQ(first.data, (std::array<std::uint8_t, 8>{0x02, 0x01, 0xFE, 0xFF, 0x00, 0x01, 0x01, 0x00}));
  EXPECT_EQ(second.id, 0x1B6u);
  EXPECT_EQ(second.data, (std::array<std::uint8_t, 8>{0xD4, 0xFE, 0x03, 0x00, 0x00, 0x00, 0x58, 0x1B}));  // sample 7000 after 1 s
  EXPECT_EQ(node.requests(), 1u);
}

TEST_F(SensorNodeTest, StandsAtTheEndOfItsRangeAndSaysSo) {
  node.set_wrench({327.67, -327.68, 0, 0, 0, 0});
  ASSERT_TRUE(ask());
  EXPECT_EQ(status(), 0);
  node.set_wrench({327.68, -400, 0, 0, 0, 0});
  ASSERT_TRUE(ask());
  EXPECT_EQ(hal::load<std::int16_t>(first, 0), 32767);
  EXPECT_EQ(hal::load<std::int16_t>(first, 4), -32768);
  EXPECT_EQ(status(), 0x8002);
  node.set_wrench({std::numeric_limits<double>::quiet_NaN(), 0, 0, 0, 0, 0});
  ASSERT_TRUE(ask());
  EXPECT_EQ(status(), 0x8000);
}

TEST_F(SensorNodeTest, IgnoresWhatIsNoRequest) {
  request.data[0] = 0x01;
  EXPECT_FALSE(ask());
  request.data[0] = 0x02;
  request.length = 2;
  EXPECT_FALSE(ask());
  request = {.id = 0x1B1, .length = 1, .data = {0x02}};
  EXPECT_FALSE(ask());
}

TEST_F(SensorNodeTest, NewRequestEndsTheOldAnswer) {
  node.receive(request, 0);
  ASSERT_TRUE(ask());
  EXPECT_FALSE(node.transmit(first));
}

}  // namespace
}  // namespace trocar::sim_plant
