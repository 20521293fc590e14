// What the estimators get to see: a simulated handle that motors hold by a spring while a hand pushes over a range of 12 N, recorded at
// every tick as quantised joint angles and torques. The hold has its own velocity, so every estimator sees the same course.
#pragma once

#include <string>
#include <vector>

#include "common/rig/rig.hpp"
#include "sim_plant/mechanism/twin_body.hpp"
#include "sim_plant/plant/config.hpp"

namespace trocar::bench {

struct Sample {
  double time_s{};
  mechanism::Vec4 angle_rad = mechanism::Vec4::Zero();  // quantised
  mechanism::Vec4 torque_nm = mechanism::Vec4::Zero();  // commanded to the joints over the tick before
  mechanism::Vec3 hand = mechanism::Vec3::Zero();       // of the hand on the handle, at this instant
};

struct Step {
  double time_s{};
  Eigen::Index axis{};
  double from_n{}, to_n{};
};

struct Part {
  std::string name{};
  double begin_s{}, end_s{};
};

struct Machine {
  std::string name{};
  sim_plant::TwinBodyConfig body{};
  double current_loop_hz{};  // first order; 0: torque acts as commanded
};

struct Course {
  std::string machine{};
  double tick_s{};
  std::vector<Sample> samples{};
  std::vector<Step> steps{};
  std::vector<Part> parts{};  // steps, ramps, sine
  double fastest_m_s{};       // of the handle
  double most_torque_nm{};    // of a motor
};

// Throws std::runtime_error when the handle is caught at a singularity or stopped.
[[nodiscard]] Course record(const rig::Rig& rig, const Machine& machine, double tick_s);

// The same pushes in the lock-step bench: the controller's own position control holds the handle, and counts and torques go over the
// drives' bus, a tick late. Force, speed and tracking limits are wide, so that they do not end it. Throws std::runtime_error when something
// does.
[[nodiscard]] Course record_on_bus(rig::Rig rig, const sim_plant::PlantConfig& plant);

}  // namespace trocar::bench
