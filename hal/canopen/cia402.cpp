#include "hal/canopen/cia402.hpp"

#include <array>
#include <cstddef>

namespace trocar::hal::canopen {

DriveState decode_statusword(std::uint16_t statusword) noexcept {
  switch (statusword & 0x4F) {  // bit 5 (quick stop) does not count in these four
    case 0x00:
      return DriveState::NotReady;
    case 0x40:
      return DriveState::SwitchOnDisabled;
    case 0x0F:
      return DriveState::FaultReaction;
    case 0x08:
      return DriveState::Fault;
    default:
      break;
  }
  switch (statusword & 0x6F) {
    case 0x21:
      return DriveState::ReadyToSwitchOn;
    case 0x23:
      return DriveState::SwitchedOn;
    case 0x27:
      return DriveState::OperationEnabled;
    case 0x07:
      return DriveState::QuickStopActive;
    default:
      return DriveState::Unknown;
  }
}

const char* to_string(DriveState state) noexcept {
  constexpr std::array<const char*, 9> names{"Not ready to switch on",
                                             "Switch on disabled",
                                             "Ready to switch on",
                                             "Switched on",
                                             "Operation enabled",
                                             "Quick stop active",
                                             "Fault reaction active",
                                             "Fault",
                                             "unknown"};
  return static_cast<std::size_t>(state) < names.size() ? names[static_cast<std::size_t>(state)] : "?";
}

ControlStep next_controlword(DriveState state, DriveRequest request, bool reset_fault, std::uint16_t last_word) noexcept {
  switch (state) {
    case DriveState::NotReady:
    case DriveState::FaultReaction:
    case DriveState::Unknown:
      return {last_word, true};
    case DriveState::Fault:
      if (!reset_fault) return {last_word, true};
      return {(last_word & control::fault_reset) != 0 ? control::disable_voltage : control::fault_reset, false};
    default:
      break;
  }
  const bool off = state == DriveState::SwitchOnDisabled;
  switch (request) {
    case DriveRequest::Disable:
      return {control::disable_voltage, off};
    case DriveRequest::QuickStop:
      return {control::quick_stop, off || state == DriveState::QuickStopActive};
    case DriveRequest::Enable:
      break;
  }
  switch (state) {
    case DriveState::SwitchOnDisabled:
      return {control::shutdown, false};
    case DriveState::ReadyToSwitchOn:
      return {control::switch_on, false};
    case DriveState::SwitchedOn:
      return {control::enable_operation, false};
    case DriveState::OperationEnabled:
      return {control::enable_operation, true};
    default:
      return {control::disable_voltage, false};  // out of a quick stop only through Switch on disabled
  }
}

}  // namespace trocar::hal::canopen
