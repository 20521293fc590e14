#include "sim_plant/nodes/drive_node.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::sim_plant {

using hal::CanFrame;
using hal::canopen::DriveState;
using hal::canopen::NmtCommand;
using hal::canopen::NmtState;
using hal::canopen::Object;
namespace co = hal::canopen;
namespace object = hal::canopen::object;

namespace {

constexpr std::int64_t ns_per_ms = 1'000'000;
constexpr std::int64_t ns_per_100_us = 100'000;
constexpr std::uint16_t emcy_pdo_length = 0x8210;
constexpr std::uint8_t error_generic = 0x01;
constexpr std::uint8_t error_communication = 0x10;

std::uint32_t permille(double torque_nm, double rated_nm) noexcept {
  return static_cast<std::uint32_t>(std::lround(std::clamp(1000.0 * torque_nm / rated_nm, 0.0, 32767.0)));
}

constexpr std::uint16_t statusword(DriveState state) noexcept {
  constexpr std::uint16_t voltage_and_remote = 0x0210;
  switch (state) {
    case DriveState::SwitchOnDisabled:
      return voltage_and_remote | 0x0040;
    case DriveState::ReadyToSwitchOn:
      return voltage_and_remote | 0x0021;
    case DriveState::SwitchedOn:
      return voltage_and_remote | 0x0023;
    case DriveState::OperationEnabled:
      return voltage_and_remote | 0x1027;  // bit 12: follows the command
    case DriveState::QuickStopActive:
      return voltage_and_remote | 0x0007;
    case DriveState::FaultReaction:
      return voltage_and_remote | 0x000F;
    case DriveState::Fault:
      return voltage_and_remote | 0x0008;
    default:
      return 0;
  }
}

}  // namespace

DriveNodeConfig make_drive_config(const rig::Rig& rig, std::size_t drive, std::int32_t position_offset_counts) noexcept {
  const rig::Actuation& a = rig.actuation;
  return {.node = rig.buses.drive_node[drive],
          .encoder_counts_per_turn = a.encoder_counts_per_turn,
          .position_offset_counts = position_offset_counts,
          .rated_torque_nm = a.torque_constant_nm_per_a * a.continuous_current_a,
          .peak_torque_nm = a.torque_constant_nm_per_a * a.peak_current_a,
          .gear_ratio = a.gear_ratio[drive],
          .gear_efficiency = a.gear_efficiency};
}

DriveNode::DriveNode(const DriveNodeConfig& config) noexcept
    : config_{config},
      objects_{{.node = config.node,
                .rated_torque_mnm = static_cast<std::uint32_t>(std::lround(1000.0 * config.rated_torque_nm)),
                .peak_torque_permille = static_cast<std::uint16_t>(permille(config.peak_torque_nm, config.rated_torque_nm))}},
      sdo_{config.node},
      position_counts_{config.position_offset_counts} {
  configure_pdos();
  configure_services();
}

void DriveNode::receive(const CanFrame& frame, std::int64_t now_ns) noexcept {
  if (frame.extended || frame.error || nmt_ == NmtState::BootUp) return;
  if (frame.remote) {
    answer_remote(frame, now_ns);
    return;
  }
  if (frame.id == co::cob_nmt) {
    nmt_command(frame);
    return;
  }
  if (frame.id == watched_id_ && frame.length == 1) {
    master_watched_ = watched_ns_ > 0;
    master_heard_ns_ = now_ns;
    return;
  }
  if (nmt_ == NmtState::Stopped) return;
  if (frame.id == co::cob_sdo_request(config_.node)) {
    publish();
    const SdoServer::Outcome outcome = sdo_.receive(frame, objects_, now_ns);
    counters_.sdo_aborts = sdo_.aborts();
    if (outcome.answer) put(*outcome.answer);
    if (outcome.written) object_written(*outcome.written, now_ns);
    return;
  }
  if (nmt_ != NmtState::Operational) return;
  if (frame.id == sync_id_) {
    synchronise(now_ns);
    return;
  }
  for (Rpdo& pdo : rpdo_)
    if (frame.id == pdo.id) accept_rpdo(pdo, frame, now_ns);
}

