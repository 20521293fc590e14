#include "sim_plant/plant/plant.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

namespace trocar::sim_plant {
namespace {

void require(bool holds, const std::string& message) {
  if (!holds) throw std::invalid_argument(message);
}

// In initialisers: what is handed on outlives the call.
// NOLINTBEGIN(bugprone-return-const-ref-from-parameter)
const rig::Rig& checked(const rig::Rig& rig) {
  require(rig.kind == rig::Kind::Twin,
          "rig " + std::string(rig.name.data()) +
              ": the simulated plant has a twin pantograph; a single five-bar cannot be simulated yet, choose a twin rig");
  return rig;
}

const PlantConfig& checked(const PlantConfig& c) {
  constexpr double nanoseconds = 1e9;
  require(c.step_hz >= 1e4 && c.step_hz <= 1e6 && std::fmod(nanoseconds, c.step_hz) == 0.0,
          "plant: step_hz = " + std::to_string(c.step_hz) + ": must be 10000 to 1000000 and divide 1e9, such as 10000");
  require(c.current_loop_hz > 0.0 && std::isfinite(c.current_loop_hz), "plant: current_loop_hz must be positive, such as 600");
  require(c.gear_efficiency > 0.0 && c.gear_efficiency <= 1.0, "plant: gear_efficiency must be above 0 and at most 1");
  require(c.stop_margin_m >= 0.0 && c.stop_stiffness_n_per_m > 0.0 && c.stop_damping_n_s_per_m >= 0.0 && c.stop_singularity > 0.0,
          "plant: the stops need a margin and a damping of at least 0, a positive stiffness and a positive singularity");
  require(c.force_noise_n >= 0.0 && c.torque_noise_nm >= 0.0, "plant: noise must not be negative");
  require(c.imperfection.mass_factor > 0.0, "plant: mass_factor must be positive, such as 1.05");
  for (const JointFrictionConfig& f : c.friction)
    require(f.coulomb_nm >= 0.0 && f.viscous_nm_s >= 0.0 && f.bristle_damping_nm_s >= 0.0 &&
                (f.coulomb_nm == 0.0 || f.stiffness_nm_per_rad > 0.0),
            "plant: friction must not be negative, and Coulomb friction needs a bristle stiffness");
  return c;
}
// NOLINTEND(bugprone-return-const-ref-from-parameter)

TwinBodyConfig body_of(const rig::Rig& rig, const PlantConfig& plant) {
  TwinBodyConfig body;
  body.model = imperfect(rig.twin, plant.imperfection);
  body.friction = plant.friction;
  const double m = plant.stop_margin_m;
  const rig::Limits& limits = rig.limits;
  body.stop = {{limits.workspace_x_m[0] - m, limits.workspace_x_m[1] + m},
               {limits.workspace_y_m[0] - m, limits.workspace_y_m[1] + m},
               plant.stop_stiffness_n_per_m,
               plant.stop_damping_n_s_per_m,
               plant.stop_singularity};
  return body;
}

}  // namespace

Plant::Plant(const rig::Rig& rig, const PlantConfig& plant, const std::optional<scene::Scene>& scene, std::uint64_t seed)
    : actuation_(checked(rig).actuation),
      sensor_angle_rad_(rig.sensor.angle_rad),
      config_(checked(plant)),
      step_ns_(static_cast<std::int64_t>(1e9 / plant.step_hz)),
      step_s_(1.0 / plant.step_hz),
      current_loop_part_(-std::expm1(-2.0 * std::numbers::pi * plant.current_loop_hz / plant.step_hz)),
      phantom_(scene),
      body_(body_of(rig, plant)),
      random_(seed) {
  require(body_.place({rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}) == mechanism::Status::Ok,
          "rig " + std::string(rig.name.data()) +
              ": the plant's mechanism cannot take the homing pose; move it towards the middle of the "
              "workspace, or make the plant's errors of length smaller");
  phantom_.advance(rig.homing_pose, step_s_);
  read_sensors();
}

void Plant::set_hand_wrench(const std::array<double, 3>& wrench) noexcept {
  const bool finite = std::all_of(wrench.begin(), wrench.end(), [](double value) { return std::isfinite(value); });
  hand_wrench_ = finite ? wrench : std::array<double, 3>{};
}

void Plant::step(const std::array<double, 4>& command_nm) noexcept {
  const double most = actuation_.torque_constant_nm_per_a * actuation_.peak_current_a;
  TwinBody::Vec4 joint_torque;
  for (std::size_t i = 0; i < 4; ++i) {
    const double wanted = std::isfinite(command_nm[i]) ? std::clamp(command_nm[i], -most, most) : 0.0;
    const double before = motor_torque_nm_[i];
    motor_torque_nm_[i] += current_loop_part_ * (wanted - before);
    joint_torque(static_cast<Eigen::Index>(i)) = 0.5 * (before + motor_torque_nm_[i]) * actuation_.gear_ratio[i] * config_.gear_efficiency;
  }
  const TwinBody::Vec3 middle = body_.middle(step_s_);
  const Phantom::Vector3 base = phantom_.advance({middle(0), middle(1), middle(2)}, step_s_);
  // The needle pushes back on the handle with what its base applies to it.
  body_.step(joint_torque, {hand_wrench_[0] - base[0], hand_wrench_[1] - base[1], hand_wrench_[2] - base[2]}, step_s_);
}

void Plant::read_sensors() noexcept {
  const TwinBody::Vec4 q = body_.joint_angle_rad();
  for (std::size_t i = 0; i < 4; ++i) joint_angle_rad_[i] = q(static_cast<Eigen::Index>(i));
  const Phantom::Vector3& base = phantom_.base_wrench();
  const double angle = body_.pose()(2) + sensor_angle_rad_;
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  sensor_wrench_ = {c * base[0] + s * base[1], -s * base[0] + c * base[1], 0.0, 0.0, 0.0, base[2]};
  for (std::size_t k = 0; k < 6; ++k) sensor_wrench_[k] += (k < 3 ? config_.force_noise_n : config_.torque_noise_nm) * noise_[k];
}

void Plant::advance_to(std::int64_t time_ns, const std::array<double, 4>& motor_torque_nm) noexcept {
  if (time_ns_ + step_ns_ > time_ns) return;
  for (; time_ns_ + step_ns_ <= time_ns; time_ns_ += step_ns_) {
    step(motor_torque_nm);
    for (double& value : noise_) value = random_.normal();
  }
  read_sensors();
}

std::array<double, 4> Plant::joint_torque_nm() const noexcept {
  std::array<double, 4> torque{};
  for (std::size_t i = 0; i < 4; ++i) torque[i] = motor_torque_nm_[i] * actuation_.gear_ratio[i] * actuation_.gear_efficiency;
  return torque;
}

std::array<double, 3> Plant::pose() const noexcept { return {body_.pose()(0), body_.pose()(1), body_.pose()(2)}; }
std::array<double, 3> Plant::velocity() const noexcept { return {body_.velocity()(0), body_.velocity()(1), body_.velocity()(2)}; }

}  // namespace trocar::sim_plant
