// A rig description and a wired rig for tests: link, two in-memory buses, simulated drives and sensor, a virtual clock.
#pragma once

#include <array>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "common/rig/rig.hpp"
#include "hal/can/memory_bus.hpp"
#include "hal/rig_link.hpp"

namespace trocar::hal {

inline rig::Rig make_test_rig(rig::Kind kind = rig::Kind::Twin) {
  rig::Rig rig;
  rig.kind = kind;
  rig.actuation.torque_constant_nm_per_a = 0.0525;
  rig.actuation.continuous_current_a = 2.0;
  rig.actuation.peak_current_a = 10.0;
  rig.actuation.gear_ratio = {5, 5, 10, 10};
  rig.actuation.gear_efficiency = 0.8;
  rig.actuation.encoder_counts_per_turn = 16000;
  rig.timing.tick_hz = 1000;
  rig.timing.heartbeat_ms = 20;
  rig.timing.heartbeat_timeout_ms = 60;
  rig.sensor.counts_per_n = 400;
  rig.sensor.counts_per_nm = 20000;
  rig.buses.bitrate_bps = 1'000'000;
  rig.buses.drive_node = {1, 2, 3, 4};
  rig.buses.master_node = 127;
  rig.buses.sensor_base_id = 0x1B0;
  return rig;
}

}  // namespace trocar::hal
