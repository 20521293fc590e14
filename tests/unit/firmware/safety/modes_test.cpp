#include "firmware/safety/modes.hpp"

#include <gtest/gtest.h>

#include <map>
#include <utility>

namespace trocar::safety {
namespace {

constexpr std::array modes{Mode::Off, Mode::Ready, Mode::Armed, Mode::Position, Mode::Haptic, Mode::Hold, Mode::Fault};
constexpr std::array triggers{Trigger::LinkUp,         Trigger::LinkDown,       Trigger::TorqueEnabled,
                              Trigger::MoveAccepted,   Trigger::HapticAccepted, Trigger::HoldAsked,
                              Trigger::TorqueOffAsked, Trigger::FaultRaised,    Trigger::FaultReset};

TEST(Modes, EveryRowHappensAndNothingElseDoes) {
  // Written a second time by hand, from the mode diagram: per trigger, where each mode goes.
  const std::map<std::pair<Mode, Trigger>, Mode> expected{
      {{Mode::Off, Trigger::LinkUp}, Mode::Ready},
      {{Mode::Ready, Trigger::LinkDown}, Mode::Off},
      {{Mode::Ready, Trigger::TorqueEnabled}, Mode::Armed},
      {{Mode::Armed, Trigger::MoveAccepted}, Mode::Position},
      {{Mode::Hold, Trigger::MoveAccepted}, Mode::Position},
      {{Mode::Armed, Trigger::HapticAccepted}, Mode::Haptic},
      {{Mode::Position, Trigger::HapticAccepted}, Mode::Haptic},
      {{Mode::Hold, Trigger::HapticAccepted}, Mode::Haptic},
      {{Mode::Haptic, Trigger::HapticAccepted}, Mode::Haptic},
      {{Mode::Armed, Trigger::HoldAsked}, Mode::Hold},
      {{Mode::Position, Trigger::HoldAsked}, Mode::Hold},
      {{Mode::Haptic, Trigger::HoldAsked}, Mode::Hold},
      {{Mode::Armed, Trigger::TorqueOffAsked}, Mode::Ready},
      {{Mode::Position, Trigger::TorqueOffAsked}, Mode::Ready},
      {{Mode::Haptic, Trigger::TorqueOffAsked}, Mode::Ready},
      {{Mode::Hold, Trigger::TorqueOffAsked}, Mode::Ready},
      {{Mode::Ready, Trigger::FaultRaised}, Mode::Fault},
      {{Mode::Armed, Trigger::FaultRaised}, Mode::Fault},
      {{Mode::Position, Trigger::FaultRaised}, Mode::Fault},
      {{Mode::Haptic, Trigger::FaultRaised}, Mode::Fault},
      {{Mode::Hold, Trigger::FaultRaised}, Mode::Fault},
      {{Mode::Fault, Trigger::FaultReset}, Mode::Off},
  };
  for (const Mode mode : modes)
    for (const Trigger trigger : triggers) {
      const auto row = expected.find({mode, trigger});
      const auto to = next(mode, trigger);
      EXPECT_EQ(to.has_value(), row != expected.end()) << to_string(mode) << ' ' << static_cast<int>(trigger);
      if (to && row != expected.end()) {
        EXPECT_EQ(*to, row->second) << to_string(mode) << ' ' << static_cast<int>(trigger);
      }
    }
  EXPECT_EQ(transitions.size(), expected.size());  // no row twice
}

TEST(Modes, EveryModeWithTorqueCanFaultAndLoseItsTorque) {
  for (const Mode mode : modes)
    if (has_torque(mode)) {
      EXPECT_EQ(next(mode, Trigger::FaultRaised), Mode::Fault) << to_string(mode);
      EXPECT_EQ(next(mode, Trigger::TorqueOffAsked), Mode::Ready) << to_string(mode);
    }
}

TEST(Modes, TorqueComesOnlyByAnArmThatTheDrivesConfirmed) {
  for (const Mode mode : modes)
    for (const Trigger trigger : triggers)
      if (!has_torque(mode) && next(mode, trigger).has_value() && has_torque(*next(mode, trigger))) {
        EXPECT_EQ(mode, Mode::Ready);
        EXPECT_EQ(trigger, Trigger::TorqueEnabled);
      }
}

}  // namespace
}  // namespace trocar::safety
