#include "hal/can/udp_bus.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>

#include <cerrno>
#include <memory>
#include <string>
#include <vector>

#include "bare_socket.hpp"
#include "hal/can/endpoint_bus.hpp"
#include "hal/realtime/clock.hpp"

namespace trocar::hal {
namespace {

// Loopback delivers at once or almost; the deadline only ends a failing test.
bool receive_soon(UdpBus& bus, CanFrame& frame) {
  const std::int64_t deadline_ns = realtime::monotonic_now_ns() + 2'000'000'000;
  do {
    if (bus.receive(frame, 123)) return true;
    const int descriptor = bus.file_descriptor();
    realtime::wait_for_input(std::span{&descriptor, 1}, deadline_ns);
  } while (realtime::monotonic_now_ns() < deadline_ns);
  return false;
}

struct UdpPair : ::testing::Test {
  void SetUp() override {
    const std::uint16_t rig_port = free_port();
    const std::uint16_t plant_port = free_port();
    ASSERT_TRUE(rig->open("127.0.0.1", rig_port, plant_port).ok());
    ASSERT_TRUE(plant->open("127.0.0.1", plant_port, rig_port).ok());
  }
  std::unique_ptr<UdpBus> rig = std::make_unique<UdpBus>();
  std::unique_ptr<UdpBus> plant = std::make_unique<UdpBus>();
  CanFrame frame;
};

TEST_F(UdpPair, CarriesFramesBothWaysInOrder) {
  for (std::uint32_t i = 0; i < 300; ++i) {  // more than one datagram
    CanFrame out{.id = i, .length = static_cast<std::uint8_t>(i % 9)};
    store(out, 0, i);
    ASSERT_TRUE(rig->send(out, 0));
  }
  rig->flush(0);
  for (std::uint32_t expected = 0; expected < 300; ++expected) {
    ASSERT_TRUE(receive_soon(*plant, frame));
    EXPECT_EQ(frame.id, expected);
    EXPECT_EQ(frame.length, expected % 9);
  }
  EXPECT_EQ(rig->counters().sent, 300u);
  EXPECT_EQ(plant->counters().received, 300u);
  EXPECT_EQ(plant->counters().lost_datagrams, 0u);

  plant->send(CanFrame{.id = 0x181}, 0);
  plant->flush(0);
  ASSERT_TRUE(receive_soon(*rig, frame));
  EXPECT_EQ(frame.id, 0x181u);
  EXPECT_EQ(frame.stamp_ns, 123);
}

TEST(UdpBus, SpeaksCannelloniOnTheWireAndCountsWhatIsNot) {
  BareSocket peer;
  UdpBus bus;
  const std::uint16_t port = free_port();
  ASSERT_TRUE(bus.open("127.0.0.1", port, peer.port).ok());
  bus.send(CanFrame{.id = 0x080}, 0);
  bus.flush(0);
  std::array<std::uint8_t, 64> bytes{};
  ASSERT_EQ(::recv(peer.descriptor, bytes.data(), bytes.size(), 0), 10);
  const std::array<std::uint8_t, 10> expected{2, 0, 0, 0, 1, 0, 0, 0, 0x80, 0};
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), bytes.begin()));

  CanFrame frame;
  peer.send_to(port, {2, 0, 7, 0, 1, 0, 0, 1, 0x81, 8, 1, 2});      // cut off
  peer.send_to(port, {});                                           // empty
  peer.send_to(port, {2, 0, 7, 0, 0});                              // nothing inside, but well-formed
  peer.send_to(port, {2, 0, 10, 0, 1, 0, 0, 0x01, 0x81, 1, 0x55});  // 8 and 9 are missing
  ASSERT_TRUE(receive_soon(bus, frame));
  EXPECT_EQ(frame.id, 0x181u);
  EXPECT_EQ(frame.data[0], 0x55);
  EXPECT_EQ(bus.counters().malformed, 2u);
  EXPECT_EQ(bus.counters().lost_datagrams, 2u);

  BareSocket stranger;
  stranger.send_to(port, {2, 0, 11, 0, 1, 0, 0, 0x01, 0x82, 0});
  peer.send_to(port, {2, 0, 11, 0, 1, 0, 0, 0x01, 0x83, 0});
  ASSERT_TRUE(receive_soon(bus, frame));
  EXPECT_EQ(frame.id, 0x183u);  // only the peer is heard
  EXPECT_FALSE(bus.receive(frame, 0));
}

TEST(UdpBus, TellsThatItsPortIsTaken) {
  BareSocket holder;
  UdpBus bus;
  const OpenStatus status = bus.open("127.0.0.1", holder.port, free_port());
  EXPECT_EQ(status.error_number, EADDRINUSE);
  EXPECT_EQ(std::string{status.message.data()}.find("UDP port " + std::to_string(holder.port) + " on 127.0.0.1 is taken"), 0u)
      << status.message.data();
  EXPECT_EQ(bus.file_descriptor(), -1);
  EXPECT_FALSE(bus.send(CanFrame{}, 0));
  EXPECT_EQ(bus.counters().send_dropped, 1u);
}

TEST(UdpBus, TellsThatItsHostIsNotHere) {
  UdpBus bus;
  EXPECT_EQ(bus.open("192.0.2.1", free_port(), free_port()).error_number, EADDRNOTAVAIL);
  const OpenStatus status = bus.open("no host", free_port(), free_port());
  EXPECT_FALSE(status.ok());
  EXPECT_NE(std::string{status.message.data()}.find("no host"), std::string::npos);
}

TEST(UdpBus, LivesWithAPeerThatIsNotThereYet) {
  const std::uint16_t rig_port = free_port();
  const std::uint16_t plant_port = free_port();
  UdpBus rig;
  ASSERT_TRUE(rig.open("127.0.0.1", rig_port, plant_port).ok());
  CanFrame frame;
  for (int i = 0; i < 5; ++i) {
    rig.send(CanFrame{.id = 0x80}, 0);
    rig.flush(0);
    EXPECT_FALSE(rig.receive(frame, 0));
  }
  EXPECT_EQ(rig.counters().sent + rig.counters().send_dropped, 5u);
  UdpBus plant;
  ASSERT_TRUE(plant.open("127.0.0.1", plant_port, rig_port).ok());
  rig.send(CanFrame{.id = 0x81}, 0);
  rig.flush(0);
  ASSERT_TRUE(receive_soon(plant, frame));
  EXPECT_EQ(frame.id, 0x81u);
}

TEST(EndpointBus, OpensWhatTheRigFileNames) {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.host.data(), endpoint.host.size(), "127.0.0.1");
  endpoint.rig_port = free_port();
  endpoint.plant_port = free_port();
  EndpointBus rig;
  EndpointBus plant;
  ASSERT_TRUE(rig.open(endpoint, BusSide::Rig).ok());
  ASSERT_TRUE(plant.open(endpoint, BusSide::Plant).ok());
  EXPECT_EQ(EndpointBus{}.open(endpoint, BusSide::Rig).error_number, EADDRINUSE);

  std::snprintf(endpoint.interface.data(), endpoint.interface.size(), "no_such_can");
  EXPECT_FALSE(EndpointBus{}.open(endpoint, BusSide::Rig).ok());
}

}  // namespace
}  // namespace trocar::hal
