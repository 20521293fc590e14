#include "sim_plant/mechanism/twin_body.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace trocar::sim_plant {

using mechanism::Mat3;
using mechanism::Mat43;
using mechanism::Status;
using mechanism::TwinState;

mechanism::Status TwinBody::place(const Vec3& pose) noexcept {
  TwinState state;
  if (const Status status = mechanism::at_pose(config_.model, pose, joint_near_, state); status != Status::Ok) return status;
  if (mechanism::singularity_distance(config_.model, state) < config_.stop.singularity) return Status::Singular;
  pose_ = good_pose_ = pose;
  velocity_.setZero();
  acceleration_.setZero();
  joint_near_ = state.q;
  friction_ = {};
  return Status::Ok;
}

bool TwinBody::evaluate(const Vec3& pose, TwinState& state) const noexcept {
  return mechanism::at_pose(config_.model, pose, joint_near_, state) == Status::Ok &&
         mechanism::singularity_distance(config_.model, state) >= config_.stop.singularity;
}

TwinBody::Vec3 TwinBody::stop_wrench(const Vec3& pose, const Vec3& velocity) noexcept {
  const StopConfig& stop = config_.stop;
  Vec3 wrench = Vec3::Zero();
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const auto& free = axis == 0 ? stop.x_m : stop.y_m;
    const double above = pose(axis) - free[1];
    const double below = free[0] - pose(axis);
    // A stop pushes, it never pulls.
    if (above > 0.0) wrench(axis) = -std::max(0.0, stop.stiffness_n_per_m * above + stop.damping_n_s_per_m * velocity(axis));
    if (below > 0.0) wrench(axis) = std::max(0.0, stop.stiffness_n_per_m * below - stop.damping_n_s_per_m * velocity(axis));
  }
  if (wrench(0) != 0.0 || wrench(1) != 0.0) ++counters_.stopped;
  return wrench;
}

void TwinBody::step(const Vec4& joint_torque_nm, const Vec3& handle_wrench, double dt_s) noexcept {
  ++counters_.steps;
  const Vec3 middle_pose = middle(dt_s);
  const Vec3 guess = velocity_ + 0.5 * dt_s * acceleration_;
  TwinState state;
  Mat3 mass;
  Mat3 coriolis;
  Mat43 map;
  bool good = evaluate(middle_pose, state) && mechanism::velocity_map(config_.model, state, map) == Status::Ok &&
              mechanism::dynamics(config_.model, state, guess, mass, coriolis) == Status::Ok;
  Vec3 next = Vec3::Zero();
  Vec3 end = pose_;
  if (good) {
    const Vec4 joint_guess = map * guess;
    Vec4 offset;
    Vec4 slope;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const LinearFriction f = linearise(config_.friction[i], friction_[i], joint_guess(row), dt_s);
      offset(row) = f.offset_nm;
      slope(row) = f.slope_nm_s;
    }
    const Vec3 force = map.transpose() * (joint_torque_nm - offset) + handle_wrench + stop_wrench(middle_pose, guess);
    const Mat3 half = 0.5 * (coriolis + map.transpose() * slope.asDiagonal() * map);
    const Mat3 inertia = mass / dt_s;
    next = Mat3(inertia + half).inverse() * ((inertia - half) * velocity_ + force);
    end = middle_pose + 0.5 * dt_s * next;
    good = end.allFinite() && next.allFinite();
  }
  if (!good) {
    ++counters_.caught;
    pose_ = good_pose_;
    velocity_.setZero();
    acceleration_.setZero();
    return;
  }
  const Vec4 joint_velocity = map * (0.5 * (velocity_ + next));
  for (std::size_t i = 0; i < 4; ++i)
    friction_[i] = update(config_.friction[i], friction_[i], joint_velocity(static_cast<Eigen::Index>(i)), dt_s);
  joint_near_ = state.q;
  good_pose_ = middle_pose;
  acceleration_ = (next - velocity_) / dt_s;
  velocity_ = next;
  pose_ = end;
}

TwinBody::Vec4 TwinBody::joint_angle_rad() const noexcept {
  Vec4 q = joint_near_;
  (void)mechanism::inverse(config_.model, pose_, joint_near_, q);
  return q;
}

double TwinBody::kinetic_energy_j() const noexcept {
  TwinState state;
  Mat3 mass;
  Mat3 coriolis;
  if (!evaluate(pose_, state) || mechanism::dynamics(config_.model, state, velocity_, mass, coriolis) != Status::Ok) return 0.0;
  return 0.5 * velocity_.dot(mass * velocity_);
}

}  // namespace trocar::sim_plant
