// The link over real sockets: UDP always, vcan0 and vcan1 where the kernel has them. Time stays a number; sockets on one machine
// deliver at once.
#include <gtest/gtest.h>
#include <net/if.h>

#include <cstdio>
#include <memory>
#include <tuple>
#include <vector>

#include "bare_socket.hpp"
#include "hal/can/endpoint_bus.hpp"
#include "wired_rig.hpp"

namespace trocar::hal {
namespace {

rig::BusEndpoint udp_endpoint() {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.host.data(), endpoint.host.size(), "127.0.0.1");
  endpoint.rig_port = free_port();
  endpoint.plant_port = free_port();
  return endpoint;
}

rig::BusEndpoint can_endpoint(const char* interface) {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.interface.data(), endpoint.interface.size(), "%s", interface);
  return endpoint;
}

struct SocketLinkTest : ::testing::Test {
  void open(const rig::BusEndpoint& drives_at, const rig::BusEndpoint& sensor_at) {
    for (const auto& [bus, endpoint, side] : {std::tuple{&bus_->rig_drives, &drives_at, BusSide::Rig},
                                              {&bus_->rig_sensor, &sensor_at, BusSide::Rig},
                                              {&bus_->plant_drives, &drives_at, BusSide::Plant},
                                              {&bus_->plant_sensor, &sensor_at, BusSide::Plant}}) {
      const OpenStatus status = bus->open(*endpoint, side);
      ASSERT_TRUE(status.ok()) << status.message.data();
    }
  }
  void step_plant(std::int64_t now_ns) {
    CanFrame frame;
    while (bus_->plant_drives.receive(frame, now_ns))
      for (sim_plant::DriveNode& node : drive) node.receive(frame, now_ns);
    for (sim_plant::DriveNode& node : drive) {
      node.advance(now_ns);
      while (node.transmit(frame)) bus_->plant_drives.send(frame, now_ns);
    }
    bus_->plant_drives.flush(now_ns);
    while (bus_->plant_sensor.receive(frame, now_ns)) sensor.receive(frame, now_ns);
    while (sensor.transmit(frame)) bus_->plant_sensor.send(frame, now_ns);
    bus_->plant_sensor.flush(now_ns);
  }
  void run_to_enabled() {
    for (std::size_t i = 0; i < rig.drives(); ++i) drive.emplace_back(sim_plant::make_drive_config(rig, i));
    RigLink<EndpointBus> link{rig, bus_->rig_drives, bus_->rig_sensor};
    LinkCommand command{.request = DriveRequest::Enable};
    std::size_t enabled = 0;
    bool answered = false;
    for (std::int64_t now_ns = 0; now_ns < 3'000'000'000 && (enabled < 4 || !answered); now_ns += 1'000'000) {
      link.begin_tick(now_ns);
      step_plant(now_ns);
      answered = link.poll(now_ns);
      link.end_tick(now_ns, command);
      step_plant(now_ns);
      enabled = 0;
      for (const DriveFeedback& f : link.feedback().drive) enabled += f.enabled ? 1u : 0u;
    }
    EXPECT_EQ(enabled, 4u) << link.bring_up_step();
    EXPECT_TRUE(answered);
    EXPECT_EQ(link.counters().drives_bus.malformed + link.counters().drives_bus.lost_datagrams, 0u);
  }

  struct Buses {
    EndpointBus rig_drives, rig_sensor, plant_drives, plant_sensor;
  };
  std::unique_ptr<Buses> bus_ = std::make_unique<Buses>();
  rig::Rig rig = make_test_rig();
  std::vector<sim_plant::DriveNode> drive;
  sim_plant::SensorNode sensor{sim_plant::make_sensor_config(rig)};
};

TEST_F(SocketLinkTest, EnablesFourDrivesOverUdp) {
  open(udp_endpoint(), udp_endpoint());
  run_to_enabled();
}

TEST_F(SocketLinkTest, EnablesFourDrivesOverSocketCan) {
  // Only a kernel with the vcan module has such an interface, and a process cannot bring one along.
  if (::if_nametoindex("vcan0") == 0 || ::if_nametoindex("vcan1") == 0) GTEST_SKIP() << "no vcan0, vcan1 here: load vcan and bring them up";
  open(can_endpoint("vcan0"), can_endpoint("vcan1"));
  run_to_enabled();
}

}  // namespace
}  // namespace trocar::hal
