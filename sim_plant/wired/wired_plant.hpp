// The simulated machine with its electronics: physics, drives and force sensor. Frames in, frames out; time is the caller's.
// Order of a step: advance(now), receive every frame that has arrived, then transmit until empty.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/rig/rig.hpp"
#include "hal/can/frame.hpp"
#include "sim_plant/nodes/drive_node.hpp"
#include "sim_plant/nodes/sensor_node.hpp"
#include "sim_plant/plant/plant.hpp"

namespace trocar::sim_plant {

class WiredPlant {
 public:
  WiredPlant(const rig::Rig& rig, const PlantConfig& plant, const scene::Scene& scene, std::uint64_t seed)
      : physics_(rig, plant, scene, seed), sensor_(make_sensor_config(rig)) {
    // Incremental encoders read anything at power-on; homing has to find out.
    Random offsets(seed);
    for (std::size_t i = 0; i < drives; ++i)
      drive_.emplace_back(make_drive_config(rig, i, static_cast<std::int32_t>(offsets.bits() % 20000) - 10000));
    set_shafts();
  }

  static constexpr std::size_t drives = capacity::drives;

  void advance(std::int64_t now_ns) noexcept {
    std::array<double, drives> torque{};
    for (std::size_t i = 0; i < drives; ++i) torque[i] = drive_[i].motor_torque_nm();
    physics_.advance_to(now_ns, torque);
    set_shafts();
    for (auto& drive : drive_) drive.advance(now_ns);
  }
  void drive_receives(std::size_t drive, const hal::CanFrame& frame, std::int64_t now_ns) noexcept { drive_[drive].receive(frame, now_ns); }
  void sensor_receives(const hal::CanFrame& frame, std::int64_t now_ns) noexcept { sensor_.receive(frame, now_ns); }
  bool drive_transmits(std::size_t drive, hal::CanFrame& frame) noexcept { return drive_[drive].transmit(frame); }
  bool sensor_transmits(hal::CanFrame& frame) noexcept { return sensor_.transmit(frame); }

  void set_hand_wrench(const std::array<double, 3>& wrench) noexcept { physics_.set_hand_wrench(wrench); }

  [[nodiscard]] const Plant& physics() const noexcept { return physics_; }
  [[nodiscard]] const DriveNode& drive(std::size_t i) const noexcept { return drive_[i]; }

 private:
  void set_shafts() noexcept {
    const auto torque = physics_.joint_torque_nm();
    for (std::size_t i = 0; i < drives; ++i) drive_[i].set_shaft(physics_.joint_angle_rad()[i], torque[i]);
    sensor_.set_wrench(physics_.sensor_wrench());
  }

  Plant physics_;
  std::vector<DriveNode> drive_;
  SensorNode sensor_;
};

}  // namespace trocar::sim_plant
