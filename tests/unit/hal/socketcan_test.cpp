// On a kernel without CAN only the refusals can be tried; with vcan0 up (the CAN test machine), the traffic too.
#include "hal/can/socketcan_bus.hpp"

#include <gtest/gtest.h>
#include <net/if.h>

#include <cerrno>
#include <cstdlib>
#include <string>

#include "hal/realtime/clock.hpp"

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

TEST(SocketCan, CarriesEveryKindOfFrame) {
  // Only a kernel with the vcan module has such an interface, and a process cannot bring one along.
  if (::if_nametoindex("vcan0") == 0) GTEST_SKIP() << "no vcan0 here: load vcan and bring it up";
  SocketCanBus a;
  SocketCanBus b;
  ASSERT_TRUE(a.open("vcan0").ok());
  ASSERT_TRUE(b.open("vcan0").ok());
  CanFrame data{.id = 0x181, .length = 8};
  data.data = {1, 2, 3, 4, 5, 6, 7, 8};
  CanFrame remote{.id = 0x702, .length = 1};
  remote.remote = true;
  CanFrame extended{.id = 0x12345678, .length = 2};
  extended.extended = true;
  for (const CanFrame& sent : {data, remote, extended, CanFrame{.id = 0x80}}) {
    ASSERT_TRUE(a.send(sent, 0));
    const int descriptor = b.file_descriptor();
    ASSERT_TRUE(realtime::wait_for_input(std::span{&descriptor, 1}, realtime::monotonic_now_ns() + 2'000'000'000));
    CanFrame received;
    const std::int64_t now_ns = realtime::monotonic_now_ns();
    ASSERT_TRUE(b.receive(received, now_ns));
    EXPECT_EQ(received, sent);
    EXPECT_LE(received.stamp_ns, now_ns);
    EXPECT_GT(received.stamp_ns, now_ns - 1'000'000'000);
  }
  CanFrame none;
  EXPECT_FALSE(a.receive(none, 0));  // its own frames do not come back
  EXPECT_EQ(b.counters().received, 4u);
}

}  // namespace
}  // namespace trocar::hal