void DriveNode::answer_remote(const CanFrame& frame, std::int64_t now_ns) noexcept {
  // Node guarding and heartbeats exclude each other (CiA 301, 7.2.8.3.2).
  if (frame.id == co::cob_heartbeat(config_.node) && period_ns_ == 0) {
    put(co::guarding_frame(config_.node, nmt_, guard_toggle_));
    guard_toggle_ ^= co::guard_toggle;
    guarded_ = true;
    guarded_ns_ = now_ns;
    return;
  }
  if (nmt_ != NmtState::Operational) return;
  for (Tpdo& pdo : tpdo_)
    if (frame.id == pdo.id) send_tpdo(pdo, fill(pdo), now_ns);  // pdo_no_remote keeps the others from being equal
}

void DriveNode::advance(std::int64_t now_ns) noexcept {
  if (nmt_ == NmtState::BootUp) {
    put(co::heartbeat_frame(config_.node, NmtState::BootUp));
    nmt_ = NmtState::PreOperational;
    next_heartbeat_ns_ = now_ns;
  }
  supervise_master(now_ns);
  if (state_ == DriveState::OperationEnabled) {
    for (const Rpdo& pdo : rpdo_) {
      if (pdo.deadline_ns == 0 || (pdo.id & co::pdo_invalid) != 0 || now_ns - pdo.heard_ns < pdo.deadline_ns) continue;
      ++counters_.rpdo_timeouts;
      trigger_fault(co::emcy_rpdo_timeout);
      break;
    }
  }
  if (const auto abort = sdo_.advance(now_ns)) put(*abort);
  if (nmt_ == NmtState::Operational) send_events(now_ns);
  if (period_ns_ > 0 && now_ns >= next_heartbeat_ns_) {
    put(co::heartbeat_frame(config_.node, nmt_));
    next_heartbeat_ns_ = now_ns < next_heartbeat_ns_ + period_ns_ ? next_heartbeat_ns_ + period_ns_ : now_ns + period_ns_;
  }
}

void DriveNode::supervise_master(std::int64_t now_ns) noexcept {
  if (master_watched_ && now_ns - master_heard_ns_ >= watched_ns_) {
    master_watched_ = false;  // until its next heartbeat
    master_lost();
  }
  if (guarded_ && life_ns_ > 0 && now_ns - guarded_ns_ >= life_ns_) {
    guarded_ = false;  // until the next request
    master_lost();
  }
}

void DriveNode::master_lost() noexcept {
  ++counters_.heartbeats_lost;
  connection_lost(co::emcy_heartbeat);
  const std::uint32_t behaviour = objects_.get(object::error_behaviour);
  if (behaviour == co::behaviour_stopped)
    go_to(NmtState::Stopped);
  else if (behaviour == co::behaviour_pre_operational && nmt_ == NmtState::Operational)
    go_to(NmtState::PreOperational);
}

bool DriveNode::transmit(CanFrame& frame) noexcept { return outgoing_.pop(frame); }

void DriveNode::put(const CanFrame& frame) noexcept {
  if (!outgoing_.push(frame)) ++counters_.transmit_dropped;
}

void DriveNode::set_shaft(double joint_angle_rad, double joint_torque_nm) noexcept {
  const double counts = std::floor(joint_angle_rad * config_.encoder_counts_per_turn / (2.0 * std::numbers::pi));
  if (std::abs(counts) < 1e18)  // the counter itself wraps at 32 bits
    position_counts_ = static_cast<std::int32_t>(
        static_cast<std::uint32_t>(static_cast<std::uint64_t>(static_cast<std::int64_t>(counts) + config_.position_offset_counts)));
  const double motor = joint_torque_nm / (config_.gear_ratio * config_.gear_efficiency);
  if (std::isfinite(motor))
    measured_permille_ = static_cast<std::int16_t>(std::lround(std::clamp(1000.0 * motor / config_.rated_torque_nm, -32768.0, 32767.0)));
}

double DriveNode::motor_torque_nm() const noexcept {
  if (state_ != DriveState::OperationEnabled || objects_.get(object::mode) != co::mode_cyclic_torque) return 0.0;
  return active_permille_ * config_.rated_torque_nm / 1000.0;
}

void DriveNode::trigger_fault(std::uint16_t emergency_code) noexcept {
  if (state_ == DriveState::Fault) return;
  ++counters_.faults;
  // The fault reaction lasts no time: the torque is off at once, which is option 0 of 605Eh and the end of all the others.
  enter(DriveState::Fault);
  emergency(emergency_code);
}

