#include "firmware/controller/controller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "common/mechanism/redundancy.hpp"

namespace trocar::controller {

using mechanism::Vec3;
using mechanism::Vec4;
using safety::Trigger;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr std::int64_t ns_per_ms = 1'000'000;
constexpr std::int64_t enable_timeout_ns = 1000 * ns_per_ms;  // a drive walks its CiA 402 states in a few tens of ms
constexpr std::int32_t rest_counts = 2;                       // encoder flicker that still counts as rest
constexpr double velocity_bandwidth_rad_s = 300.0;            // one count of 40 um disturbs the velocity by 4 mm/s
// The needle's load is measured at the base and fed forward. Its low-pass lags, so of a tissue stiffness k it leaves the positive
// damping k / bandwidth in the loop; 60 rad/s keeps that below the PID's own for k of a phantom, and the noise at 2 mN.
constexpr double load_bandwidth_rad_s = 60.0;
constexpr double longest_step_s = 0.005;           // after a stall the reference goes on slowly instead of jumping
constexpr double jump_factor = 4.0;                // motion per tick beyond this many times the velocity fault is no motion
constexpr double friction_smoothing_rad_s = 0.01;  // joint speed at which the fed-forward Coulomb friction is at 76 %

}  // namespace

Controller::Controller(const rig::Rig& rig, Mailboxes& mail, bool real_time, virtual_needle::VirtualNeedle* needle) noexcept
    : rig_(rig),
      mail_(mail),
      late_limit_ns_(1000 * static_cast<std::int64_t>(real_time ? rig.timing.late_tick_us : rig.timing.late_tick_best_effort_us)),
      needle_(rig.haptic.present ? needle : nullptr),
      hand_config_(control::force_observer_config(rig)),
      haptic_config_(control::haptic_config(rig)),
      host_(static_cast<std::int64_t>(rig.timing.host_timeout_ms) * ns_per_ms),
      enabling_(enable_timeout_ns) {}

const hal::LinkCommand& Controller::tick(const TickInput& input) noexcept {
  acquire(input);
  observe();
  take_commands();
  supervise(input);
  control();
  limit_and_send();
  follow_up();
  record(input);
  return command_;
}

void Controller::acquire(const TickInput& input) noexcept {
  const double nominal_s = 1.0 / rig_.timing.tick_hz;
  dt_s_ = started_ ? std::clamp(1e-9 * static_cast<double>(input.now_ns - now_ns_), 0.1 * nominal_s, longest_step_s) : nominal_s;
  // Whatever the schedule says: time that went back, or further ahead than a late tick explains, is no time to go on with.
  const auto nominal_ns = static_cast<std::int64_t>(1e9 * nominal_s);
  clock_jump_ns_ = started_ ? std::abs(input.now_ns - now_ns_ - nominal_ns) : 0;
  started_ = true;
  now_ns_ = input.now_ns;
  ++tick_;
  link_ = *input.link;

  if (link_.complete) {
    gap_ticks_ = missed_feedback_ + 1;
    missed_feedback_ = 0;
    bool still = true;
    for (std::size_t i = 0; i < rig_.drives(); ++i) {
      const double error_nm = std::abs(link_.drive[i].joint_torque_nm - acted_nm_[static_cast<Eigen::Index>(i)]);
      torque_error_ticks_[i] = error_nm > rig_.limits.torque_error_nm ? torque_error_ticks_[i] + 1 : 0;
      counts_[i] = link_.drive[i].position_counts;
      still = still && std::abs(std::int64_t{counts_[i]} - rest_counts_[i]) <= rest_counts;
    }
    if (still) {
      if (rest_ticks_ < rest_ticks_needed) ++rest_ticks_;
    } else {
      rest_counts_ = counts_;
      rest_ticks_ = 0;
    }
  } else {
    ++missed_feedback_;
    ++ticks_without_feedback_;
  }
  missed_sensor_ = link_.sensor.fresh ? 0 : missed_sensor_ + 1;
  if (input.wakeup_late_ns > late_limit_ns_) ++ticks_late_;
}

