// rig.toml -> rig::Rig. Every key is required unless it says "or" below; lengths in m, angles in rad, and so on (the name says it).
//
//   name, kind = "twin" | "single", dds_domain (or 0)
//   [linkage] base_m, end_point_mass_kg;  [linkage.proximal], [linkage.distal]: length_m, mass_kg, com_m, inertia_kg_m2, each [left, right]
//   [coupling] (twin only) length_m, handle_m, handle_mass_kg, handle_com_m, handle_inertia_kg_m2
//   [actuation], [limits], [timing], [force_sensor]: the members of the structs of the same name in common/rig/rig.hpp
//   [homing] pose = [x_m, y_m, theta_rad]
//   [[gains]] name, feed_forward, translation, rotation = { proportional, integral, derivative }; the first is the default
//   [haptic] (or no Haptic mode; twin only) fade_s;  .observer kind = "nicosia" | "momentum", bandwidth_rad_s, count_force_n;
//   .desired mass, damping, stiffness;  .needle mass, damping;  .four_channel adaptive_per_force_s_m, adaptive_per_moment_s_rad,
//   adaptive_least, master, slave;  .admittance tracking;  .guard credit_j, softest_n_m, bound_j, damping_n_s_m; master, slave and
//   tracking = { damping, stiffness }; masses, dampings, stiffnesses and adaptive_least are [x and y, rotation]
//   [buses] bitrate_bps, drive_node, master_node, sensor_base_id;  [buses.drives], [buses.sensor]: interface, or rig_port and plant_port
//   (and host)
//
// Refused with file, line, key and remedy: everything that document.hpp refuses, and what contradicts itself or cannot be built
// (linkages that do not close, a homing pose out of reach, limits in the wrong order, addresses given twice, …).
#pragma once

#include <filesystem>
#include <string_view>

#include "common/rig/rig.hpp"

namespace trocar::config {

[[nodiscard]] rig::Rig read_rig(const std::filesystem::path& file);
// The same, and refuses a single linkage: controller, plant and experiments move a handle in x, y and rotation.
[[nodiscard]] rig::Rig read_twin(const std::filesystem::path& file);
// For a bus that the system would not open: names the line of its interface or, if it has none, of `port_key`.
[[noreturn]] void refuse_bus(const std::filesystem::path& file, std::string_view bus, std::string_view port_key, std::string_view problem);
// For a rig that cannot be the haptic device that it is asked to be: names the line of its observer's bandwidth, or that there is no table.
[[noreturn]] void refuse_haptic(const std::filesystem::path& file, std::string_view problem);

}  // namespace trocar::config
