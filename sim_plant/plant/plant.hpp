// The simulated machine without its electronics' protocol: torque commands in, joint angles and sensor readings out.
// Starts at rest in the rig's homing pose at time 0. A step of 1 / step_hz:
//   motor    T' = w_c (T_command - T), T at the motor in front of the gear, |T_command| <= k_t peak current
//   joint    tau = T * ratio * efficiency (the plant's own efficiency)
//   body     twin_body.hpp, with the needle's base wrench of phantom.hpp at the pose in the middle of the step, and the hand's
//   sensor   what the base applies to the needle + noise, new in each step
// Construction allocates and throws; nothing else does either. Same inputs and seed: same bits.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/rig/rig.hpp"
#include "sim_plant/mechanism/twin_body.hpp"
#include "sim_plant/phantom/phantom.hpp"
#include "sim_plant/plant/config.hpp"
#include "sim_plant/plant/random.hpp"

namespace trocar::sim_plant {

class Plant {
 public:
  // Without a scene nothing stands in front of the machine. Throws std::invalid_argument (fem::Error for the scene): a rig that is no twin,
  // values out of range, a homing pose that the true mechanism cannot take.
  Plant(const rig::Rig& rig, const PlantConfig& plant, const std::optional<scene::Scene>& scene, std::uint64_t seed);

  // Integrates all whole steps that end at or before time_ns with this torque command at the motors, in front of their gears.
  // NaN and infinity count as no torque. Time does not run backwards: an earlier time_ns does nothing.
  void advance_to(std::int64_t time_ns, const std::array<double, 4>& motor_torque_nm) noexcept;

  // What a hand applies to the handle, rig frame: N, N, N m. Holds until it is set again; not finite counts as zero.
  void set_hand_wrench(const std::array<double, 3>& wrench) noexcept;

  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }
  [[nodiscard]] std::int64_t step_ns() const noexcept { return step_ns_; }
  [[nodiscard]] const std::array<double, 4>& joint_angle_rad() const noexcept { return joint_angle_rad_; }  // not wrapped
  // As the drives know it: motor torque times ratio and the rig's nominal efficiency.
  [[nodiscard]] std::array<double, 4> joint_torque_nm() const noexcept;
  // Fx, Fy, Fz, Tx, Ty, Tz; x of the sensor at theta + rig.sensor.angle_rad, z that of the rig.
  [[nodiscard]] const std::array<double, 6>& sensor_wrench() const noexcept { return sensor_wrench_; }

  // The truth, which no sensor of the rig sees.
  [[nodiscard]] std::array<double, 3> pose() const noexcept;
  [[nodiscard]] std::array<double, 3> velocity() const noexcept;
  [[nodiscard]] const std::array<double, 3>& base_wrench() const noexcept { return phantom_.base_wrench(); }
  [[nodiscard]] const std::array<double, 4>& motor_torque_nm() const noexcept { return motor_torque_nm_; }
  [[nodiscard]] const Phantom& phantom() const noexcept { return phantom_; }
  [[nodiscard]] const TwinBody& body() const noexcept { return body_; }

 private:
  void step(const std::array<double, 4>& command_nm) noexcept;
  void read_sensors() noexcept;

  rig::Actuation actuation_;
  double sensor_angle_rad_;
  PlantConfig config_;
  std::int64_t step_ns_;
  double step_s_;
  double current_loop_part_;  // of the way to the command in one step
  Phantom phantom_;
  TwinBody body_;
  Random random_;

  std::int64_t time_ns_{0};
  std::array<double, 4> motor_torque_nm_{};
  std::array<double, 3> hand_wrench_{};
  std::array<double, 4> joint_angle_rad_{};
  std::array<double, 6> noise_{};  // of the last step, in standard deviations
  std::array<double, 6> sensor_wrench_{};
};

}  // namespace trocar::sim_plant
