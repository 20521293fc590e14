#include "common/wire/convert.hpp"

#include <algorithm>
#include <cstring>

namespace trocar::wire {

namespace {

template <class To, class From, std::size_t N>
void copy(To (&to)[N], const std::array<From, N>& from) noexcept {
  std::copy(from.begin(), from.end(), to);
}
template <class To, class From, std::size_t N>
void copy(std::array<To, N>& to, const From (&from)[N]) noexcept {
  std::copy(from, from + N, to.begin());
}

template <std::size_t N>
std::string_view text_of(const char (&text)[N]) noexcept {
  return {text, strnlen(text, N)};
}

constexpr std::uint8_t last_command = static_cast<std::uint8_t>(CommandKind::Haptic);
constexpr std::uint8_t last_display = static_cast<std::uint8_t>(Display::Admittance);

}  // namespace

void copy_text(std::span<char> to, std::string_view text) noexcept {
  if (to.empty()) return;
  std::size_t size = std::min(text.size(), to.size() - 1);
  if (size < text.size()) {
    while (size > 0 && (static_cast<unsigned char>(text[size]) & 0xC0u) == 0x80u) --size;
  }
  std::copy_n(text.begin(), size, to.begin());
  to[size] = '\0';
}

namespace {

// Both ways: the two have the same fields under the same names.
template <class To, class From>
To sample_as(const From& from) noexcept {
  To to{};
  to.tick = from.tick;
  to.time_ns = from.time_ns;
  to.mode = static_cast<decltype(to.mode)>(from.mode);
  to.fault = static_cast<decltype(to.fault)>(from.fault);
  to.moving = from.moving;
  to.gain_set = from.gain_set;
  to.command_id = from.command_id;
  copy(to.position_counts, from.position_counts);
  copy(to.joint_torque_command_nm, from.joint_torque_command_nm);
  copy(to.joint_torque_measured_nm, from.joint_torque_measured_nm);
  copy(to.pose, from.pose);
  copy(to.velocity, from.velocity);
  copy(to.setpoint_pose, from.setpoint_pose);
  copy(to.setpoint_velocity, from.setpoint_velocity);
  copy(to.wrench_command, from.wrench_command);
  copy(to.base_wrench, from.base_wrench);
  to.residual_m = from.residual_m;
  to.singularity = from.singularity;
  to.missed_feedback = from.missed_feedback;
  to.wakeup_late_us = from.wakeup_late_us;
  to.tick_us = from.tick_us;
  copy(to.handle_wrench, from.handle_wrench);
  copy(to.virtual_pose, from.virtual_pose);
  copy(to.virtual_wrench, from.virtual_wrench);
  to.display_energy_j = from.display_energy_j;
  to.virtual_contacts = from.virtual_contacts;
  to.virtual_status = from.virtual_status;
  return to;
}

}  // namespace

Sample to_wire(const trocar::Sample& sample) noexcept { return sample_as<Sample>(sample); }
trocar::Sample from_wire(const Sample& sample) noexcept { return sample_as<trocar::Sample>(sample); }

void put_loop(const LoopCounters& loop, Status& status) noexcept {
  status.overruns = loop.overruns;
  status.minor_faults = loop.minor_faults;
  status.major_faults = loop.major_faults;
  status.preemptions = loop.preemptions;
  status.allocations = loop.allocations;
  status.armed_page_faults = loop.armed_page_faults;
  status.armed_allocations = loop.armed_allocations;
}

LoopCounters loop_of(const Status& s) noexcept {
  return {.overruns = s.overruns,
          .minor_faults = s.minor_faults,
          .major_faults = s.major_faults,
          .preemptions = s.preemptions,
          .allocations = s.allocations,
          .armed_page_faults = s.armed_page_faults,
          .armed_allocations = s.armed_allocations};
}

Event to_wire(const trocar::Event& event, std::string_view text) noexcept {
  Event out{};
  out.protocol = protocol_version;
  out.tick = event.tick;
  out.time_ns = event.time_ns;
  out.kind = static_cast<std::uint8_t>(event.kind);
  out.mode_from = static_cast<std::uint8_t>(event.from);
  out.mode_to = static_cast<std::uint8_t>(event.to);
  out.fault = static_cast<std::uint8_t>(event.fault);
  out.value = event.value;
  out.limit = event.limit;
  copy_text(out.text, text);
  return out;
}

trocar::Event from_wire(const Event& event) noexcept {
  trocar::Event out{};
  out.tick = event.tick;
  out.time_ns = event.time_ns;
  out.kind = static_cast<EventKind>(event.kind);
  out.from = static_cast<Mode>(event.mode_from);
  out.to = static_cast<Mode>(event.mode_to);
  out.fault = static_cast<Fault>(event.fault);
  out.value = event.value;
  out.limit = event.limit;
  return out;
}

Reply to_wire(const trocar::Reply& reply, std::string_view text) noexcept {
  Reply out{};
  out.protocol = protocol_version;
  out.session = reply.session;
  out.id = reply.id;
  out.kind = static_cast<std::uint8_t>(reply.kind);
  out.code = static_cast<std::uint8_t>(reply.code);
  out.mode = static_cast<std::uint8_t>(reply.mode);
  out.tick = reply.tick;
  copy_text(out.text, text);
  return out;
}

trocar::Reply from_wire(const Reply& reply) noexcept {
  trocar::Reply out{};
  out.session = reply.session;
  out.id = reply.id;
  out.kind = static_cast<CommandKind>(reply.kind);
  out.code = static_cast<ReplyCode>(reply.code);
  out.mode = static_cast<Mode>(reply.mode);
  out.tick = reply.tick;
  return out;
}

Command to_wire(const trocar::Command& command, std::string_view gain_set, std::int64_t sent_ns, std::uint32_t deadline_ms) noexcept {
  Command out{};
  out.protocol = protocol_version;
  out.session = command.session;
  out.id = command.id;
  out.sent_ns = sent_ns;
  out.deadline_ms = deadline_ms;
  out.kind = static_cast<std::uint8_t>(command.kind);
  copy_text(out.gain_set, gain_set);
  copy(out.target_pose, command.target_pose);
  out.speed_m_s = command.speed_m_s;
  out.angular_speed_rad_s = command.angular_speed_rad_s;
  out.stop_force_n = command.stop_force_n;
  out.display = static_cast<std::uint8_t>(command.display);
  return out;
}

ReplyCode from_wire(const Command& command, std::span<const std::string_view> gain_sets, std::int64_t now_ns,
                    trocar::Command& out) noexcept {
  if (command.protocol != protocol_version || command.kind > last_command || command.display > last_display) return ReplyCode::WrongVersion;
  // Compared without adding, so that a hostile sent_ns cannot overflow.
  const std::int64_t allowed_ns = std::int64_t{command.deadline_ms} * 1'000'000;
  if (command.deadline_ms != 0 && command.sent_ns < now_ns - allowed_ns) return ReplyCode::Expired;

  out = {};
  out.session = command.session;
  out.id = command.id;
  out.kind = static_cast<CommandKind>(command.kind);
  if (out.kind == CommandKind::SelectGains) {
    const auto found = std::find(gain_sets.begin(), gain_sets.end(), text_of(command.gain_set));
    if (found == gain_sets.end()) return ReplyCode::UnknownGains;
    out.gain_set = static_cast<std::uint8_t>(found - gain_sets.begin());
  }
  copy(out.target_pose, command.target_pose);
  out.speed_m_s = command.speed_m_s;
  out.angular_speed_rad_s = command.angular_speed_rad_s;
  out.stop_force_n = command.stop_force_n;
  out.display = static_cast<Display>(command.display);
  return ReplyCode::Accepted;
}

std::string version_problem(std::string_view who, std::uint32_t theirs) {
  if (theirs == protocol_version) return {};
  return std::string(who) + " speaks protocol " + std::to_string(theirs) + ", this program " + std::to_string(protocol_version) +
         ": install the same version of trocar on both sides";
}

bool BatchBuffer::push(const trocar::Sample& sample) noexcept {
  if (full()) return false;
  samples_[size_++] = to_wire(sample);
  return true;
}

SampleBatch BatchBuffer::message(std::uint64_t dropped) noexcept {
  SampleBatch out{};
  out.protocol = protocol_version;
  out.dropped = dropped;
  lend(out.samples);
  return out;
}

FlightBatch BatchBuffer::flight(std::int64_t end_ns) noexcept {
  FlightBatch out{};
  out.protocol = protocol_version;
  out.end_ns = end_ns;
  lend(out.samples);
  return out;
}

}  // namespace trocar::wire