void Controller::observe() noexcept {
  if (!homed_) {
    pose_valid_ = false;
    return;
  }
  // Between encoder values the last pose stands; the velocity observer decays it to rest rather than guessing on.
  if (link_.complete) {
    const double rad_per_count = 2.0 * std::numbers::pi / rig_.actuation.encoder_counts_per_turn;
    for (std::size_t i = 0; i < rig_.drives(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      joint_rad_[k] = joint_offset_[k] + rad_per_count * counts_[i];
    }
    const Vec3 before = state_.x;
    const bool had_pose = pose_valid_;
    pose_valid_ = mechanism::forward(rig_.twin, joint_rad_, state_.x[2], state_) == mechanism::Status::Ok &&
                  mechanism::velocity_map(rig_.twin, state_, joint_map_) == mechanism::Status::Ok;
    pose_jump_m_ = had_pose && pose_valid_ ? std::hypot(state_.x[0] - before[0], state_.x[1] - before[1]) : 0.0;
    singularity_ = pose_valid_ ? mechanism::singularity_distance(rig_.twin, state_) : 0.0;
  }
  if (pose_valid_) {
    const control::VelocityObserverConfig config{velocity_bandwidth_rad_s};
    for (Eigen::Index i = 0; i < 3; ++i)
      velocity_[i] = control::update(config, velocity_observer_[static_cast<std::size_t>(i)], state_.x[i], dt_s_);
  }
  observe_force();
  if (needle_ != nullptr) observe_hand();
}

// What acted between the last two sets of encoder values is what was sent before the first of them; over a gap, drives go on with the last.
void Controller::observe_hand() noexcept {
  since_hand_s_ += dt_s_;
  if (!link_.complete || !pose_valid_) return;
  if (control::update(hand_config_, hand_, joint_rad_, acted_nm_, since_hand_s_) == mechanism::Status::Ok) since_hand_s_ = 0.0;
}

// The sensor sits at the needle base and turns with it; it measures what the base applies to the needle.
void Controller::observe_force() noexcept {
  if (link_.sensor.fresh) {
    const double c = std::cos(rig_.sensor.angle_rad);
    const double s = std::sin(rig_.sensor.angle_rad);
    const auto& f = link_.sensor.force_torque;
    sensor_wrench_ = {c * f[0] - s * f[1], s * f[0] + c * f[1], f[5]};
  }
  const Vec3 w = sensor_wrench_ - tare_;
  const double c = std::cos(state_.x[2]);
  const double s = std::sin(state_.x[2]);
  base_wrench_ = {c * w[0] - s * w[1], s * w[0] + c * w[1], w[2]};
  // One NaN would stay in a low-pass for ever; that it came is told by base_wrench_. What a sensor at its end says would throw the handle.
  if (base_wrench_.allFinite() && !link_.sensor.saturated)
    load_ += (1.0 - std::exp(-load_bandwidth_rad_s * dt_s_)) * (base_wrench_ - load_);
}

void Controller::check(bool violated, Fault fault, double value, double limit) noexcept {
  if (!violated) return;
  if (fault == Fault::EncoderJump || fault == Fault::Inconsistent || fault == Fault::FeedbackLost || fault == Fault::HeartbeatLost)
    counts_doubtful_ = true;
  if (fault_ == Fault::None)
    latch(fault, value, limit);
  else if (mode_ == Mode::Fault && held_ && fault != fault_)
    escalate(fault, value, limit);
}

void Controller::supervise(const TickInput& input) noexcept {
  const bool operational = link_.state == hal::LinkState::Operational;
  if (mode_ == Mode::Off && operational && link_.complete) raise(Trigger::LinkUp);
  if (mode_ == Mode::Ready && arm_command_.session == 0 && (!operational || missed_feedback_ > rig_.timing.missed_feedback_ticks)) {
    homed_ = false;  // the drives may have lost their counts with their power
    raise(Trigger::LinkDown);
  }

  bool all_enabled = true;
  for (std::size_t i = 0; i < rig_.drives(); ++i) all_enabled = all_enabled && link_.drive[i].enabled;
  if (arm_command_.session != 0 && mode_ == Mode::Ready) {
    if (all_enabled) {
      motion_.rest(state_.x);
      pid_ = {};
      gate_.last_nm = {};
      raise(Trigger::TorqueEnabled);
      reply(arm_command_.session, arm_command_.id, CommandKind::Arm, ReplyCode::Done);
      arm_command_ = {};
    } else {
      check(enabling_.expired(now_ns_) || !operational, Fault::DriveFault, 1e-9 * static_cast<double>(enabling_.age_ns(now_ns_)),
            1e-9 * static_cast<double>(enable_timeout_ns));
    }
    return;
  }
  if (mode_ == Mode::Fault) {
    // The drives may have lost their counts with their power.
    if (!operational || missed_feedback_ > rig_.timing.missed_feedback_ticks) counts_doubtful_ = true;
    if (session_ != 0 && host_.expired(now_ns_)) forget_session();  // anyone may reset what its commander left
  }
  if (!safety::has_torque(mode_) && !position_controlled()) return;

  const auto& l = rig_.limits;
  check(link_.bus_off, Fault::BusOff, 0.0, 0.0);
  check(missed_feedback_ > rig_.timing.missed_feedback_ticks, Fault::FeedbackLost, missed_feedback_, rig_.timing.missed_feedback_ticks);
  for (std::size_t i = 0; i < rig_.drives(); ++i) {
    const auto& drive = link_.drive[i];
    check(!drive.heartbeat_ok, Fault::HeartbeatLost, static_cast<double>(i + 1), 0.0);
    check(drive.faulted || drive.emcy_code != 0 || (drive.fresh && !drive.enabled), Fault::DriveFault, drive.emcy_code, 0.0);
    check(torque_error_ticks_[i] > l.torque_error_ticks, Fault::TorqueMismatch, static_cast<double>(i + 1), 0.0);
  }
  check(!operational, Fault::DriveFault, 0.0, 0.0);
  const std::int64_t late_ns = std::max(input.wakeup_late_ns, clock_jump_ns_);
  check(late_ns > late_limit_ns_, Fault::LateTick, 1e-3 * static_cast<double>(late_ns), 1e-3 * static_cast<double>(late_limit_ns_));
  check(!state_.x.allFinite() || !velocity_.allFinite() || !base_wrench_.allFinite(), Fault::NotFinite, 0.0, 0.0);
  if (link_.complete) {
    const double jump = jump_factor * l.fault_speed_m_s * dt_s_ * gap_ticks_;
    check(!pose_valid_ || pose_jump_m_ > jump, Fault::EncoderJump, pose_jump_m_, jump);
    check(std::abs(state_.residual_m) > l.residual_m, Fault::Inconsistent, state_.residual_m, l.residual_m);
    check(singularity_ < l.singularity, Fault::Singular, singularity_, l.singularity);
  }
  const double speed = velocity_.head<2>().norm();
  check(speed > l.fault_speed_m_s, Fault::VelocityLimit, speed, l.fault_speed_m_s);
  check(std::abs(velocity_[2]) > l.fault_angular_speed_rad_s, Fault::VelocityLimit, velocity_[2], l.fault_angular_speed_rad_s);
  // The reference is never outside; the handle may overshoot by what tracking allows.
  const double over = std::max({l.workspace_x_m[0] - state_.x[0], state_.x[0] - l.workspace_x_m[1], l.workspace_y_m[0] - state_.x[1],
                                state_.x[1] - l.workspace_y_m[1]});
  check(over > l.tracking_m, Fault::WorkspaceLimit, over, l.tracking_m);
  check(missed_sensor_ > rig_.timing.missed_sensor_ticks, Fault::SensorLost, missed_sensor_, rig_.timing.missed_sensor_ticks);
  check(link_.sensor.fresh && link_.sensor.saturated, Fault::SensorSaturated, 0.0, 0.0);
  const double force = base_wrench_.head<2>().norm();
  check(force > l.fault_force_n, Fault::ForceLimit, force, l.fault_force_n);
  check(std::abs(base_wrench_[2]) > l.fault_moment_nm, Fault::ForceLimit, base_wrench_[2], l.fault_moment_nm);
  if (mode_ == Mode::Haptic) {
    check(needle_->unsolved_ticks() > safety::most_unsolved_ticks, Fault::SolverNotConverged, needle_->unsolved_ticks(),
          safety::most_unsolved_ticks);
    check(control::failed(haptic_config_.guard, haptic_.guard), Fault::NotPassive, haptic_.guard.energy_j, -haptic_config_.guard.bound_j);
  }
  if (position_controlled()) {
    const Vec3 e = motion_.reference().pose - state_.x;
    check(e.head<2>().norm() > l.tracking_m, Fault::TrackingError, e.head<2>().norm(), l.tracking_m);
    check(std::abs(e[2]) > l.tracking_rad, Fault::TrackingError, e[2], l.tracking_rad);
  }
  if (fault_ == Fault::None && session_ != 0 && host_.expired(now_ns_)) {
    announce(EventKind::HostLost, mode_, mode_, 1e-9 * static_cast<double>(host_.age_ns(now_ns_)), 1e-3 * rig_.timing.host_timeout_ms);
    hold_here();
    forget_session();
  }
}

bool Controller::position_controlled() const noexcept {
  if (mode_ == Mode::Position || mode_ == Mode::Hold) return true;
  return mode_ == Mode::Fault && held_;
}

void Controller::control() noexcept {
  command_ = {};
  command_.reset_faults = reset_drives_;
  reset_drives_ = false;
  if (!pose_valid_ || (!position_controlled() && mode_ != Mode::Haptic)) {
    wrench_.setZero();
    if (mode_ == Mode::Armed || arm_command_.session != 0) command_.request = hal::DriveRequest::Enable;
    gate_.last_nm = {};
    return;
  }
  command_.request = hal::DriveRequest::Enable;
  if (mode_ == Mode::Haptic)
    control_haptic();
  else
    control_position();
}

void Controller::control_position() noexcept {
  wrench_.setZero();
  const control::Reference& reference = motion_.update(dt_s_);
  const rig::GainSet& gains = rig_.gain_set[gain_set_];
  const Vec3 error = reference.pose - state_.x;
  const Vec3 error_rate = reference.velocity - velocity_;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const rig::AxisGains& g = i < 2 ? gains.translation : gains.rotation;
    const double limit = i < 2 ? rig_.limits.command_force_n : rig_.limits.command_moment_nm;
    wrench_[i] = control::update(g, pid_[static_cast<std::size_t>(i)], error[i], error_rate[i], limit, dt_s_);
  }
  Vec4 friction = Vec4::Zero();
  if (gains.feed_forward) {
    mechanism::Mat3 M;
    mechanism::Mat3 C;
    if (mechanism::dynamics(rig_.twin, state_, reference.velocity, M, C) == mechanism::Status::Ok)
      wrench_ += M * reference.acceleration + C * reference.velocity;
    if (tared_) wrench_ += load_;
    const Vec4 joint_speed = joint_map_ * reference.velocity;
    for (Eigen::Index i = 0; i < 4; ++i)
      friction[i] = rig_.actuation.friction_coulomb_nm * std::tanh(joint_speed[i] / friction_smoothing_rad_s) +
                    rig_.actuation.friction_viscous_nm_s * joint_speed[i];
  }
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double limit = i < 2 ? rig_.limits.command_force_n : rig_.limits.command_moment_nm;
    if (std::isfinite(wrench_[i])) wrench_[i] = std::clamp(wrench_[i], -limit, limit);
  }
  send(friction);
}

