#include "common/experiment/experiment.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace trocar::experiment {

namespace {

constexpr std::array<const char*, 7> phase_names{"prepare", "air", "touch", "insert", "dwell", "withdraw", "haptic"};
constexpr std::array<const char*, 3> display_names{"four_channel", "impedance", "admittance"};
constexpr double turn_speed_rad_s = 0.5;
constexpr double reply_timeout_s = 3.0;  // beyond what the step itself should take, twice over
constexpr std::int64_t ask_again_after_ns = 200'000'000;
constexpr double lead_s = 0.6;  // start and end of a jerk-limited move, with round trip

}  // namespace

const char* to_string(PhaseKind kind) noexcept { return phase_names[static_cast<std::size_t>(kind)]; }

std::optional<PhaseKind> phase_kind(const std::string& name) {
  for (std::size_t i = 0; i < phase_names.size(); ++i)
    if (name == phase_names[i]) return static_cast<PhaseKind>(i);
  return std::nullopt;
}

const char* to_string(Display display) noexcept { return display_names[static_cast<std::size_t>(display)]; }

std::optional<Display> display_of(const std::string& name) {
  for (std::size_t i = 0; i < display_names.size(); ++i)
    if (name == display_names[i]) return static_cast<Display>(i);
  return std::nullopt;
}

Sequencer::Sequencer(const Experiment& experiment, const Placement& placement, const rig::Rig& rig, std::uint64_t session)
    : placement_(placement), rig_(rig), session_(session) {
  planned_gains_ = rig.gain_set[0].name.data();
  planned_ = {rig.homing_pose[0], rig.homing_pose[1]};

  add_wait(PhaseKind::Prepare, "settle", 0.2);
  add(PhaseKind::Prepare, "home", CommandKind::Home, 0.1);
  add(PhaseKind::Prepare, "tare", CommandKind::Tare, 0.3);
  add(PhaseKind::Prepare, "arm", CommandKind::Arm, 0.1);

  std::visit([&](const auto& course) { add_course(course); }, experiment.course);
  add(PhaseKind::Prepare, "disarm", CommandKind::Disarm, 0.1);
  for (const Step& s : steps_) expected_total_s_ += s.expected_s;
}

void Sequencer::add_course(const InsertionCourse& e) {
  const std::size_t lanes = e.speeds_m_s.size() + (e.thesis_check ? 1 : 0);
  const auto lane_x = [&](std::size_t lane) {
    return placement_.centre_x_m + e.lane_spacing_m * (static_cast<double>(lane) - 0.5 * static_cast<double>(lanes - 1));
  };
  for (std::size_t lane = 0; lane < e.speeds_m_s.size(); ++lane) {
    const double v = e.speeds_m_s[lane];
    const double x = lane_x(lane);
    add_move(PhaseKind::Air, fmt::format("approach lane {}", lane + 1), x, -e.standoff_m, e.approach_speed_m_s);
    add_wait(PhaseKind::Prepare, "settle", 0.3);
    add(PhaseKind::Prepare, "tare", CommandKind::Tare, 0.3);
    if (lane == 0) {
      add_move(PhaseKind::Touch, "touch", x, 0.5 * e.standoff_m, e.touch_speed_m_s, e.touch_force_n);
      steps_.back().may_stop_early = steps_.back().must_stop_early = true;
      steps_.back().expected_s = e.standoff_m / e.touch_speed_m_s;
      add_move(PhaseKind::Touch, "back from touch", x, -e.standoff_m, e.withdraw_speed_m_s);
    }
    add_insertion(e, fmt::format("{:g} mm/s", 1e3 * v), x, v);
  }
  if (e.thesis_check) {
    const double x = lane_x(lanes - 1);
    add_move(PhaseKind::Air, "approach thesis lane", x, -e.standoff_m, e.approach_speed_m_s);
    add(PhaseKind::Prepare, "thesis gains", CommandKind::SelectGains, 0.1);
    for (std::size_t i = 0; i < rig_.gain_sets; ++i)
      if (std::string(rig_.gain_set[i].name.data()) == "thesis") {
        steps_.back().command.gain_set = static_cast<std::uint8_t>(i);
        planned_gains_ = "thesis";
      }
    if (planned_gains_ != "thesis")
      throw std::invalid_argument(
          fmt::format("rig {} has no gain set named thesis: add one to its file, or set thesis_check = false", rig_.name.data()));
    add_insertion(e, fmt::format("thesis gains, {:g} mm/s", 1e3 * e.thesis_speed_m_s), x, e.thesis_speed_m_s);
    add(PhaseKind::Prepare, "default gains", CommandKind::SelectGains, 0.1);
    planned_gains_ = rig_.gain_set[0].name.data();
    add_wait(PhaseKind::Prepare, "settle", 0.5);
  }
  add_move(PhaseKind::Air, "return", rig_.homing_pose[0], rig_.homing_pose[1] + placement_.needle_length_m - placement_.surface_y_m,
           e.approach_speed_m_s);
}

