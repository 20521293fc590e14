// hand.toml -> who holds the handle of a simulated rig, and what he wants.
//
//   take_after_s                  after the motors came on; before that nobody holds the handle
//   tremor_hz
//   [translation] mass_kg, damping_n_s_per_m, stiffness_n_per_m, grip_damping_n_s_per_m, grip_stiffness_n_per_m, largest_n, tremor_n
//   [rotation] inertia_kg_m2, damping_nm_s_per_rad, stiffness_nm_per_rad, grip_damping_nm_s_per_rad, grip_stiffness_nm_per_rad,
//     largest_nm, tremor_nm
//   [intention] forward_m         along the needle, from where the handle was taken
//     push_speed_m_s, draw_speed_m_s (means of minimum-jerk ways), rest_out_s, rest_in_s: rest, push, rest, draw, and anew
// or, instead of all but the first,
//   replay = "run/truth.csv"      or samples.csv: force of a hand on a handle, relative to this file; begins, after take_after_s, with the
//                                 first row in which that hand pushes
//   ([arm] damping_n_s_per_m, stiffness_n_per_m, damping_nm_s_per_rad, stiffness_nm_per_rad: about the recorded motion; without it the
//     recorded force acts alone, and the handle soon goes its own way)
#pragma once

#include <filesystem>

#include "sim_plant/hand/hand.hpp"

namespace trocar::sim_plant {

// `seed` is the simulation's; the tremor has noise of its own from it. Throws config::UserError with file, line, key and remedy.
[[nodiscard]] Hand read_hand(const std::filesystem::path& file, std::uint64_t seed);

// Columns time_ns, x_m, y_m, theta_rad, and hand_* (truth.csv) or handle_* (samples.csv); fx_n, fy_n, tau_nm each. A NaN force is none.
// Time 0 is the first row with a force; from there on poses have to be finite. Throws config::UserError.
[[nodiscard]] std::vector<RecordedWrench> read_recording(const std::filesystem::path& file);

}  // namespace trocar::sim_plant
