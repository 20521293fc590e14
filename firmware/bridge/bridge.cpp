#include "firmware/bridge/bridge.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <string_view>
#include <utility>
#include <vector>

#include "common/rig/bus_budget.hpp"
#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "common/wire/types.hpp"
#include "firmware/bridge/flight_delivery.hpp"
#include "firmware/controller/door.hpp"
#include "firmware/flight/recorder.hpp"
#include "firmware/safety/faults.hpp"

namespace trocar::bridge {

namespace {

constexpr std::chrono::milliseconds period{5};  // a command waits at most this long for its tick
constexpr std::int64_t status_period_ns = 100'000'000;
constexpr std::size_t batch = 20;  // 50 messages a second at 1 kHz
// A writer may send commands faster than they can be taken. Then, so that the rest of this thread has its turn and the answers do not
// become a second flood:
constexpr std::size_t commands_a_turn = 256;
constexpr std::size_t refusals_a_status = 20;
constexpr std::int64_t loss_period_ns = 1'000'000'000;  // between two events that tell of dropped commands

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
      return "it was stopped before its end";
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

// What the CAN controllers say when it matters, else nothing.
std::string bus_trouble(const hal::BusReport& buses) {
  for (const auto& [name, condition] : {std::pair{"drives", buses.drives}, {"sensor", buses.sensor}})
    if (condition >= hal::BusCondition::Passive) return fmt::format("the CAN controller of the {} bus is {}", name, to_string(condition));
  return {};
}

double load_percent(std::uint64_t bits, std::uint64_t ticks, const rig::Rig& rig) {
  return 100.0 * static_cast<double>(bits) / (static_cast<double>(ticks) * rig::bus_budget(rig).bits_per_tick);
}

// Told, but no fault: what a page fault or an allocation can do to the motion is to make a tick late, and of that there is a measure with a
// limit (LateTick). To stop a machine for one that did no harm would be a hazard of its own; on a machine without locked memory they are
// usual.
std::string armed_disturbance(const LoopCounters& loop) {
  if (loop.armed_page_faults == 0 && loop.armed_allocations == 0) return {};
  return fmt::format(
      "{} page faults and {} allocations in the loop while armed, where none should be: let trocar-rig lock its memory (trocar "
      "rig check says how)",
      loop.armed_page_faults, loop.armed_allocations);
}

}  // namespace

struct Bridge::Entities {
  Entities(std::uint32_t domain, const std::filesystem::path& flight_folder)
      : participant(domain),
        samples(participant),
        status(participant),
        events(participant),
        replies(participant),
        commands(participant),
        wait(participant),
        flight(participant, events, flight_folder) {
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
  flight::Recorder recorder;
  FlightDelivery flight;
};

Bridge::Bridge(const rig::Rig& rig, controller::Mailboxes& mail, Shared& shared, const std::filesystem::path& flight_folder)
    : rig_(rig), mail_(mail), shared_(shared), entities_(std::make_unique<Entities>(rig.dds_domain, flight_folder)) {
  thread_ = std::thread([this] { run(); });
}

Bridge::~Bridge() {
  shared_.finished.store(true);
  if (thread_.joinable()) thread_.join();
}

void Bridge::report_real_time(bool complete, std::string missing, std::string machine) {
  real_time_ = complete;
  real_time_text_ = std::move(missing);
  machine_ = std::move(machine);
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
  if (entities_->recorder.finish()) entities_->flight.deliver(entities_->recorder.take());
  next_status_ns_ = 0;
  publish_rest();
}

void Bridge::take_commands() {
  std::array<std::string_view, capacity::gain_sets> names;
  for (std::size_t i = 0; i < rig_.gain_sets; ++i) names[i] = rig_.gain_set[i].name.data();
  const auto take = [&](const wire::Command& received) {
    Command command;
    const ReplyCode code = wire::from_wire(received, std::span(names).first(rig_.gain_sets), realtime_ns(), command);
    if (code == ReplyCode::Accepted && controller::let_in(mail_, snapshot_.status.session, command)) return;
    if (code == ReplyCode::Accepted || refusals_ == refusals_a_status) {
      ++commands_lost_;
      return;
    }
    ++refusals_;
    const Reply refused{received.session,      received.id,          static_cast<CommandKind>(received.kind), code,
                        snapshot_.status.mode, snapshot_.status.tick};
    (void)entities_->replies.write(wire::to_wire(refused, refusal(refused.code, refused.mode)));
  };
  entities_->commands.take(take, commands_a_turn);
}

void Bridge::publish_samples(bool flush) {
  auto& buffer = entities_->buffer;
  Sample sample;
  while (mail_.samples.pop(sample)) {
    last_sample_ns_ = sample.time_ns;
    if (entities_->recorder.push(sample)) entities_->flight.deliver(entities_->recorder.take());
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
  refusals_ = 0;
  tell_losses(now);
  const auto& s = snapshot_.status;
  std::string text;
  const std::string trouble = bus_trouble(snapshot_.buses);
  if (s.mode == Mode::Fault) {
    text = trouble.empty() ? fault_text_ : fmt::format("{}; {}", fault_text_, trouble);
  } else if (s.mode == Mode::Off && !trouble.empty()) {
    text = trouble;
  } else if (s.mode == Mode::Off) {
    std::array<char, 384> line{};
    if (snapshot_.operational) {
      wire::copy_text(line, "drives operational, waiting for their first values");
    } else {
      hal::canopen::describe(snapshot_.drives, line);
    }
    text = line.data();
  } else if (now < losses_told_ns_ + loss_period_ns) {
    text = loss_text_;
  } else if (!s.homed) {
    text = "not homed";
  } else if (real_time_known_.load(std::memory_order_acquire)) {
    text = armed_disturbance(snapshot_.loop);
    if (text.empty()) text = real_time_text_;
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
  // An event brings a status of its own, maybe after a tick or two, which are too few for a load.
  const hal::BusReport& buses = snapshot_.buses;
  const std::uint64_t ticks = buses.ticks - measured_buses_.ticks;
  if (static_cast<double>(ticks) >= 0.05 * rig_.timing.tick_hz) {
    drives_percent_ = load_percent(buses.drives_load.bits() - measured_buses_.drives_load.bits(), ticks, rig_);
    sensor_percent_ = load_percent(buses.sensor_load.bits() - measured_buses_.sensor_load.bits(), ticks, rig_);
    measured_buses_ = buses;
  }
  message.drives_bus_percent = static_cast<float>(drives_percent_);
  message.sensor_bus_percent = static_cast<float>(sensor_percent_);
  wire::put_loop(snapshot_.loop, message);
  if (real_time_known_.load(std::memory_order_acquire)) wire::copy_text(message.machine, machine_);
  (void)entities_->status.write(message);
}

void Bridge::tell_losses(std::int64_t now_ns) {
  if (commands_lost_ == losses_told_ || now_ns < losses_told_ns_ + loss_period_ns) return;
  const auto lost = static_cast<double>(commands_lost_ - losses_told_);
  losses_told_ = commands_lost_;
  losses_told_ns_ = now_ns;
  loss_text_ = fmt::format("{:.0f} commands dropped: a program floods rig/command; end it", lost);
  const auto& s = snapshot_.status;
  const Event event{.tick = s.tick,
                    .time_ns = last_sample_ns_,
                    .kind = EventKind::CommandsLost,
                    .from = s.mode,
                    .to = s.mode,
                    .fault = s.fault,
                    .value = lost};
  (void)entities_->events.write(wire::to_wire(event, loss_text_));
}

}  // namespace trocar::bridge
