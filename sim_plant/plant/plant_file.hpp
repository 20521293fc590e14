// plant.toml -> PlantConfig.
//
//   step_hz
//   [drive] current_loop_hz, gear_efficiency
//   [friction] coulomb_nm, viscous_nm_s (one for each of four joints), bristle_stiffness_nm_per_rad, bristle_damping_nm_s
//   [mechanism] mass_factor, link_error_m (two rows: proximal left, right, distal left, right), coupling_error_m
//   [stops] margin_m, stiffness_n_per_m, damping_n_s_per_m, singularity
//   [sensor] force_noise_n, torque_noise_nm
#pragma once

#include <filesystem>

#include "sim_plant/plant/config.hpp"

namespace trocar::sim_plant {

// Throws config::UserError with file, line, key and remedy.
[[nodiscard]] PlantConfig read_plant(const std::filesystem::path& file);

}  // namespace trocar::sim_plant