void Sequencer::add_course(const HapticCourse& e) {
  add_wait(PhaseKind::Prepare, "take the handle", e.take_s);
  for (const Display display : e.displays) {
    add(PhaseKind::Haptic, to_string(display), CommandKind::Haptic, e.display_s);
    Step& s = steps_.back();
    s.command.display = s.phase.display = display;
    s.wait_s = e.display_s;
  }
}

void Sequencer::add(PhaseKind kind, std::string name, CommandKind command, double expected_s) {
  Step s;
  s.phase = {std::move(name), kind, 0.0, planned_gains_, 0, 0, {}};
  s.command.session = session_;
  s.command.id = static_cast<std::uint32_t>(steps_.size() + 1);
  s.command.kind = command;
  s.expected_s = expected_s;
  steps_.push_back(std::move(s));
}

void Sequencer::add_move(PhaseKind kind, std::string name, double x_m, double tip_depth_m, double speed_m_s, double stop_force_n) {
  const double y_m = placement_.surface_y_m + tip_depth_m - placement_.needle_length_m;
  const auto& l = rig_.limits;
  if (x_m < l.workspace_x_m[0] || x_m > l.workspace_x_m[1] || y_m < l.workspace_y_m[0] || y_m > l.workspace_y_m[1])
    throw std::invalid_argument(
        fmt::format("{}: the needle base would have to go to ({:.1f}, {:.1f}) mm, outside of the workspace x {:.1f} … {:.1f}, y {:.1f} … "
                    "{:.1f} mm of rig {}: "
                    "lower depth_m or lane_spacing_m, or move the tissue",
                    name, 1e3 * x_m, 1e3 * y_m, 1e3 * l.workspace_x_m[0], 1e3 * l.workspace_x_m[1], 1e3 * l.workspace_y_m[0],
                    1e3 * l.workspace_y_m[1], rig_.name.data()));
  add(kind, std::move(name), CommandKind::Move, std::hypot(x_m - planned_[0], y_m - planned_[1]) / speed_m_s + lead_s);
  planned_ = {x_m, y_m};
  Step& s = steps_.back();
  s.phase.speed_m_s = speed_m_s;
  s.command.target_pose = {x_m, y_m, std::numbers::pi / 2.0};
  s.command.speed_m_s = speed_m_s;
  s.command.angular_speed_rad_s = turn_speed_rad_s;
  s.command.stop_force_n = stop_force_n;
}

void Sequencer::add_wait(PhaseKind kind, std::string name, double seconds) {
  add(kind, std::move(name), CommandKind::KeepAlive, seconds);
  steps_.back().wait_s = seconds;
}

void Sequencer::add_insertion(const InsertionCourse& e, const std::string& name, double x_m, double speed_m_s) {
  add_move(PhaseKind::Insert, "insert at " + name, x_m, e.depth_m, speed_m_s);
  if (e.dwell_s > 0.0) add_wait(PhaseKind::Dwell, "dwell", e.dwell_s);
  add_move(PhaseKind::Withdraw, "withdraw after " + name, x_m, -e.standoff_m, e.withdraw_speed_m_s);
}

void Sequencer::fail(std::string why) {
  if (failure_.empty()) failure_ = std::move(why);
}

void Sequencer::begin_wait() {
  waiting_ = true;
  step_start_ns_ = now_ns_;
}

void Sequencer::advance() {
  phases_.back().last_tick = now_tick_;
  done_s_ += steps_[step_].expected_s;
  ++step_;
  sent_ = waiting_ = false;
}

