// Runs one estimator over a course and says how far its force is off and how soon it answers.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "firmware/control/force_observer.hpp"
#include "firmware/control/velocity_observer.hpp"
#include "tests/benchmarks/observer/course.hpp"

namespace trocar::bench {

// Wrench of the hand at a sample. The state lives in the function.
using Estimator = std::function<mechanism::Vec3(const Sample& sample, double dt_s)>;

// The yardstick: what one writes without an observer. Handle pose by forward kinematics, velocity by firmware/control/velocity_observer.hpp
// at the bandwidth, acceleration its difference, wrench = M x'' + C x' - H^T (tau - tau_f). (Both with the same filter on torques and
// positions, this would be the Nicosia observer as long as M does not change; plain differences with a first-order one, the momentum
// observer.)
class InverseDynamics {
 public:
  InverseDynamics(const rig::Rig& rig, double bandwidth_rad_s);
  mechanism::Vec3 update(const Sample& sample, double dt_s);

 private:
  mechanism::TwinModel model_;
  std::array<control::JointFriction, 4> friction_;
  double bandwidth_rad_s_;
  mechanism::TwinState at_{};
  std::array<control::VelocityObserverState, 3> filter_{};
  mechanism::Vec3 velocity_ = mechanism::Vec3::Zero();
};

inline const std::vector<std::string> methods{"nicosia", "momentum", "inverse"};
[[nodiscard]] Estimator estimator(const std::string& method, const rig::Rig& rig, double bandwidth_rad_s);

struct Verdict {
  // RMS of |(f_x, f_y)| of the error, N. Settled: from settled_s after a step on.
  double settled_n{}, ramps_n{}, sine_n{};
  double with_steps_n{};              // the part of the steps with their transients
  double moment_nm{};                 // RMS over ramps and sine
  double rise_s{}, slowest_rise_s{};  // to 90 % of a step of 12 N, median and worst; the tick's grid included
  [[nodiscard]] double worst_n() const;
};
inline constexpr double settled_s = 0.03;

[[nodiscard]] Verdict judge(const Course& course, const Estimator& estimate);

}  // namespace trocar::bench