bool Controller::device(control::DeviceState& device) const noexcept {
  device.pose = state_.x;
  device.velocity = hand_.estimate.handle_velocity;
  device.hand_force = hand_.estimate.wrench;
  return mechanism::dynamics(rig_.twin, state_, device.velocity, device.M, device.C) == mechanism::Status::Ok;
}

// Where the mechanism's equations fail, the last wrench stands: the supervisor sees the singularity.
void Controller::control_haptic() noexcept {
  control::DeviceState now;
  if (device(now)) {
    virtual_pose_ = control::slave_pose(haptic_config_, haptic_, now);
    virtual_wrench_ = needle_->step(virtual_pose_, dt_s_);
    wrench_ = control::update(haptic_config_, haptic_, now, virtual_wrench_, dt_s_);
  }
  Vec4 friction;
  for (Eigen::Index i = 0; i < 4; ++i)
    friction[i] = control::friction_torque_nm(hand_config_.friction[static_cast<std::size_t>(i)], hand_.estimate.joint_velocity[i]);
  send(friction);
}

void Controller::send(const Vec4& friction_nm) noexcept {
  Vec4 gear;
  for (std::size_t i = 0; i < 4; ++i) gear[static_cast<Eigen::Index>(i)] = rig_.actuation.gear_ratio[i];
  const Vec4 torque = gear.cwiseProduct(mechanism::actuator_torque(joint_map_, gear, wrench_)) + friction_nm;
  for (std::size_t i = 0; i < 4; ++i) command_.joint_torque_nm[i] = torque[static_cast<Eigen::Index>(i)];
}

