#include "host/rig/client.hpp"

#include <fmt/format.h>

#include <chrono>
#include <random>

#include "common/config/user_error.hpp"
#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "common/wire/types.hpp"

namespace trocar::host {

namespace {

constexpr std::uint32_t deadline_ms = 500;
constexpr std::int64_t keep_alive_ns = 10'000'000;

std::int64_t realtime_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::uint64_t random_session() {
  std::random_device device;
  std::uint64_t value = 0;
  while (value == 0) value = (static_cast<std::uint64_t>(device()) << 32) | device();
  return value;
}

RigStatus from_wire(const wire::Status& s) {
  if (const auto problem = wire::version_problem(fmt::format("rig {}", s.rig), s.protocol); !problem.empty())
    throw config::UserError(problem);
  return {s.rig,
          static_cast<Mode>(s.mode),
          static_cast<Fault>(s.fault),
          s.homed,
          s.tared,
          s.real_time,
          s.session,
          s.tick,
          s.ticks_late,
          s.ticks_without_feedback,
          s.commands_lost,
          s.gain_set,
          s.text,
          static_cast<double>(s.drives_bus_percent),
          static_cast<double>(s.sensor_bus_percent),
          wire::loop_of(s),
          s.machine};
}

}  // namespace

struct RigClient::Entities {
  explicit Entities(std::uint32_t domain)
      : participant(domain),
        commands(participant),
        samples(participant),
        status(participant),
        events(participant),
        replies(participant),
        wait(participant) {
    wait.add(samples.entity());
    wait.add(status.entity());
    wait.add(replies.entity());
  }
  wire::Participant participant;
  wire::Writer<wire::Command> commands;
  wire::Reader<wire::SampleBatch> samples;
  wire::Reader<wire::Status> status;
  wire::Reader<wire::Event> events;
  wire::Reader<wire::Reply> replies;
  wire::WaitSet wait;
};

RigClient::RigClient(std::uint32_t domain) : session_(random_session()) {
  wire::hush();
  entities_ = std::make_unique<Entities>(domain);
}
RigClient::~RigClient() = default;

RigStatus RigClient::wait_for_rig(double timeout_s) {
  const double end = steady_s() + timeout_s;
  std::optional<RigStatus> found;
  while (steady_s() < end) {
    poll(0.05, {.status = [&](const RigStatus& s) { found = s; }});
    // A command must not be lost because the rig's reader was not matched yet.
    if (found && entities_->commands.matched() > 0 && entities_->replies.matched() > 0) return *found;
  }
  throw config::UserError(fmt::format(
      "no rig answers on DDS domain {}{}: start trocar-rig (and trocar-plant for a simulated one), or give --domain",
      entities_->participant.domain(), wire::reach() == wire::Reach::Secured ? " that has keys of the authority in TROCAR_KEYS" : ""));
}

void RigClient::send(const Command& command, const std::string& gain_set) {
  (void)entities_->commands.write(wire::to_wire(command, gain_set, realtime_ns(), deadline_ms));
}

void RigClient::keep_alive() {
  const auto now = static_cast<std::int64_t>(1e9 * steady_s());
  if (now - last_keep_alive_ns_ < keep_alive_ns) return;
  last_keep_alive_ns_ = now;
  send({.session = session_, .kind = CommandKind::KeepAlive});
}

RigReply RigClient::ask(CommandKind kind, double timeout_s, const std::string& gain_set) {
  Command command;
  command.kind = kind;
  return ask(command, timeout_s, gain_set);
}

RigReply RigClient::ask(Command command, double timeout_s, const std::string& gain_set) {
  command.session = session_;
  command.id = next_id_++;
  send(command, gain_set);
  const double end = steady_s() + timeout_s;
  std::optional<RigReply> last;
  while (steady_s() < end) {
    poll(0.02, {.reply = [&](const RigReply& r) {
           if (r.reply.session == session_ && r.reply.id == command.id && r.reply.code != ReplyCode::Accepted) last = r;
         }});
    if (last) return *last;
    keep_alive();
  }
  throw config::UserError(fmt::format("the rig did not answer {} within {:g} s: is trocar-rig running, and is the machine overloaded?",
                                      to_string(command.kind), timeout_s));
}

void RigClient::poll(double timeout_s, const Handlers& handlers) {
  (void)entities_->wait.wait(std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * timeout_s)));
  entities_->samples.take([&](const wire::SampleBatch& batch) {
    if (const auto problem = wire::version_problem("the rig", batch.protocol); !problem.empty()) throw config::UserError(problem);
    if (handlers.sample)
      for (std::uint32_t i = 0; i < batch.samples._length; ++i) handlers.sample(wire::from_wire(batch.samples._buffer[i]));
  });
  entities_->events.take([&](const wire::Event& e) {
    if (handlers.event) handlers.event({wire::from_wire(e), e.text});
  });
  entities_->status.take([&](const wire::Status& s) {
    const RigStatus status = from_wire(s);
    if (handlers.status) handlers.status(status);
  });
  entities_->replies.take([&](const wire::Reply& r) {
    if (handlers.reply) handlers.reply({wire::from_wire(r), r.text});
  });
}

}  // namespace trocar::host