void DriveNode::restart() noexcept {
  objects_.reset_all();
  state_ = DriveState::SwitchOnDisabled;
  active_permille_ = 0;
  last_controlword_ = 0;
  reboot();
}

void DriveNode::reboot() noexcept {
  outgoing_.clear();
  nmt_ = NmtState::BootUp;
  master_watched_ = guarded_ = false;
  guard_toggle_ = 0;
  sdo_.reset();
  configure_pdos();
  configure_services();
}

void DriveNode::go_to(NmtState state) noexcept {
  const bool starts = state == NmtState::Operational && nmt_ != state;
  nmt_ = state;
  if (state == NmtState::Stopped) sdo_.reset();
  if (state == NmtState::Operational && !starts) return;
  for (Rpdo& pdo : rpdo_) pdo.has_pending = false;
  for (Tpdo& pdo : tpdo_) pdo.sent = false;
}

void DriveNode::nmt_command(const CanFrame& frame) noexcept {
  if (frame.length != 2 || (frame.data[1] != 0 && frame.data[1] != config_.node)) return;
  const auto command = static_cast<NmtCommand>(frame.data[0]);
  switch (command) {
    case NmtCommand::Start:
      go_to(NmtState::Operational);
      return;
    case NmtCommand::Stop:
    case NmtCommand::PreOperational:
      if (state_ == DriveState::OperationEnabled) connection_lost(co::emcy_communication);
      go_to(command == NmtCommand::Stop ? NmtState::Stopped : NmtState::PreOperational);
      return;
    case NmtCommand::ResetCommunication:
      if (state_ == DriveState::OperationEnabled) connection_lost(co::emcy_communication);
      objects_.reset_communication();
      reboot();
      return;
    case NmtCommand::ResetNode:
      restart();
      return;
  }
}

void DriveNode::object_written(Object written, std::int64_t now_ns) noexcept {
  if (written.index >= 0x1400 && written.index < 0x1C00)
    configure_pdos();
  else if (written.index < 0x2000)
    configure_services();
  if (written == object::producer_heartbeat) next_heartbeat_ns_ = now_ns;
  if (written == object::consumer_heartbeat) master_watched_ = false;
  if (written == object::mode) objects_.set(object::mode_display, objects_.get(object::mode));
  if (written == object::controlword) control(static_cast<std::uint16_t>(objects_.get(object::controlword)), now_ns);
}

void DriveNode::configure_pdos() noexcept {
  for (std::uint16_t i = 0; i < ObjectDictionary::pdos; ++i) {
    Rpdo& in = rpdo_[i];
    const auto received = static_cast<std::uint16_t>(0x1400 + i);
    in.id = objects_.get(object::pdo_id(received)) & (co::pdo_invalid | co::cob_mask);
    in.transmission = static_cast<std::uint8_t>(objects_.get(object::pdo_transmission(received)));
    in.deadline_ns = objects_.get(object::pdo_event_ms(received)) * ns_per_ms;
    in.mapping = objects_.mapping(static_cast<std::uint16_t>(0x1600 + i));
    in.has_torque = false;
    for (std::size_t k = 0; k < in.mapping.fields; ++k) in.has_torque |= in.mapping.field[k].object == object::target_torque;
    Tpdo& out = tpdo_[i];
    const auto sent = static_cast<std::uint16_t>(0x1800 + i);
    out.id = objects_.get(object::pdo_id(sent)) & (co::pdo_invalid | co::pdo_no_remote | co::cob_mask);
    out.transmission = static_cast<std::uint8_t>(objects_.get(object::pdo_transmission(sent)));
    out.inhibit_ns = objects_.get(object::pdo_inhibit(sent)) * ns_per_100_us;
    out.event_ns = objects_.get(object::pdo_event_ms(sent)) * ns_per_ms;
    out.mapping = objects_.mapping(static_cast<std::uint16_t>(0x1A00 + i));
    out.sent = false;
  }
}

void DriveNode::configure_services() noexcept {
  sync_id_ = objects_.get(object::sync_id) & co::cob_mask;
  const std::uint32_t watched = objects_.get(object::consumer_heartbeat);
  watched_id_ = (watched >> 16) != 0 ? co::cob_heartbeat(static_cast<std::uint8_t>((watched >> 16) & 0x7F)) : co::pdo_invalid;
  watched_ns_ = (watched & 0xFFFF) * ns_per_ms;
  life_ns_ = objects_.get(object::guard_time) * ns_per_ms * objects_.get(object::life_time_factor);
  period_ns_ = objects_.get(object::producer_heartbeat) * ns_per_ms;
}

