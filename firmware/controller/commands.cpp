// Commands as they come out of the mailbox: what each needs, what it starts, and the replies that come later.
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "firmware/controller/controller.hpp"

namespace trocar::controller {

using mechanism::Vec3;
using mechanism::Vec4;
using safety::Trigger;

namespace {

constexpr std::uint32_t tare_ticks = 250;  // 12.5 mN of sensor noise average to 0.8 mN
constexpr std::size_t commands_per_tick = 4;
constexpr int path_checks = 16;

}  // namespace

void Controller::take_commands() noexcept {
  Command command;
  bool stopped = false;
  for (std::size_t i = 0; i < capacity::stop_ring && mail_.stops.pop(command); ++i) {
    execute(command);
    stopped = true;
  }
  // A Stop overtakes: what was sent before it must not begin after it.
  if (stopped) {
    for (std::size_t i = 0; i < capacity::command_ring && mail_.commands.pop(command); ++i)
      if (command.kind != CommandKind::KeepAlive) reply(command.session, command.id, command.kind, ReplyCode::Stopped);
    return;
  }
  // A keep-alive costs next to nothing, and must not be late because others wait before it: only what may cost something is counted.
  std::size_t executed = 0;
  for (std::size_t i = 0; i < capacity::command_ring && executed < commands_per_tick && mail_.commands.pop(command); ++i) {
    execute(command);
    executed += command.kind == CommandKind::KeepAlive ? 0u : 1u;
  }
}

void Controller::execute(const Command& command) noexcept {
  if (session_ != 0 && command.session == session_) host_.feed(now_ns_);
  const bool mine = command.session != 0 && command.session == session_;
  ReplyCode code = ReplyCode::Accepted;
  switch (command.kind) {
    case CommandKind::KeepAlive:
      return;  // answered by silence: it comes fifty times a second
    case CommandKind::Stop:
      if (position_controlled()) {
        motion_end_ = ReplyCode::Stopped;
        motion_.brake(rig_.limits);
        stopping_ = true;
      } else if (fault_ == Fault::None) {
        raise(Trigger::TorqueOffAsked);
        forget_session();
      }
      code = ReplyCode::Done;
      break;
    case CommandKind::Hold:
      code = safety::has_torque(mode_) ? ReplyCode::Done : ReplyCode::WrongMode;
      if (safety::has_torque(mode_)) hold_here();
      break;
    case CommandKind::Home:
      code = session_ != 0 && !mine ? ReplyCode::SessionTaken : home();
      break;
    case CommandKind::Tare:
      if (session_ != 0 && !mine) {
        code = ReplyCode::SessionTaken;
      } else if (!homed_) {
        code = ReplyCode::NotHomed;
      } else if (tare_ticks_ != 0 || mode_ == Mode::Off || mode_ == Mode::Fault) {
        code = ReplyCode::WrongMode;
      } else if (motion_.moving()) {
        code = ReplyCode::NotAtRest;
      } else {
        tare_command_ = command;
        tare_ticks_ = tare_ticks;
        tare_sum_.setZero();
      }
      break;
    case CommandKind::Arm:
      code = arm(command);
      break;
    case CommandKind::Disarm:
      if (!mine) {
        code = session_ != 0 ? ReplyCode::SessionTaken : ReplyCode::NoSession;
      } else if (motion_.moving()) {
        code = ReplyCode::NotAtRest;
      } else {
        if (safety::has_torque(mode_)) raise(Trigger::TorqueOffAsked);
        held_ = false;
        forget_session();
        code = ReplyCode::Done;
      }
      break;
    case CommandKind::Move:
      code = move(command);
      break;
    case CommandKind::Haptic:
      code = begin_haptic(command);
      break;
    case CommandKind::SelectGains:
      if (session_ != 0 && !mine) {
        code = ReplyCode::SessionTaken;
      } else if (command.gain_set >= rig_.gain_sets) {
        code = ReplyCode::UnknownGains;
      } else if (motion_.moving()) {
        code = ReplyCode::NotAtRest;
      } else {
        gain_set_ = command.gain_set;
        // Bumpless: the new gains start from where the handle stands, not from the old gains' error.
        if (position_controlled() && pose_valid_) motion_.rest(state_.x);
        pid_ = {};
        code = ReplyCode::Done;
      }
      break;
    case CommandKind::ResetFault:
      code = session_ != 0 && !mine ? ReplyCode::SessionTaken : reset_fault();
      break;
    default:
      code = ReplyCode::WrongVersion;
      break;
  }
  reply(command.session, command.id, command.kind, code);
}

ReplyCode Controller::home() noexcept {
  if (mode_ != Mode::Ready || arm_command_.session != 0) return ReplyCode::WrongMode;
  if (!link_.complete || rest_ticks_ < rest_ticks_needed) return ReplyCode::NotAtRest;
  const Vec3 pose(rig_.homing_pose[0], rig_.homing_pose[1], rig_.homing_pose[2]);
  // The working mode of the linkage decides between the inverse's branches, so any starting angles will do.
  Vec4 joints;
  if (mechanism::inverse(rig_.twin, pose, Vec4::Zero(), joints) != mechanism::Status::Ok) return ReplyCode::UnreachablePose;
  const double rad_per_count = 2.0 * std::numbers::pi / rig_.actuation.encoder_counts_per_turn;
  for (std::size_t i = 0; i < rig_.drives(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    joint_offset_[k] = joints[k] - rad_per_count * counts_[i];
  }
  state_.x = pose;
  velocity_observer_ = {};
  hand_ = {};
  homed_ = true;
  pose_valid_ = false;
  tared_ = false;
  tare_.setZero();
  observe();
  announce(EventKind::Homed, mode_, mode_);
  return ReplyCode::Done;
}

ReplyCode Controller::arm(const Command& command) noexcept {
  if (command.session == 0) return ReplyCode::NoSession;
  if (session_ != 0 && command.session != session_) return ReplyCode::SessionTaken;
  if (mode_ == Mode::Hold && !stopping_) {  // the former commander is gone; take over where the handle stands
    session_ = command.session;
    host_.feed(now_ns_);
    announce(EventKind::SessionTaken, mode_, mode_);
    return ReplyCode::Done;
  }
  if (mode_ != Mode::Ready || arm_command_.session != 0) return ReplyCode::WrongMode;
  if (!homed_) return ReplyCode::NotHomed;
  if (rest_ticks_ < rest_ticks_needed || !pose_valid_) return ReplyCode::NotAtRest;
  session_ = command.session;
  host_.feed(now_ns_);
  arm_command_ = command;
  enabling_.feed(now_ns_);
  announce(EventKind::SessionTaken, mode_, mode_);
  return ReplyCode::Accepted;
}

ReplyCode Controller::move(const Command& command) noexcept {
  if (command.session == 0 || session_ == 0) return ReplyCode::NoSession;
  if (command.session != session_) return ReplyCode::SessionTaken;
  if ((mode_ != Mode::Armed && mode_ != Mode::Position && mode_ != Mode::Hold) || stopping_) return ReplyCode::WrongMode;
  if (motion_.moving() || tare_ticks_ != 0) return ReplyCode::NotAtRest;
  const Vec3 target(command.target_pose[0], command.target_pose[1], command.target_pose[2]);
  const auto& l = rig_.limits;
  const auto inside = [&](double x, double y) noexcept {
    return x >= l.workspace_x_m[0] && x <= l.workspace_x_m[1] && y >= l.workspace_y_m[0] && y <= l.workspace_y_m[1];
  };
  if (!target.allFinite() || !inside(target[0], target[1]) || !std::isfinite(command.speed_m_s) || command.speed_m_s <= 0.0 ||
      !std::isfinite(command.angular_speed_rad_s) || command.angular_speed_rad_s <= 0.0 || !std::isfinite(command.stop_force_n) ||
      command.stop_force_n < 0.0)
    return ReplyCode::OutOfRange;
  // A torque-free handle may have been moved by hand: the reference starts where it is.
  const Vec3 from = mode_ == Mode::Armed ? state_.x : motion_.reference().pose;
  if (!path_is_reachable(from, target)) return ReplyCode::UnreachablePose;
  if (mode_ == Mode::Armed) {
    motion_.rest(state_.x);
    pid_ = {};
  }
  motion_.start(target, command.speed_m_s, command.angular_speed_rad_s, l);
  motion_command_ = command;
  motion_end_ = ReplyCode::Done;
  last_move_id_ = command.id;
  raise(Trigger::MoveAccepted);
  return ReplyCode::Accepted;
}

ReplyCode Controller::begin_haptic(const Command& command) noexcept {
  if (command.session == 0 || session_ == 0) return ReplyCode::NoSession;
  if (command.session != session_) return ReplyCode::SessionTaken;
  if (!safety::has_torque(mode_) || stopping_) return ReplyCode::WrongMode;
  if (motion_.moving() || tare_ticks_ != 0 || !pose_valid_) return ReplyCode::NotAtRest;
  if (needle_ == nullptr || !needle_->ready()) return ReplyCode::NoModel;
  control::DeviceState now;
  if (!device(now)) return ReplyCode::UnreachablePose;
  haptic_config_.guard.step = one_count();
  if (mode_ == Mode::Haptic) {
    control::change(haptic_config_, haptic_, command.display, now);
  } else {
    control::enter(haptic_, command.display, now, wrench_);
    needle_->start();
  }
  raise(Trigger::HapticAccepted);
  return ReplyCode::Done;
}

// How far one count of one encoder moves the handle here, and a little.
Vec3 Controller::one_count() const noexcept {
  const double rad_per_count = 2.0 * std::numbers::pi / rig_.actuation.encoder_counts_per_turn;
  const mechanism::Mat3 squared = joint_map_.transpose() * joint_map_;
  const Eigen::Matrix<double, 3, 4> inverse = squared.inverse() * joint_map_.transpose();
  return 1.1 * rad_per_count * inverse.cwiseAbs().rowwise().maxCoeff();
}

bool Controller::path_is_reachable(const Vec3& from, const Vec3& to) noexcept {
  mechanism::TwinState at;
  Vec4 near = joint_rad_;
  for (int i = 0; i <= path_checks; ++i) {
    const Vec3 x = from + (to - from) * (static_cast<double>(i) / path_checks);
    if (mechanism::at_pose(rig_.twin, x, near, at) != mechanism::Status::Ok) return false;
    if (mechanism::singularity_distance(rig_.twin, at) < rig_.limits.singularity) return false;
    near = at.q;
  }
  return true;
}

ReplyCode Controller::reset_fault() noexcept {
  if (mode_ != Mode::Fault) return ReplyCode::WrongMode;
  // A drive keeps its fault until it is reset from here; everything else has to be gone already.
  if (link_.state != hal::LinkState::Operational || !link_.complete) return ReplyCode::StillFaulty;
  if (counts_doubtful_) homed_ = false;
  counts_doubtful_ = false;
  held_ = false;
  announce(EventKind::FaultCleared, mode_, Mode::Off);
  fault_ = Fault::None;
  stopping_ = false;
  reset_drives_ = true;
  forget_session();
  raise(Trigger::FaultReset);
  return ReplyCode::Done;
}

// Replies that come later than their command.
void Controller::follow_up() noexcept {
  if (tare_ticks_ != 0) {
    tare_sum_ += sensor_wrench_;
    if (missed_sensor_ > rig_.timing.missed_sensor_ticks || motion_.moving()) {
      abandon_tare();
    } else if (--tare_ticks_ == 0) {
      tare_ = tare_sum_ / static_cast<double>(tare_ticks);
      tared_ = true;
      announce(EventKind::Tared, mode_, mode_, tare_.head<2>().norm());
      reply(tare_command_.session, tare_command_.id, CommandKind::Tare, ReplyCode::Done);
    }
  }
  if (motion_command_.kind == CommandKind::Move) {
    if (motion_command_.stop_force_n > 0.0 && motion_.moving() && base_wrench_.head<2>().norm() > motion_command_.stop_force_n) {
      motion_command_.stop_force_n = 0.0;
      motion_end_ = ReplyCode::Stopped;
      motion_.brake(rig_.limits);
    }
    if (!motion_.moving()) end_motion(motion_end_);
  }
  if (stopping_ && !motion_.moving()) {
    stopping_ = false;
    held_ = false;
    if (fault_ == Fault::None) {
      raise(Trigger::TorqueOffAsked);
      forget_session();
    }
  }
}

}  // namespace trocar::controller