void Controller::limit_and_send() noexcept {
  acted_nm_ = sent_nm_;
  sent_nm_.setZero();
  if (command_.request != hal::DriveRequest::Enable) return;
  safety::JointTorques allowed{};
  if (!safety::pass(rig_, gate_, command_.joint_torque_nm, dt_s_, allowed)) {
    check(true, Fault::NotFinite, 0.0, 0.0);
    command_.request = hal::DriveRequest::Disable;
  }
  command_.joint_torque_nm = allowed;
  for (std::size_t i = 0; i < 4; ++i) sent_nm_[static_cast<Eigen::Index>(i)] = allowed[i];
}

// Position control takes over where the handle is. Its integral begins with what the last law pushed, so that the wrench does not step.
void Controller::stand_here() noexcept {
  motion_.rest(state_.x);
  pid_ = {};
  if (mode_ != Mode::Haptic) return;
  const rig::GainSet& gains = rig_.gain_set[gain_set_];
  for (Eigen::Index i = 0; i < 3; ++i) {
    const rig::AxisGains& g = i < 2 ? gains.translation : gains.rotation;
    const double fed_forward = gains.feed_forward && tared_ ? load_[i] : 0.0;
    pid_[static_cast<std::size_t>(i)].integral = wrench_[i] - fed_forward + g.derivative * velocity_[i];
  }
}

