#include "hal/sensor/ati_net_ft.hpp"

#include <gtest/gtest.h>

namespace trocar::hal::ati {
namespace {

CanFrame reply(std::uint32_t id, std::array<std::uint8_t, 8> data) { return CanFrame{.id = id, .length = 8, .data = data}; }

// Fx 0102h, Tx -2, Fy 256, Ty 1 | Fz -32768, Tz 3, status 0002h, sample 1234h: little-endian
const CanFrame first = reply(0x1B5, {0x02, 0x01, 0xFE, 0xFF, 0x00, 0x01, 0x01, 0x00});
const CanFrame second = reply(0x1B6, {0x00, 0x80, 0x03, 0x00, 0x02, 0x00, 0x34, 0x12});

struct AtiTest : ::testing::Test {
  Client client{0x1B0};
};

TEST_F(AtiTest, RequestIsOneByteAtTheBaseIdentifier) {
  const CanFrame request = client.request();
  EXPECT_EQ(request.id, 0x1B0u);
  EXPECT_EQ(request.length, 1);
  EXPECT_EQ(request.data[0], 0x02);
}

TEST_F(AtiTest, PutsBothRepliesTogether) {
  (void)client.request();
  EXPECT_FALSE(client.receive(first));
  ASSERT_TRUE(client.receive(second));
  EXPECT_EQ(client.reading().counts, (std::array<std::int16_t, 6>{0x0102, 256, -32768, -2, 1, 3}));
  EXPECT_EQ(client.reading().status, 2);
  EXPECT_EQ(client.reading().sample, 0x1234);
  rig::ForceSensor scale;
  scale.counts_per_n = 100;
  scale.counts_per_nm = 1000;
  const std::array<double, 6> value = client.reading().force_torque(scale);
  EXPECT_DOUBLE_EQ(value[0], 2.58);
  EXPECT_DOUBLE_EQ(value[2], -327.68);
  EXPECT_DOUBLE_EQ(value[3], -0.002);
}

TEST_F(AtiTest, SaturationIsTheStatusBitOrAChannelAtItsEnd) {
  Reading reading;
  EXPECT_FALSE(reading.saturated());
  reading.status = status_saturated;
  EXPECT_TRUE(reading.saturated());
  reading.status = 0;
  reading.counts[4] = 32766;
  EXPECT_FALSE(reading.saturated());
  reading.counts[4] = 32767;
  EXPECT_TRUE(reading.saturated());
  reading.counts[4] = -32768;
  EXPECT_TRUE(reading.saturated());
}

TEST_F(AtiTest, NeverMixesTwoSamples) {
  (void)client.request();
  EXPECT_FALSE(client.receive(first));
  (void)client.request();                // the second reply was lost; a new request
  EXPECT_FALSE(client.receive(second));  // late
  EXPECT_FALSE(client.receive(first));
  EXPECT_TRUE(client.receive(second));
  EXPECT_FALSE(client.receive(second));  // twice
  EXPECT_FALSE(client.receive(first));   // not asked for
  CanFrame cut = first;
  cut.length = 7;
  (void)client.request();
  EXPECT_FALSE(client.receive(cut));
  EXPECT_EQ(client.unexpected(), 4u);
  EXPECT_EQ(client.readings(), 1u);
}

}  // namespace
}  // namespace trocar::hal::ati
