// What crosses between the controller and the outside, as plain data: modes, faults, commands, replies, events, samples.
// The DDS types in common/wire carry the same fields under the same names.
// Frames: the rig frame has its origin midway between the two motor axes, +x from the left motor to the right one, +y towards the
// tissue. theta is the direction from needle base to tip, counter-clockwise from +x, not wrapped (unlimited rotation).
// `base_*` is the wrench that the needle's base applies to the needle; moments are about +z at the base.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/capacities.hpp"

namespace trocar {

inline constexpr std::uint32_t protocol_version = 2;

enum class Mode : std::uint8_t {
  Off,       // drives not operational
  Ready,     // drives operational, torque disabled
  Armed,     // torque enabled, zero wrench
  Position,  // following a trajectory or holding its end
  Haptic,    // a person holds the handle
  Hold,      // came to rest by itself (host lost, hold command), position controlled
  Fault,     // first cause latched; the reaction of the fault table runs
};

enum class Fault : std::uint8_t {
  None,
  FeedbackLost,   // no fresh encoder values for too many ticks
  HeartbeatLost,  // a drive's heartbeat stopped
  DriveFault,     // a drive reported a fault or left operation by itself
  SensorLost,     // force sensor silent
  SensorSaturated,
  LateTick,      // the controller woke up too late
  EncoderJump,   // one tick's motion is physically impossible
  Inconsistent,  // the redundant measurement disagrees with the other three
  TrackingError,
  ForceLimit,
  VelocityLimit,
  WorkspaceLimit,  // outside of the box
  Singular,        // too close to a singularity
  NotFinite,       // a number is NaN or infinite
  SolverNotConverged,
  NotPassive,      // a haptic display gave more energy than it took
  BusOff,          // the CAN controller left the drives' bus
  TorqueMismatch,  // a drive's torque is not the commanded one
};
inline constexpr std::size_t fault_count = 19;

enum class CommandKind : std::uint8_t {
  KeepAlive,    // the commander is alive; resets the host timeout
  Home,         // the mechanism stands in its homing pose: take the encoders' offsets
  Tare,         // average the force sensor at rest and subtract it from now on
  Arm,          // take the session and enable torque
  Disarm,       // disable torque and release the session
  Move,         // straight jerk-limited motion to `target_pose`
  Hold,         // brake along the path and hold; anyone may send it
  Stop,         // quick stop, then torque off; anyone may send it
  SelectGains,  // `gain_set` becomes active
  ResetFault,
  Haptic,  // from rest, the handle becomes the virtual needle's, shown by `display`
};

// How the virtual needle is shown to the hand (firmware/haptic).
enum class Display : std::uint8_t { FourChannel, Impedance, Admittance };

enum class ReplyCode : std::uint8_t {
  Accepted,
  Done,          // a Move, Tare or Home that was accepted has ended as asked
  Stopped,       // a Move ended early: force threshold, hold, stop or fault; or a Stop came before the command was taken
  WrongMode,     // not possible in the present mode
  SessionTaken,  // another commander is armed
  NoSession,     // only the armed session may do this
  NotHomed,
  NotAtRest,
  OutOfRange,       // NaN, infinite, outside of workspace or limits
  UnreachablePose,  // no path: singular or out of reach somewhere on the line
  Expired,          // older than its deadline when it arrived
  WrongVersion,
  UnknownGains,
  StillFaulty,  // the cause of the fault persists
  NoModel,      // Haptic without a model image
};

// Zero-initialised is harmless: a KeepAlive of no session.
struct Command {
  std::uint64_t session{};  // chosen by the commander, non-zero
  std::uint32_t id{};       // increasing within a session; echoed in replies
  CommandKind kind{};
  std::uint8_t gain_set{};              // SelectGains: index into the rig's gain sets
  Display display{};                    // Haptic
  std::array<double, 3> target_pose{};  // Move: x_m, y_m, theta_rad (unwrapped: 2 pi more is one turn more)
  double speed_m_s{};                   // Move: path speed of translation, > 0
  double angular_speed_rad_s{};         // Move: speed of rotation, > 0
  double stop_force_n{};                // Move: ends with Stopped when |base force| exceeds it; 0 disables
};

struct Reply {
  std::uint64_t session{};
  std::uint32_t id{};
  CommandKind kind{};
  ReplyCode code{};
  Mode mode{};  // mode when the reply was made
  std::uint64_t tick{};
};

enum class EventKind : std::uint8_t {
  ModeChanged,
  FaultLatched,
  FaultCleared,
  SessionTaken,
  SessionReleased,
  Homed,
  Tared,
  HostLost,
  Limited,
  FlightRecorded,  // the fault's flight recording was sent; `value` samples of it are on disk, 0 when it could not be written
  CommandsLost,    // `value` commands since the last such event were dropped: more came than can be taken
};

struct Event {
  std::uint64_t tick{};
  std::int64_t time_ns{};
  EventKind kind{};
  Mode from{}, to{};
  Fault fault{};
  double value{};  // what was measured, in the unit of the limit it passed
  double limit{};
};

// One tick. All values belong to the positions latched by this tick's SYNC.
struct Sample {
  std::uint64_t tick{};
  std::int64_t time_ns{};  // controller time of the SYNC, from the controller's start
  Mode mode{};
  Fault fault{};          // first cause while mode is Fault
  std::uint8_t moving{};  // 1 while a trajectory runs
  std::uint8_t gain_set{};
  std::uint32_t command_id{};  // the Move that is running or was last accepted
  std::array<std::int32_t, capacity::drives> position_counts{};
  std::array<double, capacity::drives> joint_torque_command_nm{};  // at the joint, behind the gear
  std::array<double, capacity::drives> joint_torque_measured_nm{};
  std::array<double, 3> pose{};      // x_m, y_m, theta_rad of the needle base
  std::array<double, 3> velocity{};  // m/s, m/s, rad/s
  std::array<double, 3> setpoint_pose{};
  std::array<double, 3> setpoint_velocity{};
  std::array<double, 3> wrench_command{};  // N, N, N m asked of the mechanism by the controller
  std::array<double, 3> base_wrench{};     // N, N, N m from the force sensor, tare removed, in the rig frame
  double residual_m{};                     // redundant measurement: coupling length measured minus nominal
  double singularity{};                    // distance to singularity, 0 (singular) … 1
  std::uint32_t missed_feedback{};         // ticks since the last complete feedback
  // In Haptic, else NaN and 0: the virtual needle, and the hand as the observer sees it.
  std::array<double, 3> handle_wrench{};   // N, N, N m of the hand on the handle
  std::array<double, 3> virtual_pose{};    // of the virtual needle's base
  std::array<double, 3> virtual_wrench{};  // what its base applies to the needle
  double display_energy_j{};  // that the display has taken from the hand, less what it gave; the guard keeps it above its bound
  std::uint32_t virtual_contacts{};
  std::uint8_t virtual_status{};  // insertion::Status of the virtual needle
  float wakeup_late_us{};         // 0 in lock-step
  float tick_us{};                // execution time of the tick, 0 in lock-step
};

// What the machine did to the thread that ticks, since its loop began; sampled between ticks, and not every one of them.
struct LoopCounters {
  std::uint64_t overruns{};      // ticks that ended after the next one was due
  std::uint64_t minor_faults{};  // page faults served from memory
  std::uint64_t major_faults{};  // page faults served from a disk
  std::uint64_t preemptions{};   // taken off its core while it had work to do
  std::uint64_t allocations{};   // calls of malloc and its kin
  // While the drives had torque: these two must stay at zero.
  std::uint64_t armed_page_faults{};
  std::uint64_t armed_allocations{};
};

[[nodiscard]] constexpr const char* to_string(Mode m) noexcept {
  constexpr std::array<const char*, 7> names{"Off", "Ready", "Armed", "Position", "Haptic", "Hold", "Fault"};
  return static_cast<std::size_t>(m) < names.size() ? names[static_cast<std::size_t>(m)] : "?";
}
[[nodiscard]] constexpr const char* to_string(Fault f) noexcept {
  constexpr std::array<const char*, fault_count> names{
      "None",        "FeedbackLost",       "HeartbeatLost", "DriveFault", "SensorLost",    "SensorSaturated", "LateTick",
      "EncoderJump", "Inconsistent",       "TrackingError", "ForceLimit", "VelocityLimit", "WorkspaceLimit",  "Singular",
      "NotFinite",   "SolverNotConverged", "NotPassive",    "BusOff",     "TorqueMismatch"};
  return static_cast<std::size_t>(f) < names.size() ? names[static_cast<std::size_t>(f)] : "?";
}
[[nodiscard]] constexpr const char* to_string(CommandKind k) noexcept {
  constexpr std::array<const char*, 11> names{"KeepAlive", "Home", "Tare",        "Arm",        "Disarm", "Move",
                                              "Hold",      "Stop", "SelectGains", "ResetFault", "Haptic"};
  return static_cast<std::size_t>(k) < names.size() ? names[static_cast<std::size_t>(k)] : "?";
}
[[nodiscard]] constexpr const char* to_string(ReplyCode c) noexcept {
  constexpr std::array<const char*, 15> names{"Accepted",  "Done",         "Stopped",      "WrongMode",   "SessionTaken",
                                              "NoSession", "NotHomed",     "NotAtRest",    "OutOfRange",  "UnreachablePose",
                                              "Expired",   "WrongVersion", "UnknownGains", "StillFaulty", "NoModel"};
  return static_cast<std::size_t>(c) < names.size() ? names[static_cast<std::size_t>(c)] : "?";
}
[[nodiscard]] constexpr const char* to_string(EventKind k) noexcept {
  constexpr std::array<const char*, 11> names{"ModeChanged", "FaultLatched", "FaultCleared", "SessionTaken",   "SessionReleased", "Homed",
                                              "Tared",       "HostLost",     "Limited",      "FlightRecorded", "CommandsLost"};
  return static_cast<std::size_t>(k) < names.size() ? names[static_cast<std::size_t>(k)] : "?";
}

}  // namespace trocar