CanFrame DriveNode::fill(const Tpdo& pdo) const noexcept {
  CanFrame frame{.id = pdo.id & co::cob_mask, .length = pdo.mapping.bytes};
  for (std::size_t i = 0; i < pdo.mapping.fields; ++i) {
    const ObjectDictionary::Field& field = pdo.mapping.field[i];
    const std::uint32_t value = objects_.get(field.object);
    for (std::size_t b = 0; b < field.object.bytes; ++b) frame.data[field.offset + b] = static_cast<std::uint8_t>(value >> (8 * b));
  }
  return frame;
}

void DriveNode::send_tpdo(Tpdo& pdo, const CanFrame& frame, std::int64_t now_ns) noexcept {
  put(frame);
  pdo.last = frame;
  pdo.sent = true;
  pdo.sent_ns = now_ns;
}

void DriveNode::send_events(std::int64_t now_ns) noexcept {
  bool any = false;
  for (const Tpdo& pdo : tpdo_) any |= pdo.exists() && pdo.on_event();
  if (!any) return;
  publish();
  for (Tpdo& pdo : tpdo_) {
    if (!pdo.exists() || !pdo.on_event() || pdo.mapping.fields == 0) continue;
    if (pdo.sent && now_ns - pdo.sent_ns < pdo.inhibit_ns) continue;
    const CanFrame frame = fill(pdo);
    bool due = !pdo.sent || (pdo.event_ns > 0 && now_ns - pdo.sent_ns >= pdo.event_ns);
    for (std::size_t i = 0; i < pdo.mapping.fields && !due; ++i) {
      const ObjectDictionary::Field& field = pdo.mapping.field[i];
      // Position and torque change at every moment: an event of them would be a flood.
      if (field.object == object::position || field.object == object::torque) continue;
      for (std::size_t b = 0; b < field.object.bytes; ++b) due |= frame.data[field.offset + b] != pdo.last.data[field.offset + b];
    }
    if (due) send_tpdo(pdo, frame, now_ns);
  }
}

void DriveNode::accept_rpdo(Rpdo& pdo, const CanFrame& frame, std::int64_t now_ns) noexcept {
  if (frame.length < pdo.mapping.bytes) {
    ++counters_.rpdo_wrong_length;
    emergency(emcy_pdo_length);
    return;
  }
  pdo.heard_ns = now_ns;
  pdo.pending = frame;
  pdo.has_pending = true;
  if (pdo.transmission > 240) apply_rpdo(pdo, now_ns);
}

void DriveNode::apply_rpdo(Rpdo& pdo, std::int64_t now_ns) noexcept {
  if (!pdo.has_pending) return;
  pdo.has_pending = false;
  for (std::size_t i = 0; i < pdo.mapping.fields; ++i) {
    const ObjectDictionary::Field& field = pdo.mapping.field[i];
    if (field.object.index < 0x20) continue;  // place holder
    std::uint32_t value = 0;
    for (std::size_t b = 0; b < field.object.bytes; ++b) value |= std::uint32_t{pdo.pending.data[field.offset + b]} << (8 * b);
    objects_.set(field.object, value);
    if (field.object == object::controlword) object_written(field.object, now_ns);
  }
}

void DriveNode::synchronise(std::int64_t now_ns) noexcept {
  publish();
  for (Rpdo& pdo : rpdo_)
    if (pdo.transmission <= 240) apply_rpdo(pdo, now_ns);
  const auto limit = static_cast<std::int32_t>(objects_.get(object::max_torque));
  const auto target = static_cast<std::int32_t>(static_cast<std::int16_t>(objects_.get(object::target_torque)));
  active_permille_ = static_cast<std::int16_t>(std::clamp(target, -limit, limit));

  ++syncs_;
  for (Tpdo& pdo : tpdo_) {
    if (!pdo.exists() || pdo.transmission > 240 || pdo.mapping.fields == 0) continue;
    const CanFrame frame = fill(pdo);
    // 0: at the SYNC after a change; n: at every n-th SYNC
    if (pdo.transmission == 0 ? !pdo.sent || !(frame == pdo.last) : syncs_ % pdo.transmission == 0) send_tpdo(pdo, frame, now_ns);
  }
  // With options below 5 the drive leaves the quick stop by itself once it has braked; without torque that is at once.
  if (state_ == DriveState::QuickStopActive && objects_.get(object::quick_stop_option) < 5) enter(DriveState::SwitchOnDisabled);
}

