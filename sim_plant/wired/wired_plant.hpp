// The simulated machine with its electronics: physics, drives and force sensor, and the hand at its handle. Frames in, frames out; time is
// the caller's.
// Order of a step: advance(now), receive every frame that has arrived, then transmit until empty.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/rig/rig.hpp"
#include "hal/can/frame.hpp"
#include "sim_plant/hand/hand.hpp"
#include "sim_plant/nodes/drive_node.hpp"
#include "sim_plant/nodes/sensor_node.hpp"
#include "sim_plant/plant/plant.hpp"

namespace trocar::sim_plant {

// How a drive lies or fails, beyond what its node does by itself (sim_plant/faults).
struct DriveTrouble {
  bool stuck{}, backwards{};  // encoder, from the angle at which it began
  double jump_rad{};
  bool dead{}, full{};  // motor: no torque, or peak torque
};

class WiredPlant {
 public:
  WiredPlant(const rig::Rig& rig, const PlantConfig& plant, const std::optional<scene::Scene>& scene, std::uint64_t seed)
      : physics_(rig, plant, scene, seed), sensor_(make_sensor_config(rig)) {
    // Incremental encoders read anything at power-on; homing has to find out.
    Random offsets(seed);
    for (std::size_t i = 0; i < drives; ++i)
      drive_.emplace_back(make_drive_config(rig, i, static_cast<std::int32_t>(offsets.bits() % 20000) - 10000));
    peak_torque_nm_ = rig.actuation.torque_constant_nm_per_a * rig.actuation.peak_current_a;
    set_shafts();
  }

  static constexpr std::size_t drives = capacity::drives;

  void advance(std::int64_t now_ns) noexcept {
    std::array<double, drives> torque{};
    for (std::size_t i = 0; i < drives; ++i)
      torque[i] = trouble_[i].dead ? 0.0 : trouble_[i].full && enabled(i) ? peak_torque_nm_ : drive_[i].motor_torque_nm();
    // The hand goes with the handle step by step: held over a longer one, its grip would feed energy in.
    for (std::int64_t t = physics_.time_ns() + physics_.step_ns(); hand_ != nullptr && t <= now_ns; t += physics_.step_ns()) {
      hand_->notice(motors_on(), 1e-9 * static_cast<double>(t), physics_.pose());
      physics_.set_hand_wrench(hand_->advance(1e-9 * static_cast<double>(t), physics_.pose(), physics_.velocity(),
                                              1e-9 * static_cast<double>(physics_.step_ns())));
      physics_.advance_to(t, torque);
    }
    physics_.advance_to(now_ns, torque);
    set_shafts();
    for (auto& drive : drive_) drive.advance(now_ns);
  }
  void drive_receives(std::size_t drive, const hal::CanFrame& frame, std::int64_t now_ns) noexcept { drive_[drive].receive(frame, now_ns); }
  void sensor_receives(const hal::CanFrame& frame, std::int64_t now_ns) noexcept { sensor_.receive(frame, now_ns); }
  bool drive_transmits(std::size_t drive, hal::CanFrame& frame) noexcept { return drive_[drive].transmit(frame); }
  bool sensor_transmits(hal::CanFrame& frame) noexcept { return sensor_.transmit(frame); }

  // From now on this hand may hold the handle; it has to outlive the plant. nullptr: nobody.
  void give_to(Hand* hand) noexcept {
    hand_ = hand;
    if (hand == nullptr) physics_.set_hand_wrench({});
  }
  [[nodiscard]] bool motors_on() const noexcept {
    return std::ranges::all_of(drive_, [](const DriveNode& d) { return d.state() == hal::canopen::DriveState::OperationEnabled; });
  }

  void trouble(std::size_t i, const DriveTrouble& now) noexcept {
    const bool lied = trouble_[i].stuck || trouble_[i].backwards;
    if (!lied && (now.stuck || now.backwards)) turned_at_rad_[i] = physics_.joint_angle_rad()[i];
    trouble_[i] = now;
  }
  void saturate_sensor(bool on) noexcept { sensor_saturated_ = on; }

  [[nodiscard]] const Plant& physics() const noexcept { return physics_; }
  [[nodiscard]] const DriveNode& drive(std::size_t i) const noexcept { return drive_[i]; }
  [[nodiscard]] DriveNode& drive(std::size_t i) noexcept { return drive_[i]; }

 private:
  [[nodiscard]] bool enabled(std::size_t i) const noexcept { return drive_[i].state() == hal::canopen::DriveState::OperationEnabled; }
  void set_shafts() noexcept {
    const auto torque = physics_.joint_torque_nm();
    for (std::size_t i = 0; i < drives; ++i) {
      double angle = physics_.joint_angle_rad()[i];
      if (trouble_[i].stuck) angle = turned_at_rad_[i];
      if (trouble_[i].backwards) angle = 2.0 * turned_at_rad_[i] - angle;
      drive_[i].set_shaft(angle + trouble_[i].jump_rad, torque[i]);
    }
    sensor_.set_wrench(sensor_saturated_ ? std::array<double, 6>{1e6, 1e6, 1e6, 1e6, 1e6, 1e6} : physics_.sensor_wrench());
  }

  Plant physics_;
  std::vector<DriveNode> drive_;
  SensorNode sensor_;
  std::array<DriveTrouble, drives> trouble_{};
  std::array<double, drives> turned_at_rad_{};
  double peak_torque_nm_{};  // of a motor
  bool sensor_saturated_{};
  Hand* hand_{nullptr};
};

}  // namespace trocar::sim_plant
