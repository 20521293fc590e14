#include "firmware/control/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trocar::control {

using mechanism::Vec3;

void Motion::rest(const Vec3& pose) noexcept {
  origin_ = pose;
  span_.setZero();
  profile_ = {};
  moving_ = false;
  reference_ = {pose, Vec3::Zero(), Vec3::Zero()};
}

PathLimits Motion::path_limits(double speed_m_s, double angular_speed_rad_s, const rig::Limits& limits) const noexcept {
  const double length = std::hypot(span_[0], span_[1]);
  const double angle = std::abs(span_[2]);
  const auto slower = [&](double linear, double angular) noexcept {
    double value = std::numeric_limits<double>::infinity();
    if (length > 0.0) value = std::min(value, linear / length);
    if (angle > 0.0) value = std::min(value, angular / angle);
    return value;
  };
  return {slower(std::min(speed_m_s, limits.speed_m_s), std::min(angular_speed_rad_s, limits.angular_speed_rad_s)),
          slower(limits.acceleration_m_s2, limits.angular_acceleration_rad_s2), slower(limits.jerk_m_s3, limits.angular_jerk_rad_s3)};
}

void Motion::start(const Vec3& target, double speed_m_s, double angular_speed_rad_s, const rig::Limits& limits) noexcept {
  origin_ = reference_.pose;
  span_ = target - origin_;
  time_s_ = 0.0;
  moving_ = span_.squaredNorm() > 0.0;
  if (moving_) profile_ = Profile::rest_to_rest(1.0, path_limits(speed_m_s, angular_speed_rad_s, limits));
}

void Motion::brake(const rig::Limits& limits) noexcept {
  if (!moving_) return;
  const PathState now = profile_.at(time_s_);
  profile_ = Profile::brake(now, path_limits(limits.speed_m_s, limits.angular_speed_rad_s, limits));
  time_s_ = 0.0;
}

const Reference& Motion::update(double dt_s) noexcept {
  if (!moving_) return reference_;
  time_s_ += dt_s;
  const PathState s = profile_.at(time_s_);
  moving_ = time_s_ < profile_.duration_s();
  reference_ = {origin_ + s.position * span_, s.velocity * span_, s.acceleration * span_};
  return reference_;
}

}  // namespace trocar::control
