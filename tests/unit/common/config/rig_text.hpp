// A rig file that is right in every line, for tests that spoil one.
#pragma once

#include <string_view>

namespace trocar::config::testing {

inline constexpr std::string_view twin_rig = R"(name = "twin"
kind = "twin"
dds_domain = 3
[linkage]
base_m = 0.08
end_point_mass_kg = 0.02
[linkage.proximal]
length_m = [0.105, 0.106]
mass_kg = [0.03, 0.031]
com_m = [0.05, -0.02]
inertia_kg_m2 = [5e-5, 6e-5]
[linkage.distal]
length_m = [0.155, 0.156]
mass_kg = [0.02, 0.021]
com_m = [0.07, 0.071]
inertia_kg_m2 = [8e-5, 9e-5]
[coupling]
length_m = 0.05
handle_m = 0.025
handle_mass_kg = 0.15
handle_com_m = 0.026
handle_inertia_kg_m2 = 1e-4
[actuation]
torque_constant_nm_per_a = 0.0525
continuous_current_a = 2.0
peak_current_a = 10.0
rotor_inertia_kg_m2 = 6.5e-6
gear_ratio = [8.0, 9.0, 10.0, 11.0]
gear_efficiency = 0.85
encoder_counts_per_turn = 16000
friction_coulomb_nm = 0.015
friction_viscous_nm_s = 0.002
[homing]
pose = [0.0, 0.11, 1.5707963267948966]
[[gains]]
name = "default"
feed_forward = true
translation = { proportional = 800.0, integral = 2000.0, derivative = 10.0 }
rotation = { proportional = 2.0, integral = 10.0, derivative = 0.03 }
[[gains]]
name = "thesis"
feed_forward = false
translation = { proportional = 801.0, integral = 0.0078, derivative = 11.0 }
rotation = { proportional = 1.0, integral = 3.9e-6, derivative = 0.005 }
[limits]
torque_slew_nm_per_s = 100.0
speed_m_s = 0.1
angular_speed_rad_s = 2.0
acceleration_m_s2 = 1.0
angular_acceleration_rad_s2 = 20.0
jerk_m_s3 = 21.0
angular_jerk_rad_s3 = 400.0
command_force_n = 12.0
command_moment_nm = 0.3
workspace_x_m = [-0.052, 0.053]
workspace_y_m = [0.098, 0.202]
singularity = 0.25
residual_m = 0.001
torque_error_nm = 0.2
torque_error_ticks = 20
tracking_m = 0.006
tracking_rad = 0.15
fault_speed_m_s = 0.26
fault_angular_speed_rad_s = 6.0
fault_force_n = 9.0
fault_moment_nm = 0.11
[timing]
tick_hz = 1000.0
feedback_deadline_us = 700
missed_feedback_ticks = 20
missed_sensor_ticks = 50
host_timeout_ms = 80
late_tick_us = 2000
late_tick_best_effort_us = 50000
heartbeat_ms = 25
heartbeat_timeout_ms = 60
[force_sensor]
counts_per_n = 640.0
counts_per_nm = 128000.0
angle_rad = 0.5
[buses]
bitrate_bps = 1000000
drive_node = [1, 2, 3, 4]
master_node = 127
sensor_base_id = 0x430
[buses.drives]
host = "127.0.0.1"
rig_port = 20001
plant_port = 20000
[buses.sensor]
interface = "can1"
)";

}  // namespace trocar::config::testing
