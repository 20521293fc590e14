// The mode machine as a table. Whatever is not a row does not happen.
//
//   Off -> Ready -> Armed -> { Position, Haptic } -> Hold,  and Fault from every mode that has torque.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/core/contracts.hpp"

namespace trocar::safety {

enum class Trigger : std::uint8_t {
  LinkUp,         // every drive operational
  LinkDown,       // drives left operation while there was no torque
  TorqueEnabled,  // the drives confirmed an Arm command
  MoveAccepted,
  HapticAccepted,
  HoldAsked,       // hold command, or the armed host went silent
  TorqueOffAsked,  // disarm command, or a stop that has come to rest
  FaultRaised,
  FaultReset,
};

struct Transition {
  Mode from{};
  Trigger trigger{};
  Mode to{};
};

// The guards of triggers (homed, at rest, session, limits) are checked by the controller before it raises them.
inline constexpr std::array transitions{
    Transition{Mode::Off, Trigger::LinkUp, Mode::Ready},
    Transition{Mode::Ready, Trigger::LinkDown, Mode::Off},
    Transition{Mode::Ready, Trigger::TorqueEnabled, Mode::Armed},
    Transition{Mode::Ready, Trigger::FaultRaised, Mode::Fault},  // while enabling torque
    Transition{Mode::Armed, Trigger::MoveAccepted, Mode::Position},
    Transition{Mode::Armed, Trigger::HapticAccepted, Mode::Haptic},
    Transition{Mode::Armed, Trigger::HoldAsked, Mode::Hold},
    Transition{Mode::Armed, Trigger::TorqueOffAsked, Mode::Ready},
    Transition{Mode::Armed, Trigger::FaultRaised, Mode::Fault},
    Transition{Mode::Position, Trigger::HapticAccepted, Mode::Haptic},
    Transition{Mode::Position, Trigger::HoldAsked, Mode::Hold},
    Transition{Mode::Position, Trigger::TorqueOffAsked, Mode::Ready},
    Transition{Mode::Position, Trigger::FaultRaised, Mode::Fault},
    Transition{Mode::Haptic, Trigger::HapticAccepted, Mode::Haptic},  // another display
    Transition{Mode::Haptic, Trigger::HoldAsked, Mode::Hold},
    Transition{Mode::Haptic, Trigger::TorqueOffAsked, Mode::Ready},
    Transition{Mode::Haptic, Trigger::FaultRaised, Mode::Fault},
    Transition{Mode::Hold, Trigger::MoveAccepted, Mode::Position},
    Transition{Mode::Hold, Trigger::HapticAccepted, Mode::Haptic},
    Transition{Mode::Hold, Trigger::TorqueOffAsked, Mode::Ready},
    Transition{Mode::Hold, Trigger::FaultRaised, Mode::Fault},
    Transition{Mode::Fault, Trigger::FaultReset, Mode::Off},  // Ready follows with the next tick if the drives are operational
};

[[nodiscard]] constexpr std::optional<Mode> next(Mode from, Trigger trigger) noexcept {
  for (const Transition& t : transitions)
    if (t.from == from && t.trigger == trigger) return t.to;
  return std::nullopt;
}

// Modes in which the drives carry torque by the controller's will. In Fault that depends on the reaction.
[[nodiscard]] constexpr bool has_torque(Mode mode) noexcept {
  return mode == Mode::Armed || mode == Mode::Position || mode == Mode::Haptic || mode == Mode::Hold;
}

}  // namespace trocar::safety
