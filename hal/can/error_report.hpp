// What the local CAN controller reports about itself and the bus: the error frames of SocketCAN, which never were on the wire.
//   identifier   class bits     data[1]  details of the controller class
// Source: linux/can/error.h. The states are those of fault confinement in ISO 11898-1.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"

namespace trocar::hal {

inline constexpr std::uint32_t error_class_controller = 0x04;
inline constexpr std::uint32_t error_class_no_acknowledge = 0x20;
inline constexpr std::uint32_t error_class_bus_off = 0x40;
inline constexpr std::uint32_t error_class_restarted = 0x100;
inline constexpr std::uint8_t controller_overflow = 0x03;  // data[1]: a frame was lost in the controller
inline constexpr std::uint8_t controller_warning = 0x0C;   // one of its error counters is at 96 or above
inline constexpr std::uint8_t controller_passive = 0x30;   // at 128 or above: it may not send error flags any more
inline constexpr std::uint8_t controller_active = 0x40;    // back below

enum class BusCondition : std::uint8_t {
  Active,
  Warning,
  Passive,
  Off,  // the controller takes no part in the bus until it is started again
};

// Precondition: report.error. A report that says nothing of the state leaves it as it was.
[[nodiscard]] constexpr BusCondition condition_after(const CanFrame& report, BusCondition before) noexcept {
  if ((report.id & error_class_bus_off) != 0) return BusCondition::Off;
  if ((report.id & error_class_restarted) != 0) return BusCondition::Active;
  if ((report.id & error_class_controller) == 0) return before;
  if ((report.data[1] & controller_passive) != 0) return BusCondition::Passive;
  if ((report.data[1] & controller_warning) != 0) return BusCondition::Warning;
  return (report.data[1] & controller_active) != 0 ? BusCondition::Active : before;
}

// What a person reads, and does: static text.
[[nodiscard]] constexpr const char* to_string(BusCondition condition) noexcept {
  switch (condition) {
    case BusCondition::Active:
      return "error active";
    case BusCondition::Warning:
      return "error warning: many frames are disturbed; check the cable, its terminators and the bit rate";
    case BusCondition::Passive:
      return "error passive: most frames are disturbed or nobody acknowledges them; check the cable, its terminators and the bit rate";
    case BusCondition::Off:
      return "off the bus: check the cable, its terminators and the bit rate, then start again";
  }
  return "";
}

}  // namespace trocar::hal
