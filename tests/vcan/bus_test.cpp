// One CAN interface and what the kernel does with it: frames of every kind, filters, error frames, time stamps, losses.
#include <gtest/gtest.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <string>

#include "hal/can/socketcan_bus.hpp"
#include "hal/realtime/clock.hpp"
#include "hal/rig_link.hpp"
#include "rig_fixture.hpp"

namespace trocar::hal {
namespace {

bool receive_soon(SocketCanBus& bus, CanFrame& frame) {
  const int descriptor = bus.file_descriptor();
  realtime::wait_for_input(std::span{&descriptor, 1}, realtime::monotonic_now_ns() + 2'000'000'000);
  return bus.receive(frame, realtime::monotonic_now_ns());
}

// A socket without our code on it, which may send what ours refuses to.
struct RawSocket {
  RawSocket() : descriptor(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex("vcan0"));
    const int on = 1;
    if (::setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        ::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      ADD_FAILURE() << std::strerror(errno);
  }
  ~RawSocket() { ::close(descriptor); }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;
  template <class Raw>
  void send(const Raw& raw) const {
    EXPECT_EQ(::write(descriptor, &raw, sizeof raw), static_cast<ssize_t>(sizeof raw)) << std::strerror(errno);
  }
  void report_error(std::uint32_t classes, std::uint8_t controller) const {
    can_frame raw{};
    raw.can_id = CAN_ERR_FLAG | classes;
    raw.can_dlc = 8;
    raw.data[1] = controller;
    send(raw);
  }
  int descriptor;
};

TEST(SocketCan, CarriesEveryKindOfFrame) {
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
    CanFrame received;
    ASSERT_TRUE(receive_soon(b, received));
    EXPECT_EQ(received, sent);
    EXPECT_LE(received.stamp_ns, realtime::monotonic_now_ns());
    EXPECT_GT(received.stamp_ns, realtime::monotonic_now_ns() - 1'000'000'000);
  }
  CanFrame none;
  EXPECT_FALSE(a.receive(none, 0));  // its own frames do not come back
  EXPECT_EQ(b.counters().received, 4u);
}

TEST(SocketCan, StampsFramesWithTheirReceptionAndNotWithTheRead) {
  SocketCanBus a;
  SocketCanBus b;
  ASSERT_TRUE(a.open("vcan0").ok());
  ASSERT_TRUE(b.open("vcan0").ok());
  const std::int64_t before_ns = realtime::monotonic_now_ns();
  ASSERT_TRUE(a.send(CanFrame{.id = 0x181}, 0));
  const std::int64_t after_ns = realtime::monotonic_now_ns();
  realtime::sleep_until(after_ns + 30'000'000);
  CanFrame frame;
  ASSERT_TRUE(b.receive(frame, realtime::monotonic_now_ns()));
  // The two clocks are read one after the other, which may take a while on a loaded machine.
  EXPECT_GT(frame.stamp_ns, before_ns - 10'000'000);
  EXPECT_LT(frame.stamp_ns, after_ns + 10'000'000);
}

TEST(SocketCan, HandsOverManyFramesInTheirOrderAndCountsWhatTheQueueLost) {
  SocketCanBus a;
  SocketCanBus b;
  ASSERT_TRUE(a.open("vcan0").ok());
  ASSERT_TRUE(b.open("vcan0").ok());
  std::uint32_t sent = 0;
  for (std::uint32_t i = 0; i < 3000; ++i) {
    CanFrame frame{.id = 0x123, .length = 4};
    store(frame, 0, i);
    sent += a.send(frame, 0) ? 1u : 0u;
  }
  CanFrame frame;
  std::uint32_t received = 0;
  while (b.receive(frame, 0)) EXPECT_EQ(load<std::uint32_t>(frame, 0), received++);
  EXPECT_GT(received, 16u);
  EXPECT_LT(received, sent);  // its queue is shorter than that
  ASSERT_TRUE(a.send(CanFrame{.id = 0x124}, 0));
  ASSERT_TRUE(receive_soon(b, frame));  // the next frame tells what was lost before it
  EXPECT_EQ(b.counters().receive_dropped, sent - received);
}

TEST(SocketCan, ReceivesOnlyTheIdentifiersAskedFor) {
  SocketCanBus a;
  SocketCanBus b;
  ASSERT_TRUE(a.open("vcan0").ok());
  const std::array<std::uint32_t, 2> ids{0x181, 0x701};
  ASSERT_TRUE(b.open("vcan0", ids).ok());
  CanFrame extended{.id = 0x181};
  extended.extended = true;
  CanFrame remote{.id = 0x181};
  remote.remote = true;
  for (const CanFrame& frame :
       {CanFrame{.id = 0x182}, extended, remote, CanFrame{.id = 0x581}, CanFrame{.id = 0x181}, CanFrame{.id = 0x701}})
    ASSERT_TRUE(a.send(frame, 0));
  CanFrame frame;
  ASSERT_TRUE(receive_soon(b, frame));
  EXPECT_EQ(frame, CanFrame{.id = 0x181});
  ASSERT_TRUE(b.receive(frame, 0));
  EXPECT_EQ(frame, CanFrame{.id = 0x701});
  EXPECT_FALSE(b.receive(frame, 0));
}

TEST(SocketCan, HearsErrorReportsThroughItsFilterAndNamesThem) {
  const RawSocket controller;
  SocketCanBus bus;
  const std::array<std::uint32_t, 1> ids{0x181};
  ASSERT_TRUE(bus.open("vcan0", ids).ok());
  controller.report_error(0x04, 0x30);
  CanFrame frame;
  ASSERT_TRUE(receive_soon(bus, frame));
  EXPECT_TRUE(frame.error);
  EXPECT_EQ(bus.counters().condition, BusCondition::Passive);
  controller.report_error(0x40, 0);
  ASSERT_TRUE(receive_soon(bus, frame));
  EXPECT_EQ(bus.counters().condition, BusCondition::Off);
  EXPECT_EQ(bus.counters().bus_off, 1u);
}

TEST(SocketCan, LeavesCanFdFramesOutAndCountsThem) {
  const RawSocket other;
  SocketCanBus bus;
  ASSERT_TRUE(bus.open("vcan0").ok());
  canfd_frame fd{};
  fd.can_id = 0x181;
  fd.len = 64;
  other.send(fd);
  can_frame classic{};
  classic.can_id = 0x182;
  other.send(classic);
  CanFrame frame;
  ASSERT_TRUE(receive_soon(bus, frame));
  EXPECT_EQ(frame.id, 0x182u);
  EXPECT_EQ(bus.counters().unsupported, 1u);
}

TEST(SocketCan, IsRefusedWhileItsInterfaceIsNoCanInterface) {
  SocketCanBus bus;
  const OpenStatus status = bus.open("lo");
  ASSERT_FALSE(status.ok());
  EXPECT_NE(std::string{status.message.data()}.find("is it a CAN interface?"), std::string::npos) << status.message.data();
}

TEST(RigLinkOnSocketCan, IsDownOnceBusOffIsReported) {
  const RawSocket controller;
  const rig::Rig rig = make_test_rig();
  SocketCanBus drives;
  SocketCanBus sensor;
  ASSERT_TRUE(drives.open("vcan0", canopen::received_ids(rig).all()).ok());
  ASSERT_TRUE(sensor.open("vcan1").ok());
  RigLink<SocketCanBus> link{rig, drives, sensor};
  link.begin_tick(0);
  EXPECT_EQ(link.feedback().state, LinkState::BringUp);
  controller.report_error(0x04, 0x20);
  link.poll(1);
  EXPECT_EQ(link.bus_report().drives, BusCondition::Passive);
  EXPECT_NE(std::string{link.bring_up_step()}.find("error passive"), std::string::npos);
  controller.report_error(0x40, 0);
  link.poll(2);
  EXPECT_EQ(link.feedback().state, LinkState::Down);
  const std::uint64_t sent = drives.counters().sent;
  link.begin_tick(1'000'000);
  link.end_tick(1'500'000, {.request = DriveRequest::Enable});
  EXPECT_EQ(drives.counters().sent, sent);
  EXPECT_NE(std::string{link.bring_up_step()}.find("off the bus"), std::string::npos);
}

}  // namespace
}  // namespace trocar::hal
