// Equations of motion of the true twin pantograph, integrated with a fixed step.
//   M(x) x'' + C(x, x') x' = H^T (tau - tau_friction) + w + w_stop         x = (x_m, y_m, theta_rad) of the handle, q' = H x'
// Scheme (symmetric, second order, one evaluation of the mechanism a step): with step h,
//   x_m = x + h/2 v;   M, H at x_m; C at x_m and v + h/2 a, a from the last step
//   (M/h + K/2) v+ = (M/h - K/2) v + F,   K = C + H^T D H   (D the slope of the joint friction: implicit midpoint in v)
//   x+ = x_m + h/2 v+
// so v C v drops out of the energy balance and friction never feeds energy back, however stiff it is.
// Stops: a stiff spring with a damper around a box of handle positions. Where the mechanism cannot follow (out of reach, near a
// singularity, NaN) the handle is caught: it returns to the last good pose (less than a
// step's motion) and loses its velocity. Never NaN.
#pragma once

#include <array>
#include <cstdint>

#include "common/mechanism/twin.hpp"
#include "sim_plant/mechanism/joint_friction.hpp"

namespace trocar::sim_plant {

struct StopConfig {
  std::array<double, 2> x_m{};  // the handle is free in between
  std::array<double, 2> y_m{};
  double stiffness_n_per_m{};
  double damping_n_s_per_m{};
  double singularity{};  // least distance to singularity (0 … 1), below it the handle is caught
};

struct TwinBodyConfig {
  mechanism::TwinModel model{};
  std::array<JointFrictionConfig, 4> friction{};
  StopConfig stop{};
};

class TwinBody {
 public:
  using Vec3 = mechanism::Vec3;
  using Vec4 = mechanism::Vec4;

  explicit TwinBody(const TwinBodyConfig& config) noexcept : config_(config) {}

  // At rest there. What is not Ok is not taken.
  [[nodiscard]] mechanism::Status place(const Vec3& pose) noexcept;
  void set_velocity(const Vec3& velocity) noexcept { velocity_ = velocity; }

  // One step in two halves, so that what acts on the handle can be evaluated at the pose in the middle of it.
  [[nodiscard]] Vec3 middle(double dt_s) const noexcept { return pose_ + 0.5 * dt_s * velocity_; }
  void step(const Vec4& joint_torque_nm, const Vec3& handle_wrench, double dt_s) noexcept;

  [[nodiscard]] const Vec3& pose() const noexcept { return pose_; }
  [[nodiscard]] const Vec3& velocity() const noexcept { return velocity_; }
  [[nodiscard]] Vec4 joint_angle_rad() const noexcept;  // of pose(), by inverse kinematics
  [[nodiscard]] double kinetic_energy_j() const noexcept;
  [[nodiscard]] const mechanism::TwinModel& model() const noexcept { return config_.model; }

  struct Counters {
    std::uint64_t steps{};
    std::uint64_t caught{};   // steps that ended in a catch
    std::uint64_t stopped{};  // steps with a stop's force
  };
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

 private:
  [[nodiscard]] bool evaluate(const Vec3& pose, mechanism::TwinState& state) const noexcept;
  [[nodiscard]] Vec3 stop_wrench(const Vec3& pose, const Vec3& velocity) noexcept;

  TwinBodyConfig config_;
  Vec3 pose_ = Vec3::Zero();
  Vec3 velocity_ = Vec3::Zero();
  Vec3 acceleration_ = Vec3::Zero();
  Vec3 good_pose_ = Vec3::Zero();   // the last one that was evaluated
  Vec4 joint_near_ = Vec4::Zero();  // keeps the joints' turns
  std::array<JointFrictionState, 4> friction_{};
  Counters counters_{};
};

}  // namespace trocar::sim_plant
