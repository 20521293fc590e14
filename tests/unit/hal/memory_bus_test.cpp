#include "hal/can/memory_bus.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "hal/can/bits.hpp"

namespace trocar::hal {
namespace {
static_assert(CanBus<MemoryPort>);

CanFrame make(std::uint32_t id, std::uint8_t length = 0) { return CanFrame{.id = id, .length = length}; }

struct MemoryBusTest : ::testing::Test {
  std::unique_ptr<MemoryBus> owner = std::make_unique<MemoryBus>(1'000'000);
  MemoryBus& bus = *owner;
  MemoryPort& a = bus.port(0);
  MemoryPort& b = bus.port(1);
  MemoryPort& listener = bus.port(2);
  CanFrame frame;
};

TEST_F(MemoryBusTest, DeliversAfterTheBitsOfTheFrame) {
  a.send(make(0x080), 1000);
  const std::int64_t end_ns = 1000 + (51 - 3) * 1000;  // SYNC: 51 bits, of which 3 are intermission
  EXPECT_FALSE(b.receive(frame, end_ns - 1));
  ASSERT_TRUE(b.receive(frame, end_ns));
  EXPECT_EQ(frame, make(0x080));
  EXPECT_EQ(frame.stamp_ns, end_ns);
  EXPECT_FALSE(a.receive(frame, end_ns));  // not to its sender
  EXPECT_EQ(bus.busy_ns(), 51'000);
}

TEST_F(MemoryBusTest, LowestIdentifierWinsWhateverTheOrderOfTheCalls) {
  a.send(make(0x300), 0);
  bus.advance(0);  // the clock has not passed the instant: still open
  b.send(make(0x100), 0);
  ASSERT_TRUE(listener.receive(frame, 1'000'000));
  EXPECT_EQ(frame.id, 0x100u);
  ASSERT_TRUE(listener.receive(frame, 1'000'000));
  EXPECT_EQ(frame.id, 0x300u);
}

TEST_F(MemoryBusTest, RunningFrameIsNotInterruptedAndTheNextOneFollowsTheIntermission) {
  a.send(make(0x700), 0);
  b.send(make(0x001), 10'000);
  ASSERT_TRUE(listener.receive(frame, 1'000'000));
  EXPECT_EQ(frame.id, 0x700u);
  const std::int64_t first_ns = can_bits(make(0x700)) * 1000;
  EXPECT_EQ(frame.stamp_ns, first_ns - 3000);
  ASSERT_TRUE(listener.receive(frame, 1'000'000));
  EXPECT_EQ(frame.stamp_ns, first_ns + (can_bits(make(0x001)) - 3) * 1000);
}

TEST_F(MemoryBusTest, OnePortSendsInTheOrderOfItsCalls) {
  a.send(make(0x300), 0);
  a.send(make(0x000), 0);
  ASSERT_TRUE(listener.receive(frame, 1'000'000));
  EXPECT_EQ(frame.id, 0x300u);
}

TEST_F(MemoryBusTest, DataFrameWinsAgainstRemoteAndStandardAgainstExtended) {
  CanFrame remote = make(0x100);
  remote.remote = true;
  CanFrame extended = make(0x100u << 18);
  extended.extended = true;
  a.send(extended, 0);
  b.send(remote, 0);
  listener.send(make(0x100), 0);
  MemoryPort& last = bus.port(3);
  ASSERT_TRUE(last.receive(frame, 1'000'000));
  EXPECT_EQ(frame, make(0x100));
  ASSERT_TRUE(last.receive(frame, 1'000'000));
  EXPECT_EQ(frame, remote);
  ASSERT_TRUE(last.receive(frame, 1'000'000));
  EXPECT_EQ(frame, extended);
}

TEST_F(MemoryBusTest, HalfTheBitRateTakesTwiceTheTime) {
  const auto slow = std::make_unique<MemoryBus>(500'000);
  MemoryPort& receiver = slow->port(1);
  slow->port(0).send(make(0x080), 0);
  EXPECT_FALSE(receiver.receive(frame, 95'999));
  EXPECT_TRUE(receiver.receive(frame, 96'000));
}

TEST_F(MemoryBusTest, CountsWhatDoesNotFit) {
  for (std::size_t i = 0; i < capacity::can_queue; ++i) EXPECT_TRUE(a.send(make(1), 0));
  EXPECT_FALSE(a.send(make(1), 0));
  EXPECT_EQ(a.counters().send_dropped, 1u);
  bus.advance(1'000'000'000);
  for (std::size_t i = 0; i < 3; ++i) a.send(make(1), 1'000'000'000);
  bus.advance(2'000'000'000);
  EXPECT_EQ(b.counters().receive_dropped, 3u);  // nobody has read the first ones
  EXPECT_FALSE(a.send(make(0x800), 0));         // no such identifier
  EXPECT_FALSE(a.send(make(1, 9), 0));
  EXPECT_EQ(a.counters().send_dropped, 3u);
}

}  // namespace
}  // namespace trocar::hal
