// What needs no CAN interface; the traffic is in tests/vcan.
#include "hal/can/socketcan_bus.hpp"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

namespace trocar::hal {
namespace {

TEST(SocketCan, RefusesAMissingInterfaceByNameOrAMissingKernelPart) {
  SocketCanBus bus;
  const OpenStatus status = bus.open("no_such_can");
  ASSERT_FALSE(status.ok());
  const std::string message{status.message.data()};
  if (status.error_number == ENODEV)
    EXPECT_NE(message.find("no_such_can"), std::string::npos) << message;
  else
    EXPECT_NE(message.find("can_raw"), std::string::npos) << message;
  EXPECT_EQ(bus.file_descriptor(), -1);
  EXPECT_FALSE(bus.send(CanFrame{}, 0));
  CanFrame frame;
  EXPECT_FALSE(bus.receive(frame, 0));
  EXPECT_EQ(bus.counters().send_dropped, 1u);
}

TEST(SocketCan, RefusesANameThatNoInterfaceCanHave) {
  SocketCanBus bus;
  EXPECT_FALSE(bus.open("a_name_of_more_than_fifteen_characters").ok());
}

TEST(SocketCan, RefusesMoreIdentifiersThanASocketTakes) {
  const std::vector<std::uint32_t> ids(513);
  SocketCanBus bus;
  EXPECT_FALSE(bus.open("vcan0", ids).ok());
}

TEST(HardwareClock, BelievesTheLeastDelayAndFollowsAClockThatDrifts) {
  HardwareClock clock;
  // Hardware that began 7 s earlier; the kernel's stamps are late by 2 to 90 us.
  constexpr std::int64_t us = 1000, ms = 1'000'000;
  const std::int64_t begin = 7'000 * ms;
  EXPECT_EQ(clock.carry_over(begin, 90 * us), 90 * us);
  EXPECT_EQ(clock.carry_over(begin + 1 * ms, 1 * ms + 2 * us), 1 * ms + 2 * us);
  // 200 ns a millisecond is what two quartzes may drift apart.
  EXPECT_EQ(clock.carry_over(begin + 2 * ms, 2 * ms + 60 * us), 2 * ms + 2 * us + 200);
  // A hardware clock that is slow by 100 ppm: a second later it is 100 us behind, and the stamps stay within 200 us and never late.
  for (std::int64_t t = 3; t < 3000; ++t) {
    const std::int64_t truth = t * ms;
    const std::int64_t stamp = clock.carry_over(begin + truth - truth / 10'000, truth + 2 * us + (t % 7) * 10 * us);
    EXPECT_LE(stamp, truth + 2 * us + (t % 7) * 10 * us);
    EXPECT_NEAR(static_cast<double>(stamp), static_cast<double>(truth + 2 * us), 5.0 * us);
  }
}

TEST(ErrorReport, NamesWhatTheControllerSays) {
  const auto report = [](std::uint32_t classes, std::uint8_t detail) {
    CanFrame frame{.id = classes, .length = 8};
    frame.error = true;
    frame.data[1] = detail;
    return frame;
  };
  BusCounters counters;
  const auto take = [&](const CanFrame& frame) { count_received(counters, frame); };
  take(report(0x04, 0x08));  // transmit error counter at 96
  EXPECT_EQ(counters.condition, BusCondition::Warning);
  take(report(0x04, 0x20));
  take(report(0x24, 0x20));  // and nobody acknowledges
  EXPECT_EQ(counters.condition, BusCondition::Passive);
  EXPECT_EQ(counters.error_passive, 1u);
  EXPECT_EQ(counters.no_acknowledge, 1u);
  take(report(0x04, 0x01));  // a frame lost in the controller: says nothing of its state
  EXPECT_EQ(counters.condition, BusCondition::Passive);
  EXPECT_EQ(counters.overflows, 1u);
  take(report(0x02, 0x00));  // lost arbitration: neither
  EXPECT_EQ(counters.condition, BusCondition::Passive);
  take(report(0x40, 0x00));
  EXPECT_EQ(counters.condition, BusCondition::Off);
  EXPECT_EQ(counters.bus_off, 1u);
  take(report(0x100, 0x00));
  EXPECT_EQ(counters.condition, BusCondition::Active);
  EXPECT_EQ(counters.error_frames, 7u);
  EXPECT_EQ(counters.received, 0u);
  EXPECT_NE(std::string{to_string(BusCondition::Off)}.find("off the bus"), std::string::npos);
}

}  // namespace
}  // namespace trocar::hal
