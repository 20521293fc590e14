// The state machine of a drive as its master sees it (CiA 402-2: statusword 6041h, controlword 6040h).
#pragma once

#include <cstdint>

namespace trocar::hal::canopen {

enum class DriveState : std::uint8_t {
  NotReady,
  SwitchOnDisabled,
  ReadyToSwitchOn,
  SwitchedOn,
  OperationEnabled,
  QuickStopActive,
  FaultReaction,
  Fault,
  Unknown,  // a statusword that the standard does not have
};
[[nodiscard]] DriveState decode_statusword(std::uint16_t statusword) noexcept;
[[nodiscard]] const char* to_string(DriveState state) noexcept;

namespace control {
inline constexpr std::uint16_t disable_voltage = 0x0000;
inline constexpr std::uint16_t quick_stop = 0x0002;
inline constexpr std::uint16_t shutdown = 0x0006;
inline constexpr std::uint16_t switch_on = 0x0007;
inline constexpr std::uint16_t enable_operation = 0x000F;
inline constexpr std::uint16_t fault_reset = 0x0080;  // acts on its rising edge
}  // namespace control

enum class DriveRequest : std::uint8_t { Disable, Enable, QuickStop };

struct ControlStep {
  std::uint16_t word{};
  bool reached{};  // the drive is where the request wants it, or waits for something that no controlword can give
};

// The next controlword on the way from `state` to `request`. `last_word`: the one sent before, for the edge of the fault reset.
[[nodiscard]] ControlStep next_controlword(DriveState state, DriveRequest request, bool reset_fault, std::uint16_t last_word) noexcept;

}  // namespace trocar::hal::canopen
