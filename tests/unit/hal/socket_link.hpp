// The link of a rig and simulated drives, joined by sockets. The protocol's clock is a number; sockets on one machine deliver at once.
#pragma once

#include <gtest/gtest.h>

#include <cstdio>
#include <memory>
#include <tuple>
#include <vector>

#include "hal/can/endpoint_bus.hpp"
#include "wired_rig.hpp"

namespace trocar::hal {

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

}  // namespace trocar::hal
