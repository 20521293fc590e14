// What each fault means, what the controller does about it, and what a person should do. One row a fault; code, tests and the
// safety page read this table.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "common/core/contracts.hpp"
#include "common/rig/rig.hpp"

namespace trocar::safety {

enum class Reaction : std::uint8_t {
  Hold,       // brake on the path and stay position controlled: the measurement can be trusted, the motion may not go on
  QuickStop,  // brake on the path, then torque off
  TorqueOff,  // at once: the measurement or the actuation cannot be trusted
};

struct FaultRow {
  Fault fault{};
  Reaction reaction{};
  const char* cause{};
  const char* remedy{};
};

inline constexpr std::array<FaultRow, fault_count> fault_table{{
    {Fault::None, Reaction::Hold, "no fault", "none"},
    {Fault::FeedbackLost, Reaction::TorqueOff, "encoder values missing for too many ticks",
     "check the drive bus and the drives' power, then reset"},
    {Fault::HeartbeatLost, Reaction::TorqueOff, "a drive's heartbeat stopped", "check that drive's power and cable, then reset"},
    {Fault::DriveFault, Reaction::TorqueOff, "a drive reported a fault or left operation by itself",
     "read the drive's error code, mend it, then reset"},
    {Fault::SensorLost, Reaction::Hold, "the force sensor is silent", "check the sensor bus, then reset"},
    {Fault::SensorSaturated, Reaction::Hold, "the force sensor is at the end of its range", "withdraw by hand, tare, then reset"},
    {Fault::LateTick, Reaction::QuickStop, "the controller woke up too late",
     "run trocar-rig on an isolated core of a real-time kernel, then reset"},
    {Fault::EncoderJump, Reaction::TorqueOff, "a position changed faster than the machine can move",
     "check encoder cables, home again, then reset"},
    {Fault::Inconsistent, Reaction::TorqueOff, "the fourth encoder disagrees with the other three",
     "home again; if it stays, check the coupling, then reset"},
    {Fault::TrackingError, Reaction::TorqueOff, "the handle does not follow the reference",
     "remove what blocks it, or lower the speed, then reset"},
    {Fault::ForceLimit, Reaction::Hold, "the force at the needle base is over its limit", "withdraw by a slow move after reset"},
    {Fault::VelocityLimit, Reaction::TorqueOff, "the handle moves faster than allowed", "check gains and limits, then reset"},
    {Fault::WorkspaceLimit, Reaction::QuickStop, "the handle left the workspace", "move it back by hand, then reset"},
    {Fault::Singular, Reaction::QuickStop, "the linkage is close to a singularity", "move it back by hand, then reset"},
    {Fault::NotFinite, Reaction::TorqueOff, "a computed value is not a number",
     "keep the flight recording for the maintainers, then reset"},
    {Fault::SolverNotConverged, Reaction::Hold, "the contact solver hit its bound", "keep the recording, lower the speed, then reset"},
    {Fault::NotPassive, Reaction::Hold, "the haptic display gave more energy than it had taken",
     "hold the handle firmly, choose a softer scene, then reset"},
    {Fault::BusOff, Reaction::TorqueOff, "the CAN controller left the drives' bus after too many errors",
     "check cable, terminators and bit rate, then start trocar-rig again"},
    {Fault::TorqueMismatch, Reaction::TorqueOff, "a drive's measured torque is not the commanded one",
     "check that drive's current limit and motor cable, then reset"},
}};

[[nodiscard]] constexpr const FaultRow& row(Fault fault) noexcept { return fault_table[static_cast<std::size_t>(fault)]; }

// Of the virtual needle in a row: then its wrench is too old to be felt.
inline constexpr std::uint32_t most_unsolved_ticks = 20;

// How long a cause may last before it is a fault, in ticks; 0 for what is one at once, and for limits of motion, which are reached when
// they are.
[[nodiscard]] constexpr std::uint32_t patience_ticks(Fault fault, const rig::Rig& rig) noexcept {
  switch (fault) {
    case Fault::FeedbackLost:
      return rig.timing.missed_feedback_ticks;
    case Fault::HeartbeatLost:
      return static_cast<std::uint32_t>(1e-3 * rig.timing.heartbeat_timeout_ms * rig.timing.tick_hz);
    case Fault::SensorLost:
      return rig.timing.missed_sensor_ticks;
    case Fault::TorqueMismatch:
      return rig.limits.torque_error_ticks;
    case Fault::SolverNotConverged:
      return most_unsolved_ticks;
    default:
      return 0;
  }
}

// From the latched fault to the safe state, at most: torque off acts with the next SYNC; braking takes the longest stop that the limits
// allow (at constant jerk up to the acceleration, then at that, then back).
[[nodiscard]] constexpr std::uint32_t settle_ticks(Reaction reaction, const rig::Rig& rig) noexcept {
  if (reaction == Reaction::TorqueOff) return 1;
  const rig::Limits& l = rig.limits;
  const auto stop_s = [](double speed, double acceleration, double jerk) { return speed / acceleration + 3.0 * acceleration / jerk; };
  const double longest_s = std::max(stop_s(l.speed_m_s, l.acceleration_m_s2, l.jerk_m_s3),
                                    stop_s(l.angular_speed_rad_s, l.angular_acceleration_rad_s2, l.angular_jerk_rad_s3));
  return static_cast<std::uint32_t>(longest_s * rig.timing.tick_hz) + 2;
}

}  // namespace trocar::safety
