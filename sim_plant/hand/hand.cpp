#include "sim_plant/hand/hand.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace trocar::sim_plant {
namespace {

constexpr double tremor_damping_ratio = 0.1;  // a band of about 2 Hz

}  // namespace

HandConfig scaled(HandConfig hand, double factor) noexcept {
  for (ArmAxis* axis : {&hand.translation, &hand.rotation}) {
    axis->mass *= factor;
    axis->damping *= factor;
    axis->stiffness *= factor;
  }
  return hand;
}

Hand::Hand(const HandConfig& config, const Vector3& pose) : config_(config), random_(config.seed) { hold(pose); }

Hand::Hand(const HandConfig& config, Habit habit)
    : config_(config),
      way_(habit.way),
      recording_(std::move(habit.recording)),
      recorded_arm_(habit.recorded_arm),
      habit_(std::move(habit)),
      random_(config.seed),
      holds_(false) {}

void Hand::want(std::vector<Intention> way) {
  forget_habit();
  way_ = std::move(way);
}

void Hand::forget_habit() noexcept {
  habit_.reset();
  begin_s_ = period_s_ = 0.0;
}
void Hand::replay(std::vector<RecordedWrench> recording, const RecordedArm& arm) {
  forget_habit();
  recording_ = std::move(recording);
  recorded_arm_ = arm;
}

void Hand::notice(bool motors_on, double time_s, const Vector3& pose) noexcept {
  if (!habit_) return;
  if (motors_on && !on_) on_since_s_ = time_s;
  on_ = motors_on;
  if (!on_) let_go();
  if (!on_ || holds_ || time_s < on_since_s_ + habit_->take_after_s) return;
  hold(pose);
  begin_s_ = time_s;
  period_s_ = habit_->period_s;
  const double c = std::cos(pose[2]), s = std::sin(pose[2]);
  for (std::size_t i = 0; i < way_.size(); ++i) {
    const Vector3& to = habit_->way[i].pose;
    way_[i].pose = {pose[0] + c * to[0] - s * to[1], pose[1] + s * to[0] + c * to[1], pose[2] + to[2]};
  }
}

void Hand::hold(const Vector3& pose) noexcept {
  y_ = rest_ = pose;
  velocity_ = {};
  wrench_ = {};
  holds_ = true;
  started_ = false;
}

Hand::Vector3 Hand::wanted(double time_s) const noexcept {
  if (way_.empty()) return rest_;
  time_s -= begin_s_;
  if (time_s <= way_.front().time_s) return way_.front().pose;
  if (period_s_ > 0.0) time_s = std::fmod(time_s, period_s_);
  const auto after = std::upper_bound(way_.begin(), way_.end(), time_s, [](double t, const Intention& i) { return t < i.time_s; });
  if (after == way_.end()) return way_.back().pose;
  const Intention& a = *(after - 1);
  const Intention& b = *after;
  const double s = (time_s - a.time_s) / (b.time_s - a.time_s);
  const double part = s * s * s * (10.0 + s * (6.0 * s - 15.0));
  Vector3 pose{};
  for (std::size_t k = 0; k < 3; ++k) pose[k] = a.pose[k] + part * (b.pose[k] - a.pose[k]);
  return pose;
}

Hand::Vector3 Hand::recorded(double time_s, const Vector3& pose, const Vector3& velocity) const noexcept {
  time_s -= begin_s_;
  if (time_s < recording_.front().time_s || time_s > recording_.back().time_s) return {};
  const auto after =
      std::upper_bound(recording_.begin(), recording_.end(), time_s, [](double t, const RecordedWrench& r) { return t < r.time_s; });
  if (after == recording_.end()) return recording_.back().wrench;
  const RecordedWrench& a = *(after - 1);
  const RecordedWrench& b = *after;
  const double part = (time_s - a.time_s) / (b.time_s - a.time_s);
  Vector3 wrench{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double stiffness = k < 2 ? recorded_arm_.stiffness : recorded_arm_.turn_stiffness;
    const double damping = k < 2 ? recorded_arm_.damping : recorded_arm_.turn_damping;
    wrench[k] = std::lerp(a.wrench[k], b.wrench[k], part) + stiffness * (std::lerp(a.pose[k], b.pose[k], part) - pose[k]) +
                damping * ((b.pose[k] - a.pose[k]) / (b.time_s - a.time_s) - velocity[k]);
  }
  return wrench;
}

// White noise through x'' + 2 d w x' + w^2 x = n, stationary at that RMS: <x^2> = S / (4 d w^3), S dt the variance of n's integral.
double Hand::tremble(std::size_t axis, double rms, double dt_s) noexcept {
  if (rms == 0.0) return 0.0;
  const double w = 2.0 * std::numbers::pi * config_.tremor_hz;
  Tremor& t = tremor_[axis];
  const double kick = rms * std::sqrt(4.0 * tremor_damping_ratio * w * w * w * dt_s) * random_.normal();
  // Symplectic, damped implicitly: stable for w dt < 2.
  t.v = (t.v - w * w * t.x * dt_s + kick) / (1.0 + 2.0 * tremor_damping_ratio * w * dt_s);
  t.x += t.v * dt_s;
  return t.x;
}

const Hand::Vector3& Hand::advance(double time_s, const Vector3& pose, const Vector3& velocity, double dt_s) noexcept {
  if (!holds_) return wrench_ = {};
  if (!recording_.empty()) return wrench_ = recorded(time_s, pose, velocity);
  const Vector3 wanted_now = wanted(time_s);
  if (!started_) last_wanted_ = wanted_now;
  started_ = true;
  for (std::size_t k = 0; k < 3; ++k) {
    const ArmAxis& a = k < 2 ? config_.translation : config_.rotation;
    const double wanted_velocity = (wanted_now[k] - last_wanted_[k]) / dt_s;
    const double middle_wanted = 0.5 * (wanted_now[k] + last_wanted_[k]);
    const double middle_pose = pose[k] - 0.5 * dt_s * velocity[k];
    const double tremor = tremble(k, a.tremor, dt_s);
    // At the middle: y_m = y + dt/2 v_m with v_m = (v + v+) / 2; m (v+ - v) / dt = arm(y_m, v_m) - grip(y_m, v_m).
    const auto push = [&](double y_m, double v_m) {
      return a.stiffness * (middle_wanted - y_m) + a.damping * (wanted_velocity - v_m) + tremor;
    };
    const double h = 0.5 * dt_s;
    // What both do when the arm stands still, and their slope over v_m.
    const double grip_0 = a.grip_stiffness * (y_[k] - middle_pose) - a.grip_damping * velocity[k];
    const double grip_slope = a.grip_stiffness * h + a.grip_damping;
    const double arm_slope = a.stiffness * h + a.damping;
    double v_m = (a.mass * velocity_[k] + h * (push(y_[k], 0.0) - grip_0)) / (a.mass + h * (arm_slope + grip_slope));
    double grip = grip_0 + grip_slope * v_m;
    if (std::abs(grip) > a.largest) {
      grip = std::copysign(a.largest, grip);
      v_m = (a.mass * velocity_[k] + h * (push(y_[k], 0.0) - grip)) / (a.mass + h * arm_slope);
    }
    y_[k] += dt_s * v_m;
    velocity_[k] = 2.0 * v_m - velocity_[k];
    wrench_[k] = grip;
  }
  last_wanted_ = wanted_now;
  return wrench_;
}

}  // namespace trocar::sim_plant