void DriveNode::publish() noexcept {
  objects_.set(object::statusword, statusword(state_));
  objects_.set(object::position, static_cast<std::uint32_t>(position_counts_));
  objects_.set(object::torque, static_cast<std::uint32_t>(measured_permille_));
}

void DriveNode::control(std::uint16_t word, std::int64_t now_ns) noexcept {
  const bool reset_edge = (word & co::control::fault_reset) != 0 && (last_controlword_ & co::control::fault_reset) == 0;
  last_controlword_ = word;
  if (state_ == DriveState::Fault) {
    if (!reset_edge) return;
    enter(DriveState::SwitchOnDisabled);
    emergency(co::emcy_none);
    return;
  }
  const bool disable_voltage = (word & 0x02) == 0;
  const bool quick_stop = (word & 0x06) == 0x02;
  const bool shutdown = (word & 0x07) == 0x06;
  const bool switch_on = (word & 0x0F) == 0x07;
  const bool enable = (word & 0x0F) == 0x0F;
  switch (state_) {
    case DriveState::SwitchOnDisabled:
      if (shutdown) enter(DriveState::ReadyToSwitchOn);
      break;
    case DriveState::ReadyToSwitchOn:
      if (disable_voltage || quick_stop)
        enter(DriveState::SwitchOnDisabled);
      else if (switch_on || enable)
        enter(DriveState::SwitchedOn);
      break;
    case DriveState::SwitchedOn:
      if (disable_voltage || quick_stop) {
        enter(DriveState::SwitchOnDisabled);
      } else if (shutdown) {
        enter(DriveState::ReadyToSwitchOn);
      } else if (enable) {
        for (Rpdo& pdo : rpdo_) pdo.heard_ns = now_ns;  // the watch over the torque frames begins here
        enter(DriveState::OperationEnabled);
      }
      break;
    case DriveState::OperationEnabled:
      if (disable_voltage)
        enter(DriveState::SwitchOnDisabled);
      else if (quick_stop)
        enter(DriveState::QuickStopActive);
      else if (shutdown)
        enter(DriveState::ReadyToSwitchOn);
      else if (switch_on)
        enter(DriveState::SwitchedOn);
      break;
    case DriveState::QuickStopActive:
      if (disable_voltage) enter(DriveState::SwitchOnDisabled);
      break;
    default:
      break;
  }
}

void DriveNode::enter(DriveState state) noexcept {
  state_ = state;
  // Whatever was commanded before belongs to the past: enabling starts from zero torque.
  active_permille_ = 0;
  objects_.set(object::target_torque, 0);
  for (Rpdo& pdo : rpdo_)
    if (pdo.has_torque) pdo.has_pending = false;
}

void DriveNode::connection_lost(std::uint16_t emergency_code) noexcept {
  if (state_ != DriveState::OperationEnabled) {
    emergency(emergency_code);
    return;
  }
  switch (static_cast<std::int16_t>(objects_.get(object::abort_connection_option))) {
    case 1:
      trigger_fault(emergency_code);
      return;
    case 2:
      enter(DriveState::SwitchOnDisabled);
      break;
    case 3:
      enter(DriveState::QuickStopActive);
      break;
    default:
      break;  // 0: no reaction
  }
  emergency(emergency_code);
}

void DriveNode::emergency(std::uint16_t code) noexcept {
  const std::uint8_t error =
      code == 0 ? 0 : static_cast<std::uint8_t>(error_generic | ((code & 0xF000) == 0x8000 ? error_communication : 0));
  objects_.set(object::error_register, error);
  objects_.set(object::error_code, code);
  if (code != 0) objects_.remember_error(code);
  const std::uint32_t id = objects_.get(object::emergency_id);
  if ((id & co::pdo_invalid) != 0) return;
  CanFrame frame{.id = id & co::cob_mask, .length = 8};
  hal::store(frame, 0, code);
  hal::store(frame, 2, error);
  put(frame);
}

}  // namespace trocar::sim_plant
