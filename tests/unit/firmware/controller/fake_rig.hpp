// A rig without physics: the feedback says what the test wants, and by default the handle stands exactly where it should.
#pragma once

#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/config/rig_file.hpp"
#include "common/mechanism/twin.hpp"
#include "firmware/controller/controller.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"

namespace trocar::controller {

inline rig::Rig shipped_rig(const std::string& name) {
  return config::read_rig(std::filesystem::path(TROCAR_SHARE) / "rigs" / (name + ".toml"));
}

struct FakeRig {
  static constexpr std::int64_t ms = 1'000'000;
  static constexpr std::array<std::int32_t, 4> power_on_counts{1234, -567, 8901, -23};
  static constexpr std::uint64_t host = 7;

  rig::Rig rig;
  std::unique_ptr<Mailboxes> mail = std::make_unique<Mailboxes>();
  virtual_needle::VirtualNeedle needle{};  // without a model until a test offers one
  std::unique_ptr<Controller> controller = std::make_unique<Controller>(rig, *mail, true, &needle);
  hal::Feedback feedback{};
  hal::LinkCommand out{};
  std::int64_t now_ns{};
  std::int64_t late_ns{};
  bool drives_answer = true;
  bool sensor_answers = true;
  bool drives_enable = true;  // follow the request
  bool torque_follows = true;
  double torque_error_nm{};   // that the first drive says beside the truth
  bool host_talks = true;     // a KeepAlive in every tick
  bool follows = true;        // the handle stands at the set point
  bool torque_finite = true;  // over all ticks
  mechanism::Vec3 pose{rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]};
  std::uint32_t next_id = 1;
  std::vector<Reply> replies;
  std::vector<Event> events;

  explicit FakeRig(const std::string& name = "ubc_twin") : rig(shipped_rig(name)) {
    feedback.drives = 4;
    feedback.state = hal::LinkState::Operational;
    for (auto& d : feedback.drive) d.heartbeat_ok = true;
    stand_at(pose);
  }

  void stand_at(const mechanism::Vec3& x) {
    pose = x;
    mechanism::Vec4 q;
    if (mechanism::inverse(rig.twin, x, near_, q) != mechanism::Status::Ok) return;
    near_ = q;
    for (std::size_t i = 0; i < 4; ++i)
      feedback.drive[i].position_counts =
          power_on_counts[i] + static_cast<std::int32_t>(std::lround(q[static_cast<Eigen::Index>(i)] *
                                                                     rig.actuation.encoder_counts_per_turn / (2 * std::numbers::pi)));
  }

  void tick(int n = 1) {
    for (int k = 0; k < n; ++k) {
      for (std::size_t i = 0; i < 4; ++i) feedback.drive[i].joint_torque_nm = torque_follows ? acted_nm_[i] : 0.0;
      feedback.drive[0].joint_torque_nm += torque_error_nm;
      acted_nm_ = out.joint_torque_nm;
      for (auto& d : feedback.drive) {
        d.fresh = drives_answer;
        d.enabled = drives_enable && !d.faulted && out.request == hal::DriveRequest::Enable;
      }
      feedback.complete = drives_answer;
      feedback.sensor.fresh = sensor_answers;
      if (host_talks) mail->commands.push({.session = host, .kind = CommandKind::KeepAlive});
      now_ns += ms;
      out = controller->tick({now_ns, late_ns, &feedback});
      for (const double t : out.joint_torque_nm) torque_finite = torque_finite && std::isfinite(t);
      Reply r;
      while (mail->replies.pop(r)) replies.push_back(r);
      Event e;
      while (mail->events.pop(e)) events.push_back(e);
      const Sample& s = sample();
      if (follows && std::isfinite(s.setpoint_pose[0])) stand_at({s.setpoint_pose[0], s.setpoint_pose[1], s.setpoint_pose[2]});
    }
  }

  // Sends, ticks once, and returns the code that came back in that tick.
  ReplyCode send(Command c) {
    c.id = next_id++;
    if (c.session == 0) c.session = host;
    mail->commands.push(c);
    tick();
    return answer(c.id);
  }
  ReplyCode send(CommandKind kind) { return send(Command{.kind = kind}); }
  ReplyCode send_from(std::uint64_t session, CommandKind kind) { return send(Command{.session = session, .kind = kind}); }
  ReplyCode move(double x, double y, double theta, double speed = 0.05, double angular = 1.0, double stop_force_n = 0.0) {
    return send(Command{.kind = CommandKind::Move,
                        .target_pose = {x, y, theta},
                        .speed_m_s = speed,
                        .angular_speed_rad_s = angular,
                        .stop_force_n = stop_force_n});
  }

  // First code that came for this command; the last one with `final`.
  [[nodiscard]] ReplyCode answer(std::uint32_t id, bool final = false) const {
    ReplyCode code = ReplyCode::WrongVersion;  // none of these tests expects it
    for (const Reply& r : replies)
      if (r.id == id) {
        code = r.code;
        if (!final) break;
      }
    return code;
  }
  [[nodiscard]] ReplyCode last_answer() const { return answer(next_id - 1, true); }
  [[nodiscard]] std::size_t count(EventKind kind) const {
    std::size_t n = 0;
    for (const Event& e : events) n += e.kind == kind ? 1u : 0u;
    return n;
  }

  [[nodiscard]] const Sample& sample() const { return controller->sample(); }
  [[nodiscard]] Mode mode() const { return controller->status().mode; }
  [[nodiscard]] Fault fault() const { return controller->status().fault; }
  [[nodiscard]] bool torque_free() const {
    return out.request != hal::DriveRequest::Enable && out.joint_torque_nm == std::array<double, 4>{};
  }

  FakeRig& homed() {
    tick(60);
    (void)send(CommandKind::Home);
    return *this;
  }
  FakeRig& armed() {
    homed();
    (void)send(CommandKind::Arm);
    tick(3);
    return *this;
  }
  // At rest at the end of a short move.
  FakeRig& positioned() {
    armed();
    (void)move(0.0, 0.12, pose[2]);
    tick(600);
    return *this;
  }
  FakeRig& moving() {
    positioned();
    (void)move(0.02, 0.16, pose[2] + 0.3);
    tick(200);
    return *this;
  }

 private:
  mechanism::Vec4 near_ = mechanism::Vec4::Zero();
  std::array<double, 4> acted_nm_{};
};

}  // namespace trocar::controller
