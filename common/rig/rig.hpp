// Everything that a rig file says, as plain data without allocation. Read by common/config, used by firmware, plant and host.
// SI units; angles in radians; "joint" means the active joint behind the gear.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/core/capacities.hpp"
#include "common/mechanism/model.hpp"

namespace trocar::rig {

using Name = std::array<char, capacity::name>;

enum class Kind : std::uint8_t { Twin, Single };

struct Actuation {
  double torque_constant_nm_per_a{};
  double continuous_current_a{};
  double peak_current_a{};
  double rotor_inertia_kg_m2{};
  std::array<double, capacity::drives> gear_ratio{};  // motor turns per joint turn
  double gear_efficiency{};                           // (0, 1]
  std::int32_t encoder_counts_per_turn{};             // per turn of the joint
  double friction_coulomb_nm{};                       // at the joint, what the controller assumes and feeds forward
  double friction_viscous_nm_s{};                     // N m s/rad at the joint

  // Torque that one drive can put on its joint.
  [[nodiscard]] constexpr double joint_torque_nm(double current_a, std::size_t drive) const noexcept {
    return torque_constant_nm_per_a * current_a * gear_ratio[drive] * gear_efficiency;
  }
};

struct AxisGains {
  double proportional{};  // N/m or N m/rad
  double integral{};      // N/(m s) or N m/(rad s)
  double derivative{};    // N s/m or N m s/rad
};

struct GainSet {
  Name name{};
  AxisGains translation{};
  AxisGains rotation{};
  bool feed_forward{};  // inertia and friction of the reference motion
};

// One place for every limit; the controller clamps commands to the first group and latches a fault beyond the second.
struct Limits {
  // clamps
  double torque_slew_nm_per_s{};  // per joint
  double speed_m_s{};
  double angular_speed_rad_s{};
  double acceleration_m_s2{};
  double angular_acceleration_rad_s2{};
  double jerk_m_s3{};
  double angular_jerk_rad_s3{};
  double command_force_n{};  // wrench asked of the mechanism
  double command_moment_nm{};
  // faults
  std::array<double, 2> workspace_x_m{};  // of the needle base
  std::array<double, 2> workspace_y_m{};
  double singularity{};                // least distance to singularity, 0 … 1
  double residual_m{};                 // redundant measurement
  double torque_error_nm{};            // at the joint, what a drive measures against what it was told
  std::uint32_t torque_error_ticks{};  // in a row; fault beyond
  double tracking_m{};
  double tracking_rad{};
  double fault_speed_m_s{};
  double fault_angular_speed_rad_s{};
  double fault_force_n{};  // measured at the base
  double fault_moment_nm{};
};

struct Timing {
  double tick_hz{};
  std::uint32_t feedback_deadline_us{};      // from SYNC to the last feedback frame
  std::uint32_t missed_feedback_ticks{};     // fault beyond
  std::uint32_t missed_sensor_ticks{};       // fault beyond
  std::uint32_t host_timeout_ms{};           // armed host silent for longer: hold
  std::uint32_t late_tick_us{};              // wake-up later than this: fault (real-time set-up complete)
  std::uint32_t late_tick_best_effort_us{};  // the same on a machine that gave no real-time privileges
  std::uint32_t heartbeat_ms{};              // produced by master and drives
  std::uint32_t heartbeat_timeout_ms{};      // consumed by master and drives
};

struct ForceSensor {
  double counts_per_n{};
  double counts_per_nm{};
  double angle_rad{};  // sensor x axis from the needle axis, counter-clockwise
};

// A value for x and y, and one for the rotation.
struct Planar {
  double translation{};
  double rotation{};
};

// Local controller of a four-channel coupling, on velocity: damping + stiffness / s.
struct Coupling {
  Planar damping{};    // N s/m, N m s/rad
  Planar stiffness{};  // N/m, N m/rad
};

enum class ForceObserver : std::uint8_t { Nicosia, Momentum };

// The rig as a haptic device. What each number does is said where it is used: firmware/control.
struct Haptic {
  bool present{};  // false: this rig has no Haptic mode
  double fade_s{};
  // force observer
  ForceObserver observer{};
  double observer_bandwidth_rad_s{};
  double observer_count_force_n{};  // RMS that encoder counts alone may feign
  // impedance law
  Planar desired_mass{};       // kg, kg m^2
  Planar desired_damping{};    // N s/m, N m s/rad
  Planar desired_stiffness{};  // N/m, N m/rad, about the homing pose
  // displays
  Planar needle_mass{};     // of the virtual needle's base: kg, kg m^2
  Planar needle_damping{};  // N s/m, N m s/rad
  Coupling master{}, slave{};
  double adaptive_per_force_s_m{};
  double adaptive_per_moment_s_rad{};
  Planar adaptive_least{};  // N s/m, N m s/rad
  Coupling tracking{};      // of the admittance display
  // passivity guard
  double guard_credit_j{};
  double guard_softest_n_m{};
  double guard_bound_j{};
  double guard_damping_n_s_m{};
};

// Where one bus is found: a SocketCAN interface name, or a pair of UDP ports on a host (cannelloni datagrams).
struct BusEndpoint {
  Name interface {};  // empty: UDP
  std::array<char, 64> host{};
  std::uint16_t rig_port{};
  std::uint16_t plant_port{};
};

struct Buses {
  BusEndpoint drives{};
  BusEndpoint sensor{};
  std::uint32_t bitrate_bps{};
  std::array<std::uint8_t, capacity::drives> drive_node{};  // CANopen node ids
  std::uint8_t master_node{};
  std::uint32_t sensor_base_id{};
};

struct Rig {
  Name name{};
  Kind kind{};
  mechanism::TwinModel twin{};  // Single: linkage[0] alone
  Actuation actuation{};
  std::array<double, 3> homing_pose{};                  // x_m, y_m, theta_rad in which the homing jig holds the handle
  std::array<GainSet, capacity::gain_sets> gain_set{};  // [0] is the default
  std::size_t gain_sets{};
  Limits limits{};
  Timing timing{};
  ForceSensor sensor{};
  Haptic haptic{};
  Buses buses{};
  std::uint32_t dds_domain{};

  [[nodiscard]] constexpr std::size_t drives() const noexcept { return kind == Kind::Twin ? 4 : 2; }
};

}  // namespace trocar::rig
