// What the bus link hands to the controller each tick, and what it takes from it. Plain data, no buses.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/core/capacities.hpp"

namespace trocar::hal {

enum class LinkState : std::uint8_t {
  Down,         // nobody answers
  BringUp,      // configuring drives
  Operational,  // every drive mapped, verified and heard
};

enum class DriveRequest : std::uint8_t { Disable, Enable, QuickStop };

struct DriveFeedback {
  std::int32_t position_counts{};  // at this tick's SYNC
  double joint_torque_nm{};        // measured by the drive, behind the gear
  std::uint16_t statusword{};
  bool fresh{};                    // answered this tick's SYNC
  bool enabled{};                  // CiA 402 operation enabled
  bool faulted{};
  bool heartbeat_ok{};
  std::uint16_t emcy_code{};       // last emergency, 0 for none
};

struct SensorFeedback {
  std::array<double, 6> force_torque{};  // Fx Fy Fz (N) Tx Ty Tz (N m), sensor frame
  std::uint16_t status{};
  bool fresh{};
  bool saturated{};
};

struct Feedback {
  LinkState state{};
  std::array<DriveFeedback, capacity::drives> drive{};
  std::size_t drives{};
  SensorFeedback sensor{};
  bool complete{};  // every drive fresh this tick
};

struct LinkCommand {
  DriveRequest request{};
  bool reset_faults{};
  std::array<double, capacity::drives> joint_torque_nm{};
};

}  // namespace trocar::hal
