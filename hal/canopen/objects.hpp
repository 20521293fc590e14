// Identifiers, objects and codes of CiA 301 (communication) and CiA 402 (drives) that a rig uses.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"

namespace trocar::hal::canopen {

// --- identifiers (pre-defined connection set; the torque RPDO and the controlword RPDO are the rig's choice)
inline constexpr std::uint32_t cob_nmt = 0x000;
inline constexpr std::uint32_t cob_sync = 0x080;
inline constexpr std::uint32_t cob_torque = 0x200;  // one frame for all drives: 4 x int16
[[nodiscard]] constexpr std::uint32_t cob_emergency(std::uint8_t node) noexcept { return 0x080u + node; }
[[nodiscard]] constexpr std::uint32_t cob_feedback(std::uint8_t node) noexcept { return 0x180u + node; }
[[nodiscard]] constexpr std::uint32_t cob_controlword(std::uint8_t node) noexcept { return 0x300u + node; }
[[nodiscard]] constexpr std::uint32_t cob_sdo_response(std::uint8_t node) noexcept { return 0x580u + node; }
[[nodiscard]] constexpr std::uint32_t cob_sdo_request(std::uint8_t node) noexcept { return 0x600u + node; }
[[nodiscard]] constexpr std::uint32_t cob_heartbeat(std::uint8_t node) noexcept { return 0x700u + node; }
inline constexpr std::uint32_t pdo_invalid = 0x8000'0000u;    // bit 31 of a PDO's identifier entry: the PDO does not exist
inline constexpr std::uint32_t pdo_no_remote = 0x4000'0000u;  // bit 30: not to be asked for by a remote frame
inline constexpr std::uint32_t cob_mask = 0x7FFu;

// --- network management
enum class NmtCommand : std::uint8_t { Start = 0x01, Stop = 0x02, PreOperational = 0x80, ResetNode = 0x81, ResetCommunication = 0x82 };
enum class NmtState : std::uint8_t { BootUp = 0x00, Stopped = 0x04, Operational = 0x05, PreOperational = 0x7F };

[[nodiscard]] constexpr CanFrame nmt_frame(NmtCommand command, std::uint8_t node /* 0: all */) noexcept {
  CanFrame frame{.id = cob_nmt, .length = 2};
  frame.data[0] = static_cast<std::uint8_t>(command);
  frame.data[1] = node;
  return frame;
}
[[nodiscard]] constexpr CanFrame heartbeat_frame(std::uint8_t node, NmtState state) noexcept {
  CanFrame frame{.id = cob_heartbeat(node), .length = 1};
  frame.data[0] = static_cast<std::uint8_t>(state);
  return frame;
}
// Node guarding: the answer to a remote frame of the heartbeat's identifier; the toggle bit alternates from 0.
inline constexpr std::uint8_t guard_toggle = 0x80;
[[nodiscard]] constexpr CanFrame guarding_frame(std::uint8_t node, NmtState state, std::uint8_t toggle) noexcept {
  CanFrame frame = heartbeat_frame(node, state);
  frame.data[0] = static_cast<std::uint8_t>(frame.data[0] | toggle);
  return frame;
}

// --- objects
struct Object {
  std::uint16_t index{};
  std::uint8_t subindex{};
  std::uint8_t bytes{};
  friend constexpr bool operator==(const Object& a, const Object& b) noexcept { return a.index == b.index && a.subindex == b.subindex; }
};
[[nodiscard]] constexpr std::uint32_t mapping(Object object) noexcept {
  return (static_cast<std::uint32_t>(object.index) << 16) | (static_cast<std::uint32_t>(object.subindex) << 8) | (8u * object.bytes);
}

namespace object {
inline constexpr Object dummy_int16{0x0003, 0, 2};  // place holder in a mapping
inline constexpr Object device_type{0x1000, 0, 4};
inline constexpr Object error_register{0x1001, 0, 1};
inline constexpr Object error_count{0x1003, 0, 1};  // the errors follow in the next subindices
inline constexpr Object sync_id{0x1005, 0, 4};
inline constexpr Object guard_time{0x100C, 0, 2};  // ms
inline constexpr Object life_time_factor{0x100D, 0, 1};
inline constexpr Object emergency_id{0x1014, 0, 4};
inline constexpr Object consumer_heartbeat{0x1016, 1, 4};  // (node << 16) | ms
inline constexpr Object producer_heartbeat{0x1017, 0, 2};  // ms
inline constexpr Object vendor{0x1018, 1, 4};
inline constexpr Object product{0x1018, 2, 4};
inline constexpr Object error_behaviour{0x1029, 1, 1};  // on a communication error: 0 pre-operational, 1 no change, 2 stopped
// Communication (1400h, 1800h) and mapping (1600h, 1A00h) entries of one PDO
inline constexpr std::uint16_t torque_rpdo = 0x1400, torque_rpdo_map = 0x1600;
inline constexpr std::uint16_t controlword_rpdo = 0x1401, controlword_rpdo_map = 0x1601;
inline constexpr std::uint16_t feedback_tpdo = 0x1800, feedback_tpdo_map = 0x1A00;
[[nodiscard]] constexpr Object pdo_id(std::uint16_t pdo) noexcept { return {pdo, 1, 4}; }
[[nodiscard]] constexpr Object pdo_transmission(std::uint16_t pdo) noexcept { return {pdo, 2, 1}; }
[[nodiscard]] constexpr Object pdo_inhibit(std::uint16_t pdo) noexcept { return {pdo, 3, 2}; }  // 100 us
[[nodiscard]] constexpr Object pdo_event_ms(std::uint16_t pdo) noexcept { return {pdo, 5, 2}; }
[[nodiscard]] constexpr Object map_count(std::uint16_t map) noexcept { return {map, 0, 1}; }
[[nodiscard]] constexpr Object map_entry(std::uint16_t map, std::uint8_t place /* 1 … */) noexcept { return {map, place, 4}; }
inline constexpr Object abort_connection_option{0x6007, 0, 2};
inline constexpr Object error_code{0x603F, 0, 2};
inline constexpr Object controlword{0x6040, 0, 2};
inline constexpr Object statusword{0x6041, 0, 2};
inline constexpr Object quick_stop_option{0x605A, 0, 2};
inline constexpr Object fault_reaction_option{0x605E, 0, 2};
inline constexpr Object mode{0x6060, 0, 1};
inline constexpr Object mode_display{0x6061, 0, 1};
inline constexpr Object position{0x6064, 0, 4};       // encoder counts
inline constexpr Object target_torque{0x6071, 0, 2};  // permille of the rated torque, as are the next two
inline constexpr Object max_torque{0x6072, 0, 2};
inline constexpr Object torque{0x6077, 0, 2};
inline constexpr Object rated_torque{0x6076, 0, 4};  // mN m
}  // namespace object

inline constexpr std::uint32_t behaviour_pre_operational = 0, behaviour_stopped = 2;  // of error_behaviour
inline constexpr std::uint8_t transmission_every_sync = 1;
inline constexpr std::uint8_t transmission_event = 255;
inline constexpr std::uint8_t mode_cyclic_torque = 10;
inline constexpr std::uint32_t profile_402 = 402;  // low half of the device type

// Options of CiA 402 that the rig asks for.
inline constexpr std::int16_t abort_connection_fault = 1;  // a lost master is a fault
inline constexpr std::int16_t quick_stop_ramp = 2;         // brake on the quick-stop ramp, then torque off
inline constexpr std::int16_t fault_reaction_disable = 0;  // torque off at once

// --- emergency codes
inline constexpr std::uint16_t emcy_none = 0x0000;
inline constexpr std::uint16_t emcy_communication = 0x8100;
inline constexpr std::uint16_t emcy_heartbeat = 0x8130;
inline constexpr std::uint16_t emcy_rpdo_timeout = 0x8250;

}  // namespace trocar::hal::canopen
