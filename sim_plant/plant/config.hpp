// What a plant file says: how the simulated machine differs from the rig that the controller was told about. SI units.
#pragma once

#include <array>
#include <optional>

#include "common/optics/simulated_camera.hpp"
#include "sim_plant/mechanism/imperfection.hpp"
#include "sim_plant/mechanism/joint_friction.hpp"

namespace trocar::sim_plant {

struct PlantConfig {
  double step_hz{10000.0};   // divides 1e9; at least 10 kHz
  double current_loop_hz{};  // bandwidth of the drives' torque control, first order
  double gear_efficiency{};  // (0, 1]
  std::array<JointFrictionConfig, 4> friction{};
  Imperfection imperfection{};
  double stop_margin_m{};  // from the rig's workspace limits to the mechanical stops
  double stop_stiffness_n_per_m{};
  double stop_damping_n_s_per_m{};
  double stop_singularity{};  // the handle is caught there; below the rig's own limit
  double force_noise_n{};     // standard deviation of each component of a sensor reading
  double torque_noise_nm{};
  std::optional<optics::SimulatedCamera> camera{};  // over the phantom
};

}  // namespace trocar::sim_plant