void Controller::record(const TickInput& input) noexcept {
  Sample& s = sample_;
  s.tick = tick_;
  s.time_ns = now_ns_;
  s.mode = mode_;
  s.fault = fault_;
  s.moving = motion_.moving() ? 1 : 0;
  s.gain_set = gain_set_;
  s.command_id = last_move_id_;
  s.position_counts = counts_;
  s.joint_torque_command_nm = command_.joint_torque_nm;
  for (std::size_t i = 0; i < capacity::drives; ++i) s.joint_torque_measured_nm[i] = link_.drive[i].joint_torque_nm;
  const bool setpoint = position_controlled();
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    s.pose[i] = homed_ ? state_.x[k] : nan;
    s.velocity[i] = homed_ ? velocity_[k] : nan;
    s.setpoint_pose[i] = setpoint ? motion_.reference().pose[k] : nan;
    s.setpoint_velocity[i] = setpoint ? motion_.reference().velocity[k] : nan;
    s.wrench_command[i] = wrench_[k];
    s.base_wrench[i] = homed_ ? base_wrench_[k] : nan;
  }
  const bool haptic = mode_ == Mode::Haptic;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    s.handle_wrench[i] = haptic ? hand_.estimate.wrench[k] : nan;
    s.virtual_pose[i] = haptic ? virtual_pose_[k] : nan;
    s.virtual_wrench[i] = haptic ? virtual_wrench_[k] : nan;
  }
  s.display_energy_j = haptic ? haptic_.guard.energy_j : nan;
  s.virtual_contacts = haptic ? needle_->result().contacts : 0;
  s.virtual_status = haptic ? static_cast<std::uint8_t>(needle_->result().status) : std::uint8_t{0};
  s.residual_m = homed_ ? state_.residual_m : nan;
  s.singularity = homed_ ? singularity_ : nan;
  s.missed_feedback = missed_feedback_;
  s.wakeup_late_us = static_cast<float>(1e-3 * static_cast<double>(input.wakeup_late_ns));
  s.tick_us = 0.0F;
}

