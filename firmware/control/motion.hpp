// A straight jerk-limited motion of the handle from one pose to another; translation and rotation start and end together.
// Config is the limits, the caller owns the object, update(dt) is the only thing that changes it.
#pragma once

#include "common/mechanism/types.hpp"
#include "common/rig/rig.hpp"
#include "firmware/control/profile.hpp"

namespace trocar::control {

struct Reference {
  mechanism::Vec3 pose = mechanism::Vec3::Zero();          // x_m, y_m, theta_rad
  mechanism::Vec3 velocity = mechanism::Vec3::Zero();      // m/s, m/s, rad/s
  mechanism::Vec3 acceleration = mechanism::Vec3::Zero();  // m/s^2, m/s^2, rad/s^2
};

class Motion {
 public:
  // Rest at `pose`.
  void rest(const mechanism::Vec3& pose) noexcept;

  // From the present reference pose (at rest) to `target`. Speeds are clamped to the limits.
  void start(const mechanism::Vec3& target, double speed_m_s, double angular_speed_rad_s, const rig::Limits& limits) noexcept;

  // Comes to rest on the same line as soon as the limits allow. No effect at rest.
  void brake(const rig::Limits& limits) noexcept;

  const Reference& update(double dt_s) noexcept;
  [[nodiscard]] const Reference& reference() const noexcept { return reference_; }
  [[nodiscard]] bool moving() const noexcept { return moving_; }

 private:
  [[nodiscard]] PathLimits path_limits(double speed_m_s, double angular_speed_rad_s, const rig::Limits& limits) const noexcept;

  mechanism::Vec3 origin_ = mechanism::Vec3::Zero();
  mechanism::Vec3 span_ = mechanism::Vec3::Zero();  // target minus origin; the path coordinate runs from 0 to 1
  Profile profile_{};
  double time_s_{};
  bool moving_{};
  Reference reference_{};
};

}  // namespace trocar::control