void Sequencer::on_reply(const Reply& reply) {
  if (finished() || !sent_ || reply.session != session_ || reply.id != steps_[step_].command.id) return;
  const Step& s = steps_[step_];
  switch (reply.code) {
    case ReplyCode::Accepted:
      return;
    case ReplyCode::Done:
      if (s.must_stop_early) {
        fail(fmt::format("{}: no force above {:g} N was felt before the end of the move: is the tissue where the scene says?", s.phase.name,
                         s.command.stop_force_n));
        return;
      }
      if (s.wait_s > 0.0) {  // counted from where the command took effect
        begin_wait();
        phases_.back().first_tick = reply.tick;
        return;
      }
      advance();
      return;
    case ReplyCode::Stopped:
      if (s.may_stop_early && mode_ == Mode::Position) {
        notes_.push_back(
            fmt::format("{}: contact felt at {:.2f} mm below the entry face of the scene", s.phase.name, 1e3 * tip_depth_m(last_)));
        advance();
        return;
      }
      // The reply may overtake the sample that names the fault: let that one tell.
      if (reply.mode == Mode::Fault && last_.mode != Mode::Fault) return;
      fail(fmt::format("{}: the rig stopped the motion (mode {}, fault {})", s.phase.name, trocar::to_string(reply.mode),
                       trocar::to_string(last_.fault)));
      return;
    case ReplyCode::NotAtRest:  // drives that were just enabled, or a handle that somebody touched, settle by themselves
      if (now_ns_ - step_start_ns_ < static_cast<std::int64_t>(1e9 * reply_timeout_s)) {
        ask_again_ns_ = now_ns_ + ask_again_after_ns;
        return;
      }
      [[fallthrough]];
    default:
      fail(fmt::format("{}: the rig refused {}: {} (mode {})", s.phase.name, trocar::to_string(reply.kind), trocar::to_string(reply.code),
                       trocar::to_string(reply.mode)));
  }
}

void Sequencer::on_sample(const Sample& sample) {
  last_ = sample;
  seen_ = true;
  mode_ = sample.mode;
  now_tick_ = sample.tick;
  now_ns_ = sample.time_ns;
  if (finished() || !sent_) return;
  const Step& s = steps_[step_];
  if (mode_ == Mode::Fault) {
    fail(fmt::format("{}: the rig latched the fault {}", s.phase.name, trocar::to_string(sample.fault)));
    return;
  }
  // Samples of before the change may come after its reply.
  if (waiting_ && s.command.kind == CommandKind::Haptic && sample.tick > phases_.back().first_tick && mode_ != Mode::Haptic) {
    fail(fmt::format("{}: the rig left Haptic for {}", s.phase.name, trocar::to_string(mode_)));
    return;
  }
  const double elapsed_s = 1e-9 * static_cast<double>(now_ns_ - step_start_ns_);
  if (waiting_) {
    if (elapsed_s >= s.wait_s) advance();
  } else if (elapsed_s > 2.0 * (s.expected_s - s.wait_s) + reply_timeout_s) {
    fail(fmt::format("{}: no answer to {} for {:.1f} s (mode {})", s.phase.name, trocar::to_string(s.command.kind), elapsed_s,
                     trocar::to_string(mode_)));
  }
}

std::optional<Command> Sequencer::next() {
  if (!finished() && ask_again_ns_ != 0 && now_ns_ >= ask_again_ns_) {
    ask_again_ns_ = 0;
    return steps_[step_].command;
  }
  if (finished() || sent_ || !seen_ || mode_ == Mode::Off) return std::nullopt;
  // A homed rig stays so, and its handle may have left the jig: homing there would shift every pose.
  if (steps_[step_].command.kind == CommandKind::Home && std::isfinite(last_.pose[0])) done_s_ += steps_[step_++].expected_s;
  sent_ = true;
  step_start_ns_ = now_ns_;
  phases_.push_back(steps_[step_].phase);
  phases_.back().first_tick = now_tick_;
  phases_.back().last_tick = now_tick_;
  const Command& command = steps_[step_].command;
  if (command.kind != CommandKind::KeepAlive) return command;
  begin_wait();
  return std::nullopt;
}

double Sequencer::progress() const noexcept {
  if (step_ == steps_.size()) return 1.0;
  double done = done_s_;
  if (sent_) done += std::min(steps_[step_].expected_s, 1e-9 * static_cast<double>(now_ns_ - step_start_ns_));
  return done / expected_total_s_;
}

const std::string& Sequencer::phase_name() const noexcept {
  static const std::string waiting = "waiting for the drives";
  static const std::string done = "done";
  if (step_ == steps_.size()) return done;
  return seen_ && mode_ != Mode::Off ? steps_[step_].phase.name : waiting;
}

double Sequencer::tip_depth_m(const Sample& sample) const noexcept {
  const auto& pose = sample.mode == Mode::Haptic ? sample.virtual_pose : sample.pose;
  return pose[1] + placement_.needle_length_m * std::sin(pose[2]) - placement_.surface_y_m;
}

double Sequencer::axial_force_n(const Sample& sample) const noexcept {
  const auto& pose = sample.mode == Mode::Haptic ? sample.virtual_pose : sample.pose;
  const auto& wrench = sample.mode == Mode::Haptic ? sample.virtual_wrench : sample.base_wrench;
  return wrench[0] * std::cos(pose[2]) + wrench[1] * std::sin(pose[2]);
}

}  // namespace trocar::experiment