Status Controller::status() const noexcept {
  return {mode_, fault_, homed_, tared_, session_, tick_, ticks_late_, ticks_without_feedback_, gain_set_};
}

void Controller::raise(Trigger trigger) noexcept {
  const auto to = safety::next(mode_, trigger);
  if (!to) return;
  const Mode from = mode_;
  mode_ = *to;
  if (from != mode_) announce(EventKind::ModeChanged, from, mode_);
}

void Controller::latch(Fault fault, double value, double limit) noexcept {
  fault_ = fault;
  const Mode from = mode_;
  const bool controlled = position_controlled();
  if (from == Mode::Haptic) stand_here();
  raise(Trigger::FaultRaised);
  announce(EventKind::FaultLatched, from, mode_, value, limit);
  abandon_arm();
  abandon_tare();
  const auto reaction = safety::row(fault).reaction;
  motion_end_ = ReplyCode::Stopped;
  if (reaction == safety::Reaction::TorqueOff) {
    motion_.rest(state_.x);
  } else if (controlled || from == Mode::Position || from == Mode::Hold) {
    motion_.brake(rig_.limits);
  } else if (from != Mode::Haptic) {
    stand_here();
  }
  held_ = reaction != safety::Reaction::TorqueOff;
  stopping_ = held_ && (stopping_ || reaction == safety::Reaction::QuickStop);  // a stop that was asked for stays asked for
}

// A second fault while the first one's reaction keeps the torque on: the first cause stays, the severer reaction runs.
void Controller::escalate(Fault fault, double value, double limit) noexcept {
  const auto reaction = safety::row(fault).reaction;
  if (reaction == safety::Reaction::Hold || (reaction == safety::Reaction::QuickStop && stopping_)) return;
  mail_.events.push({tick_, now_ns_, EventKind::FaultLatched, mode_, mode_, fault, value, limit});
  if (reaction == safety::Reaction::TorqueOff) {
    motion_.rest(state_.x);
    held_ = false;
    stopping_ = false;
  } else {
    motion_.brake(rig_.limits);
    stopping_ = true;
  }
}

// Every command that was accepted is answered a second time, also when something else ends it.
void Controller::abandon_arm() noexcept {
  if (arm_command_.session != 0) reply(arm_command_.session, arm_command_.id, CommandKind::Arm, ReplyCode::Stopped);
  arm_command_ = {};
}

void Controller::abandon_tare() noexcept {
  if (tare_ticks_ != 0) reply(tare_command_.session, tare_command_.id, CommandKind::Tare, ReplyCode::Stopped);
  tare_ticks_ = 0;
}

void Controller::hold_here() noexcept {
  if (mode_ == Mode::Armed || mode_ == Mode::Haptic) stand_here();
  motion_end_ = ReplyCode::Stopped;
  motion_.brake(rig_.limits);
  raise(Trigger::HoldAsked);
}

void Controller::forget_session() noexcept {
  if (session_ != 0) announce(EventKind::SessionReleased, mode_, mode_);
  session_ = 0;
  abandon_arm();
}

void Controller::end_motion(ReplyCode code) noexcept {
  reply(motion_command_.session, motion_command_.id, CommandKind::Move, code);
  motion_command_ = {};
}

void Controller::reply(std::uint64_t session, std::uint32_t id, CommandKind kind, ReplyCode code) noexcept {
  mail_.replies.push({session, id, kind, code, mode_, tick_});
}

void Controller::announce(EventKind kind, Mode from, Mode to, double value, double limit) noexcept {
  mail_.events.push({tick_, now_ns_, kind, from, to, fault_, value, limit});
}

}  // namespace trocar::controller
