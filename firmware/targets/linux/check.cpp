#include "firmware/targets/linux/check.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <numbers>
#include <string_view>

#include "common/config/user_error.hpp"
#include "common/mechanism/twin.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/targets/linux/loop.hpp"
#include "hal/can/endpoint_bus.hpp"
#include "hal/rig_link.hpp"

namespace trocar {

namespace {

constexpr double warm_up_s = 0.5;
constexpr std::uint64_t session = 1;

// A port of the loopback that takes datagrams and says nothing. What is too much for its buffer is dropped.
class Sink {
 public:
  Sink() {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (socket_ < 0 || ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) != 0 ||
        ::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw config::UserError(
          fmt::format("no UDP port on the loopback for the check: {}; bring it up (ip link set lo up)", std::strerror(errno)));
    port_ = ntohs(address.sin_port);
  }
  ~Sink() {
    if (socket_ >= 0) ::close(socket_);
  }
  Sink(const Sink&) = delete;
  Sink& operator=(const Sink&) = delete;
  [[nodiscard]] std::uint16_t port() const noexcept { return port_; }

 private:
  int socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  std::uint16_t port_{};
};

// A real link whose drives never answer, and the feedback of drives that do.
class MadeUpLink {
 public:
  MadeUpLink(const rig::Rig& rig, hal::EndpointBus& drives, hal::EndpointBus& sensor, const Sample& sample) noexcept
      : rig_(rig), link_(rig, drives, sensor), sample_(sample) {
    feedback_.state = hal::LinkState::Operational;
    feedback_.drives = rig.drives();
    feedback_.complete = true;
    feedback_.sensor.fresh = true;
    for (hal::DriveFeedback& drive : feedback_.drive) drive.fresh = drive.heartbeat_ok = true;
    stand_at(mechanism::Vec3{rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]});
  }

  void begin_tick(std::int64_t now_ns) noexcept {
    link_.begin_tick(now_ns);
    if (std::isfinite(sample_.setpoint_pose[0]))
      stand_at(mechanism::Vec3{sample_.setpoint_pose[0], sample_.setpoint_pose[1], sample_.setpoint_pose[2]});
    for (std::size_t i = 0; i < feedback_.drives; ++i) {
      feedback_.drive[i].joint_torque_nm = acting_.joint_torque_nm[i];  // what acts from a SYNC on is measured at the next
      feedback_.drive[i].enabled = command_.request == hal::DriveRequest::Enable;
    }
    acting_ = command_;
  }
  bool poll(std::int64_t now_ns) noexcept { return link_.poll(now_ns); }
  [[nodiscard]] const hal::Feedback& feedback() const noexcept { return feedback_; }
  void end_tick(std::int64_t now_ns, const hal::LinkCommand& command) noexcept {
    command_ = command;
    link_.end_tick(now_ns, command);
  }

 private:
  void stand_at(const mechanism::Vec3& pose) noexcept {
    mechanism::Vec4 joint;
    if (mechanism::inverse(rig_.twin, pose, near_, joint) != mechanism::Status::Ok) return;
    near_ = joint;
    for (std::size_t i = 0; i < feedback_.drives; ++i)
      feedback_.drive[i].position_counts = static_cast<std::int32_t>(
          std::lround(joint[static_cast<Eigen::Index>(i)] * rig_.actuation.encoder_counts_per_turn / (2.0 * std::numbers::pi)));
  }

  const rig::Rig& rig_;
  hal::RigLink<hal::EndpointBus> link_;
  const Sample& sample_;
  hal::Feedback feedback_{};
  hal::LinkCommand command_{}, acting_{};
  mechanism::Vec4 near_ = mechanism::Vec4::Zero();
};

// Does what a host would: homes, arms, and sends the handle to and fro; after a fault once more from the start.
class Commander {
 public:
  Commander(const rig::Rig& rig, controller::Mailboxes& mail) noexcept : rig_(rig), mail_(mail) {}

  void act(const controller::Status& status, const Sample& sample) noexcept {
    Reply reply;
    while (mail_.replies.pop(reply)) {
    }
    Event event;
    while (mail_.events.pop(event)) {
    }
    mail_.commands.push({.session = session, .kind = CommandKind::KeepAlive});
    constexpr std::uint64_t patience = 20;  // ticks from one command to the next
    if (status.tick < next_tick_) return;
    next_tick_ = status.tick + patience;
    if (status.mode == Mode::Fault) {
      send({.kind = CommandKind::ResetFault});
    } else if (status.mode == Mode::Ready) {
      send({.kind = status.homed ? CommandKind::Arm : CommandKind::Home});
    } else if ((status.mode == Mode::Armed || status.mode == Mode::Position || status.mode == Mode::Hold) && sample.moving == 0) {
      const auto at = [&](const std::array<double, 2>& range) { return range[0] + (far_ ? 0.7 : 0.3) * (range[1] - range[0]); };
      send({.kind = CommandKind::Move,
            .target_pose = {at(rig_.limits.workspace_x_m), at(rig_.limits.workspace_y_m), rig_.homing_pose[2] + (far_ ? 0.3 : -0.3)},
            .speed_m_s = 0.5 * rig_.limits.speed_m_s,
            .angular_speed_rad_s = 0.5 * rig_.limits.angular_speed_rad_s});
      far_ = !far_;
    }
  }

 private:
  void send(Command command) noexcept {
    command.session = session;
    command.id = ++id_;
    mail_.commands.push(command);
  }

