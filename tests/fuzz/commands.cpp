// Command intake: what anybody may send over the network goes through the bridge's checks into the controller, which ticks on. Whatever
// is asked, torques stay finite and within the drives' reach, there is none without an armed session, and no number of a command gets as
// far as to make the controller's own numbers infinite.
#include <array>
#include <cmath>
#include <memory>
#include <string_view>

#include "byte_source.hpp"
#include "common/wire/convert.hpp"
#include "fake_rig.hpp"
#include "firmware/controller/door.hpp"
#include "firmware/safety/modes.hpp"
#include "property.hpp"

using namespace trocar;
using fuzz::require;

namespace {

constexpr std::int64_t now_realtime_ns = 1'700'000'000'000'000'000;

// A number that may be anything, or one that a person would send.
double number(fuzz::ByteSource& in, bool sensible, double scale) {
  return sensible ? scale * in.take<std::int8_t>() / 128.0 : in.take<double>();
}

wire::Command take_command(fuzz::ByteSource& in) {
  wire::Command command{};
  const auto shape = in.take<std::uint8_t>();
  const bool sensible = (shape & 1) != 0;
  command.protocol = (shape & 2) != 0 ? protocol_version : in.take<std::uint32_t>();
  command.session = (shape & 4) != 0 ? controller::FakeRig::host : in.take<std::uint64_t>();
  command.id = in.take<std::uint32_t>();
  command.sent_ns = (shape & 8) != 0 ? now_realtime_ns - 1 : in.take<std::int64_t>();
  command.deadline_ms = (shape & 16) != 0 ? 100 : in.take<std::uint32_t>();
  command.kind = in.take<std::uint8_t>();
  if ((shape & 32) != 0) command.kind = static_cast<std::uint8_t>(command.kind % 11);
  if (command.kind == static_cast<std::uint8_t>(CommandKind::SelectGains))
    for (std::size_t i = 0; i + 1 < sizeof command.gain_set && (shape & 64) != 0; ++i) command.gain_set[i] = in.take<char>();
  command.target_pose[0] = number(in, sensible, 0.1);
  command.target_pose[1] = number(in, sensible, 0.1) + (sensible ? 0.12 : 0.0);
  command.target_pose[2] = number(in, sensible, 4.0);
  command.speed_m_s = number(in, sensible, 0.1);
  command.angular_speed_rad_s = number(in, sensible, 2.0);
  command.stop_force_n = number(in, sensible, 5.0);
  command.display = in.take<std::uint8_t>();
  if ((shape & 128) != 0) command.display = static_cast<std::uint8_t>(command.display % 3);
  return command;
}

// A controller that has come so far, to be copied for each input.
struct Start {
  std::unique_ptr<controller::FakeRig> rig = std::make_unique<controller::FakeRig>();
  explicit Start(int stage) {
    if (stage == 0) rig->tick(60);
    if (stage == 1) rig->homed();
    if (stage == 2) rig->armed();
    if (stage == 3) rig->positioned();
    if (stage == 4) rig->moving();
    drain();
  }
  void drain() {
    Sample sample;
    while (rig->mail->samples.pop(sample)) continue;
    Command command;
    while (rig->mail->commands.pop(command) || rig->mail->stops.pop(command)) continue;
    Reply reply;
    while (rig->mail->replies.pop(reply)) continue;
    Event event;
    while (rig->mail->events.pop(event)) continue;
  }
};

bool torque_free(Mode mode) { return mode == Mode::Off || mode == Mode::Ready; }

// before: the mode that this tick began with. What ends in a tick (a braked motion) has still had that tick's torque.
void check_tick(const rig::Rig& rig, const controller::Controller& controller, const hal::LinkCommand& out, Mode before) {
  const controller::Status status = controller.status();
  require(status.mode <= Mode::Fault && static_cast<std::size_t>(status.fault) < fault_count, "a mode and a fault that have names");
  require(status.fault != Fault::NotFinite, "no command makes a number infinite");
  for (std::size_t i = 0; i < out.joint_torque_nm.size(); ++i) {
    const double torque = out.joint_torque_nm[i];
    require(std::isfinite(torque), "torque is finite");
    require(std::abs(torque) <= 1.000001 * rig.actuation.joint_torque_nm(rig.actuation.peak_current_a, i), "torque is within reach");
    if (torque_free(before) && torque_free(status.mode)) require(torque == 0.0, "no torque without being armed");
  }
  if (safety::has_torque(status.mode) && status.mode != Mode::Hold) require(status.session != 0, "armed for somebody");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static std::array<Start, 5> starts{Start(0), Start(1), Start(2), Start(3), Start(4)};
  fuzz::ByteSource in(data, size);
  Start& start = starts[in.take<std::uint8_t>() % starts.size()];
  controller::FakeRig& rig = *start.rig;
  controller::Mailboxes& mail = *rig.mail;
  controller::Controller controller = *rig.controller;  // speaks through the same mailboxes
  hal::Feedback feedback = rig.feedback;
  hal::LinkCommand out = rig.out;
  std::int64_t now_ns = rig.now_ns;
  std::array<std::string_view, capacity::gain_sets> gains;
  for (std::size_t i = 0; i < rig.rig.gain_sets; ++i) gains[i] = rig.rig.gain_set[i].name.data();

  for (int step = 0; step < 4 && !in.empty(); ++step) {
    const wire::Command received = take_command(in);
    Command command{.session = 99, .id = 98};
    const ReplyCode code = wire::from_wire(received, std::span(gains).first(rig.rig.gain_sets), now_realtime_ns, command);
    if (code == ReplyCode::Accepted) {
      require(command.kind <= CommandKind::Haptic && command.display <= Display::Admittance, "an accepted command is of a known kind");
      require(command.gain_set < rig.rig.gain_sets, "an accepted gain set is there");
      (void)controller::let_in(mail, controller.status().session, command);
    } else {
      require(code == ReplyCode::WrongVersion || code == ReplyCode::Expired || code == ReplyCode::UnknownGains, "a refusal of the bridge");
    }
    const int ticks = in.take<std::uint8_t>() % 4 == 0 && !in.empty() ? 0 : 1;  // several commands may wait for one tick
    for (int tick = 0; tick < ticks; ++tick) {
      for (std::size_t i = 0; i < feedback.drive.size(); ++i) {
        feedback.drive[i].enabled = out.request == hal::DriveRequest::Enable;
        feedback.drive[i].joint_torque_nm = out.joint_torque_nm[i];
      }
      now_ns += controller::FakeRig::ms;
      const Mode before = controller.status().mode;
      out = controller.tick({now_ns, 0, &feedback});
      check_tick(rig.rig, controller, out, before);
      Reply reply;
      while (mail.replies.pop(reply))
        require(reply.code <= ReplyCode::NoModel && reply.kind <= CommandKind::Haptic && reply.mode <= Mode::Fault,
                "a reply that has a name");
      Event event;
      while (mail.events.pop(event)) require(!(std::isnan(event.value) || std::isnan(event.limit)), "events hold numbers");
    }
  }
  start.drain();
  return 0;
}
