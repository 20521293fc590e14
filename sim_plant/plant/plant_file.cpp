#include "sim_plant/plant/plant_file.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "common/config/document.hpp"

namespace trocar::sim_plant {
PlantConfig read_plant(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  PlantConfig plant;
  plant.step_hz = root.number("step_hz", {1e4, 1e6}, "steps a second, such as 10000");
  if (std::fmod(1e9, plant.step_hz) != 0.0) root.fail("step_hz", "a step must last whole nanoseconds; write 10000, 20000 or 40000");

  const config::Table drive = root.table("drive");
  plant.current_loop_hz = drive.number("current_loop_hz", {1.0, 1e5}, "bandwidth of the drives' torque control, such as 600");
  plant.gear_efficiency = drive.number("gear_efficiency", {0.01, 1.0}, "such as 0.83");

  const config::Table friction = root.table("friction");
  const auto coulomb = friction.numbers<4>("coulomb_nm", {0.0, 10.0}, "one for each joint, such as 0.015");
  const auto viscous = friction.numbers<4>("viscous_nm_s", {0.0, 10.0}, "one for each joint, such as 0.002");
  const double stiffness = friction.number("bristle_stiffness_nm_per_rad", {1e-3, 1e5}, "such as 60");
  const double damping = friction.number("bristle_damping_nm_s", {0.0, 10.0}, "such as 0.01");
  for (std::size_t i = 0; i < 4; ++i) plant.friction[i] = {coulomb[i], viscous[i], stiffness, damping};

  const config::Table mechanism = root.table("mechanism");
  plant.imperfection.mass_factor = mechanism.number("mass_factor", {0.5, 2.0}, "true masses over nominal ones, such as 1.04");
  const auto errors = mechanism.rows("link_error_m", 4, {-1e-3, 1e-3}, "proximal left, right, distal left, right, such as 1e-5");
  if (errors.size() != 2) mechanism.fail("link_error_m", std::to_string(errors.size()) + " rows; write one for each of the two linkages");
  for (std::size_t k = 0; k < 2; ++k)
    for (std::size_t i = 0; i < 4; ++i) plant.imperfection.link_error_m[k][i] = errors[k][i];
  plant.imperfection.coupling_error_m = mechanism.number("coupling_error_m", {-1e-3, 1e-3}, "true length minus nominal one, such as 1e-5");

  const config::Table stops = root.table("stops");
  plant.stop_margin_m = stops.number("margin_m", {0.0, 0.1}, "from the rig's workspace limits to the stops, such as 0.003");
  plant.stop_stiffness_n_per_m = stops.number("stiffness_n_per_m", {1.0, 1e6}, "such as 50000");
  plant.stop_damping_n_s_per_m = stops.number("damping_n_s_per_m", {0.0, 1e3}, "such as 150");
  plant.stop_singularity = stops.number("singularity", {0.01, 1.0}, "below the rig's limit, such as 0.2");

  const config::Table sensor = root.table("sensor");
  plant.force_noise_n = sensor.number("force_noise_n", {0.0, 10.0}, "standard deviation, such as 0.0125");
  plant.torque_noise_nm = sensor.number("torque_noise_nm", {0.0, 1.0}, "standard deviation, such as 6.25e-5");
  if (const auto camera = root.optional_table("camera")) plant.camera = optics::read_simulated_camera(*camera);
  document.refuse_unknown_keys();
  return plant;
}

}  // namespace trocar::sim_plant
