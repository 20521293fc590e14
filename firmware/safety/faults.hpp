// What each fault means, what the controller does about it, and what a person should do. One row a fault; code, tests and the
// safety page read this table.
#pragma once

#include <array>

#include "common/core/contracts.hpp"

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
}};

[[nodiscard]] constexpr const FaultRow& row(Fault fault) noexcept { return fault_table[static_cast<std::size_t>(fault)]; }

}  // namespace trocar::safety
