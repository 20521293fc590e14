#pragma once

#include "rig_fixture.hpp"
#include "sim_plant/nodes/drive_node.hpp"
#include "sim_plant/nodes/sensor_node.hpp"

namespace trocar::hal {

// The link on port 0, drive i on port 1 + i, the sensor on port 1 of its own bus. 20 steps of 50 us a tick.
struct WiredRig {
  static constexpr std::int64_t step_ns = 50'000;
  static constexpr int steps_per_tick = 20;
  static constexpr int feedback_step = 16;  // the controller reads 0.8 ms after the SYNC

  explicit WiredRig(const rig::Rig& description = make_test_rig())
      : rig{description},
        drives_bus{rig.buses.bitrate_bps},
        sensor_bus{rig.buses.bitrate_bps},
        link{rig, drives_bus.port(0), sensor_bus.port(0)},
        sensor{sim_plant::make_sensor_config(rig)} {
    for (std::size_t i = 0; i < rig.drives(); ++i) {
      drive.emplace_back(sim_plant::make_drive_config(rig, i, 1000 * static_cast<std::int32_t>(i)));
      drives_bus.port(1 + i).flush(0);  // attaches
    }
    powered.fill(true);
  }

  void step_plant() {
    CanFrame frame;
    for (std::size_t i = 0; i < drive.size(); ++i) {
      MemoryPort& port = drives_bus.port(1 + i);
      while (port.receive(frame, now_ns))
        if (powered[i] && (!to_drive || to_drive(i, frame))) drive[i].receive(frame, now_ns);
      if (!powered[i]) continue;
      drive[i].advance(now_ns);
      while (drive[i].transmit(frame))
        if (!from_drive || from_drive(i, frame)) port.send(frame, now_ns);
    }
    MemoryPort& port = sensor_bus.port(1);
    while (port.receive(frame, now_ns))
      if (sensor_powered) sensor.receive(frame, now_ns);
    while (sensor.transmit(frame)) port.send(frame, now_ns);
    if (each_step) each_step();
    now_ns += step_ns;
  }

  // One tick; `command` is what the controller decides.
  void tick() {
    link.begin_tick(now_ns);
    for (int s = 0; s < feedback_step; ++s) step_plant();
    answered = link.poll(now_ns);
    if (controller_alive) link.end_tick(now_ns, command);
    for (int s = feedback_step; s < steps_per_tick; ++s) step_plant();
  }

  bool run_until(const std::function<bool()>& reached, int ticks) {
    for (int t = 0; t < ticks; ++t) {
      if (reached()) return true;
      tick();
    }
    return reached();
  }
  bool operational() const { return link.feedback().state == LinkState::Operational; }
  bool all_enabled() const {
    for (std::size_t i = 0; i < drive.size(); ++i)
      if (!link.feedback().drive[i].enabled) return false;
    return true;
  }
  bool bring_up() {
    return run_until([&] { return operational(); }, 2000);
  }
  bool enable() {
    command.request = DriveRequest::Enable;
    return bring_up() && run_until([&] { return all_enabled(); }, 100);
  }

  rig::Rig rig;
  MemoryBus drives_bus;
  MemoryBus sensor_bus;
  RigLink<MemoryPort> link;
  std::vector<sim_plant::DriveNode> drive;
  sim_plant::SensorNode sensor;
  std::array<bool, capacity::drives> powered{};
  bool sensor_powered{true};
  bool controller_alive{true};
  bool answered{};
  LinkCommand command{};
  std::int64_t now_ns{};
  std::function<bool(std::size_t, CanFrame&)> to_drive;    // false drops the frame; may change it
  std::function<bool(std::size_t, CanFrame&)> from_drive;  // the same, of what a drive sends
  std::function<void()> each_step;
};

}  // namespace trocar::hal
