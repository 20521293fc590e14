#include "firmware/bridge/bridge.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <cstring>
#include <string_view>
#include <vector>

#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "common/wire/types.hpp"
#include "firmware/safety/faults.hpp"

namespace trocar::bridge {

namespace {

constexpr std::chrono::milliseconds period{5};  // a command waits at most this long for its tick
constexpr std::int64_t status_period_ns = 100'000'000;
constexpr std::size_t batch = 20;  // 50 messages a second at 1 kHz

std::int64_t realtime_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}
std::int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string refusal(ReplyCode code, Mode mode) {
  switch (code) {
    case ReplyCode::Accepted:
    case ReplyCode::Done:
      return {};
    case ReplyCode::Stopped:
      return "the motion ended before its target";
    case ReplyCode::WrongMode:
      return fmt::format("not possible in mode {}", to_string(mode));
    case ReplyCode::SessionTaken:
      return "another commander is armed: it has to disarm or go silent first (hold and stop are open to all)";
    case ReplyCode::NoSession:
      return "arm first: only the armed commander may do this";
    case ReplyCode::NotHomed:
      return "home first, with the handle in its jig";
    case ReplyCode::NotAtRest:
      return "wait until the handle is at rest";
    case ReplyCode::OutOfRange:
      return "a value is not finite, or lies outside of the workspace or limits";
    case ReplyCode::UnreachablePose:
      return "a pose on the way is out of reach or close to a singularity";
    case ReplyCode::Expired:
      return "the command arrived after its deadline";
    case ReplyCode::WrongVersion:
      return fmt::format("this rig speaks protocol {}: install the same version of trocar on both sides", protocol_version);
    case ReplyCode::UnknownGains:
      return "no such gain set in the rig file";
    case ReplyCode::StillFaulty:
      return "the drives are not operational yet";
    case ReplyCode::NoModel:
      return "no virtual needle: start trocar-rig with --model IMAGE (trocar scene compile makes one)";
  }
  return {};
}

}  // namespace

struct Bridge::Entities {
  explicit Entities(std::uint32_t domain)
      : participant(domain),
        samples(participant),
        status(participant),
        events(participant),
        replies(participant),
        commands(participant),
        wait(participant) {
    wait.add(commands.entity());
  }
  wire::Participant participant;
  wire::Writer<wire::SampleBatch> samples;
  wire::Writer<wire::Status> status;
  wire::Writer<wire::Event> events;
  wire::Writer<wire::Reply> replies;
  wire::Reader<wire::Command> commands;
  wire::WaitSet wait;
  wire::BatchBuffer buffer;
};

Bridge::Bridge(const rig::Rig& rig, controller::Mailboxes& mail, Shared& shared)
    : rig_(rig), mail_(mail), shared_(shared), entities_(std::make_unique<Entities>(rig.dds_domain)) {
  thread_ = std::thread([this] { run(); });
}

Bridge::~Bridge() {
  shared_.finished.store(true);
  if (thread_.joinable()) thread_.join();
}

void Bridge::report_real_time(bool complete, std::string missing) {
  real_time_ = complete;
  real_time_text_ = std::move(missing);
  real_time_known_.store(true, std::memory_order_release);
}

void Bridge::run() {
  while (!shared_.finished.load()) {
    entities_->wait.wait(period);
    take_commands();
    publish_samples(false);
    publish_rest();
  }
  publish_samples(true);
  next_status_ns_ = 0;
  publish_rest();
}

void Bridge::take_commands() {
  std::array<std::string_view, capacity::gain_sets> names;
  for (std::size_t i = 0; i < rig_.gain_sets; ++i) names[i] = rig_.gain_set[i].name.data();
  entities_->commands.take([&](const wire::Command& received) {
    Command command;
    const ReplyCode code = wire::from_wire(received, std::span(names).first(rig_.gain_sets), realtime_ns(), command);
    if (code == ReplyCode::Accepted && mail_.commands.push(command)) return;
    if (code == ReplyCode::Accepted) ++commands_lost_;
    Reply refused{received.session,
                  received.id,
                  static_cast<CommandKind>(received.kind),
                  code == ReplyCode::Accepted ? ReplyCode::Expired : code,
                  snapshot_.status.mode,
                  snapshot_.status.tick};
    (void)entities_->replies.write(wire::to_wire(refused, refusal(refused.code, refused.mode)));
  });
}

void Bridge::publish_samples(bool flush) {
  auto& buffer = entities_->buffer;
  Sample sample;
  while (mail_.samples.pop(sample)) {
    (void)buffer.push(sample);
    if (buffer.size() < batch) continue;
    (void)entities_->samples.write(buffer.message(mail_.samples.dropped()));
    buffer.clear();
  }
  if (flush && buffer.size() > 0) (void)entities_->samples.write(buffer.message(mail_.samples.dropped()));
}

void Bridge::publish_rest() {
  Reply reply;
  while (mail_.replies.pop(reply)) (void)entities_->replies.write(wire::to_wire(reply, refusal(reply.code, reply.mode)));
  Event event;
  while (mail_.events.pop(event)) {
    std::string text;
    if (event.kind == EventKind::FaultLatched) {
      const auto& row = safety::row(event.fault);
      text = fmt::format("{}: {:.6g}, limit {:.6g}; {}", row.cause, event.value, event.limit, row.remedy);
      fault_text_ =
          fmt::format("{}: {} ({:.6g}, limit {:.6g}); {}", to_string(event.fault), row.cause, event.value, event.limit, row.remedy);
    }
    if (event.kind == EventKind::HostLost)
      text = fmt::format("no sign of life from the armed host for {:.0f} ms: holding", 1e3 * event.value);
    (void)entities_->events.write(wire::to_wire(event, text));
    next_status_ns_ = 0;
  }
  while (shared_.snapshots.pop(snapshot_)) {
  }
  const std::int64_t now = monotonic_ns();
  if (now < next_status_ns_) return;
  next_status_ns_ = now + status_period_ns;
  const auto& s = snapshot_.status;
  std::string text;
  if (s.mode == Mode::Fault) {
    text = fault_text_;
  } else if (s.mode == Mode::Off) {
    std::array<char, 384> line{};
    if (snapshot_.operational) {
      std::strcpy(line.data(), "drives operational, waiting for their first values");
    } else {
      hal::canopen::describe(snapshot_.drives, line);
    }
    text = line.data();
  } else if (!s.homed) {
    text = "not homed";
  } else if (real_time_known_.load(std::memory_order_acquire)) {
    text = real_time_text_;
  }
  wire::Status message{};
  message.protocol = protocol_version;
  wire::copy_text(message.rig, rig_.name.data());
  message.mode = static_cast<std::uint8_t>(s.mode);
  message.fault = static_cast<std::uint8_t>(s.fault);
  message.homed = s.homed;
  message.tared = s.tared;
  message.real_time = real_time_known_.load(std::memory_order_acquire) && real_time_;
  message.session = s.session;
  message.tick = s.tick;
  message.ticks_late = s.ticks_late;
  message.ticks_without_feedback = s.ticks_without_feedback;
  message.commands_lost = commands_lost_;
  wire::copy_text(message.gain_set, rig_.gain_set[s.gain_set].name.data());
  wire::copy_text(message.text, text);
  (void)entities_->status.write(message);
}

}  // namespace trocar::bridge
