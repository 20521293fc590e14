// The force/torque sensor as it looks from the wire (ATI Net F/T on CAN, short data): answers a request with two frames of int16
// counts. Adds no noise of its own; the plant's wrench already has it.
#pragma once

#include <array>
#include <cstdint>

#include "common/rig/rig.hpp"
#include "hal/can/fifo.hpp"
#include "hal/can/frame.hpp"

namespace trocar::sim_plant {

struct SensorNodeConfig {
  std::uint32_t base_id{};
  double counts_per_n{};
  double counts_per_nm{};
};
[[nodiscard]] SensorNodeConfig make_sensor_config(const rig::Rig& rig) noexcept;

class SensorNode {
 public:
  explicit SensorNode(const SensorNodeConfig& config) noexcept : config_{config} {}

  // Fx Fy Fz Tx Ty Tz in the sensor's frame, N and N m. Beyond the range of int16 the counts stand at its end and the status says
  // so; a value that is not finite reads 0 with the error bit.
  void set_wrench(const std::array<double, 6>& force_torque) noexcept;
  void receive(const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  bool transmit(hal::CanFrame& frame) noexcept { return outgoing_.pop(frame); }
  [[nodiscard]] std::uint64_t requests() const noexcept { return requests_; }

 private:
  SensorNodeConfig config_;
  std::array<std::int16_t, 6> counts_{};
  std::uint16_t status_{};
  hal::Fifo<hal::CanFrame, 2> outgoing_{};
  std::uint64_t requests_{};
};

}  // namespace trocar::sim_plant