  const rig::Rig& rig_;
  controller::Mailboxes& mail_;
  std::uint64_t next_tick_{};
  std::uint32_t id_{};
  bool far_{};
};

void open(hal::EndpointBus& bus, const Sink& sink) {
  rig::BusEndpoint endpoint;
  std::snprintf(endpoint.host.data(), endpoint.host.size(), "127.0.0.1");
  endpoint.plant_port = sink.port();  // and any port for this end
  const hal::OpenStatus status = bus.open(endpoint, hal::BusSide::Rig);
  if (status.error_number != 0) throw config::UserError(status.message.data());
}

}  // namespace

void reserve(const rig::Rig& rig, double seconds, CheckFigures& figures) {
  const auto ticks = static_cast<std::size_t>(seconds * rig.timing.tick_hz) + 1;
  for (auto* values : {&figures.wakeup_late_us, &figures.tick_us}) {
    values->assign(ticks, 0.0F);  // every page touched
    values->clear();
  }
}

void run_check(const rig::Rig& rig, double seconds, bool real_time, LoopWatch& watch, const std::atomic<bool>& stop,
               CheckFigures& figures) {
  const Sink drives_sink, sensor_sink;
  hal::EndpointBus drives, sensor;
  open(drives, drives_sink);
  open(sensor, sensor_sink);
  const auto mail = std::make_unique<controller::Mailboxes>();
  const auto controller = std::make_unique<controller::Controller>(rig, *mail, real_time);
  MadeUpLink link(rig, drives, sensor, controller->sample());
  Commander commander(rig, *mail);
  const auto warm_up = static_cast<std::uint64_t>(warm_up_s * rig.timing.tick_hz);
  const auto ticks = static_cast<std::uint64_t>(seconds * rig.timing.tick_hz);
  const float limit_us = static_cast<float>(rig.timing.late_tick_us);
  std::uint64_t overruns_before = 0;
  const std::array<int, 2> inputs{drives.file_descriptor(), sensor.file_descriptor()};
  run_loop(rig, link, inputs, *controller, watch, [&](std::uint64_t tick, const LoopCounters& loop) {
    const Sample& sample = controller->sample();
    commander.act(controller->status(), sample);
    if (tick < warm_up) {
      overruns_before = loop.overruns;
      return true;
    }
    figures.wakeup_late_us.push_back(sample.wakeup_late_us);
    figures.tick_us.push_back(sample.tick_us);
    figures.late += sample.wakeup_late_us > limit_us ? 1u : 0u;
    figures.moving += sample.mode == Mode::Position && sample.moving != 0 ? 1u : 0u;
    figures.loop = loop;
    return tick + 1 < warm_up + ticks && !stop.load(std::memory_order_relaxed);
  });
  if (stop.load()) throw config::UserError("stopped before the check was over; nothing was judged");
  figures.loop.overruns -= overruns_before;
}

std::string to_toml(const rig::Rig& rig, const hal::realtime::Setup& setup, int cpu, bool real_time, CheckFigures figures) {
  namespace rt = hal::realtime;
  constexpr std::array<const char*, rt::item_count> names{"kernel", "memory", "scheduler", "core", "timer_slack", "deep_sleep"};
  const auto literal = [](std::string_view text) {
    std::string out = "\"";
    for (const char c : text) {
      if (c == '"' || c == '\\') out += '\\';
      out += c;
    }
    return out + "\"";
  };
  std::string out = fmt::format(
      "rig = {}\nperiod_us = {}\nlate_tick_us = {}\nfeedback_deadline_us = {}\ncpu = {}\nreal_time = {}\nticks = {}\nmoving = {}\nlate = "
      "{}\n"
      "overruns = {}\nminor_faults = {}\nmajor_faults = {}\npreemptions = {}\nallocations = {}\narmed_page_faults = {}\n"
      "armed_allocations = {}\n",
      literal(rig.name.data()), 1e6 / rig.timing.tick_hz, rig.timing.late_tick_us, rig.timing.feedback_deadline_us, cpu, real_time,
      figures.tick_us.size(), figures.moving, figures.late, figures.loop.overruns, figures.loop.minor_faults, figures.loop.major_faults,
      figures.loop.preemptions, figures.loop.allocations, figures.loop.armed_page_faults, figures.loop.armed_allocations);
  const auto distribution = [&](const char* name, std::vector<float>& values) {
    std::ranges::sort(values);
    const auto rank = [&](double p) {  // nearest rank, exact in integers: 0.9999 of 10000 is the 9999th
      const auto n = static_cast<std::size_t>(std::ceil(p * static_cast<double>(values.size()) - 1e-6));
      return static_cast<double>(values[std::clamp<std::size_t>(n, 1, values.size()) - 1]);
    };
    if (values.empty()) return;
    out += fmt::format("\n[{}]\np50 = {:.1f}\np99 = {:.1f}\np99_99 = {:.1f}\nmax = {:.1f}\n", name, rank(0.50), rank(0.99), rank(0.9999),
                       static_cast<double>(values.back()));
  };
  distribution("wakeup_late_us", figures.wakeup_late_us);
  distribution("tick_us", figures.tick_us);
  for (std::size_t i = 0; i < rt::item_count; ++i) {
    const auto item = static_cast<rt::Item>(i);
    const rt::Outcome& outcome = setup.outcome(item);
    std::array<char, 256> line{};
    rt::describe(item, outcome, line);
    out += fmt::format("\n[[setup]]\nname = {}\nasked = {}\nobtained = {}\ntext = {}\n", literal(names[i]), outcome.asked, outcome.obtained,
                       literal(line.data()));
  }
  return out;
}

}  // namespace trocar
