#include "tests/benchmarks/observer/judge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace trocar::bench {

using mechanism::Mat3;
using mechanism::Mat43;
using mechanism::Status;
using mechanism::Vec3;
using mechanism::Vec4;

InverseDynamics::InverseDynamics(const rig::Rig& rig, double bandwidth_rad_s)
    : model_(rig.twin),
      friction_(control::force_observer_config(rig, control::ObserverKind::Nicosia, bandwidth_rad_s).friction),
      bandwidth_rad_s_(bandwidth_rad_s) {}

Vec3 InverseDynamics::update(const Sample& sample, double dt_s) {
  Mat43 H;
  Mat3 M, C;
  const bool first = !filter_[0].started;
  bool good = mechanism::forward(model_, sample.angle_rad, at_.x(2), at_) == Status::Ok;
  Vec3 velocity;
  for (Eigen::Index i = 0; i < 3; ++i)
    velocity(i) = control::update({bandwidth_rad_s_}, filter_[static_cast<std::size_t>(i)], at_.x(i), dt_s);
  const Vec3 acceleration = (velocity - velocity_) / dt_s;
  velocity_ = velocity;
  good = good && mechanism::velocity_map(model_, at_, H) == Status::Ok && mechanism::dynamics(model_, at_, velocity, M, C) == Status::Ok;
  if (!good) throw std::runtime_error("the mechanism left its workspace");
  if (first) return Vec3::Zero();
  const Vec4 rate = H * velocity;
  Vec4 torque = sample.torque_nm;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    torque(row) -= control::friction_torque_nm(friction_[i], rate(row));
  }
  return M * acceleration + C * velocity - H.transpose() * torque;
}

Estimator estimator(const std::string& method, const rig::Rig& rig, double bandwidth_rad_s) {
  if (method == "inverse")
    return [inverse = InverseDynamics(rig, bandwidth_rad_s)](const Sample& sample, double dt_s) mutable {
      return inverse.update(sample, dt_s);
    };
  const auto kind = method == "nicosia" ? control::ObserverKind::Nicosia : control::ObserverKind::Momentum;
  return [config = control::force_observer_config(rig, kind, bandwidth_rad_s), state = control::ForceObserverState{}](
             const Sample& sample, double dt_s) mutable -> Vec3 {
    if (control::update(config, state, sample.angle_rad, sample.torque_nm, dt_s) != Status::Ok)
      throw std::runtime_error("the observer refuses a sample");
    return state.estimate.wrench;
  };
}

double Verdict::worst_n() const { return std::max({settled_n, ramps_n, sine_n}); }

namespace {

class Rms {
 public:
  void add(double square) { sum_ += square, ++count_; }
  [[nodiscard]] double value() const { return std::sqrt(sum_ / static_cast<double>(count_)); }

 private:
  double sum_{};
  long count_{};
};

}  // namespace

Verdict judge(const Course& course, const Estimator& estimate) {
  Rms settled, ramps, sine, with_steps, moment;
  std::vector<double> rise(course.steps.size(), std::numeric_limits<double>::infinity());
  Estimator run = estimate;
  std::size_t step = 0;  // the last one begun
  double changed_s = 0.0;
  Vec3 hand = Vec3::Zero();
  for (const Sample& sample : course.samples) {
    const Vec3 found = run(sample, course.tick_s);
    const Vec3 error = found - sample.hand;
    const double t = sample.time_s;
    if ((sample.hand - hand).norm() > 1.0) changed_s = t;
    hand = sample.hand;
    const bool in_steps = t >= course.parts[0].begin_s && t < course.parts[0].end_s;
    const bool still = t >= changed_s + settled_s;
    if (in_steps) {
      with_steps.add(error.head<2>().squaredNorm());
      if (still) settled.add(error.head<2>().squaredNorm());
    } else if (t >= course.parts[1].begin_s && still) {
      (t < course.parts[1].end_s ? ramps : sine).add(error.head<2>().squaredNorm());
      moment.add(error(2) * error(2));
    }
    while (step + 1 < course.steps.size() && course.steps[step + 1].time_s <= t) ++step;
    const Step& s = course.steps[step];
    if (t >= s.time_s && t < s.time_s + 0.15 && std::isinf(rise[step]) && (found(s.axis) - s.from_n) / (s.to_n - s.from_n) >= 0.9)
      rise[step] = t - s.time_s;
  }
  std::sort(rise.begin(), rise.end());
  return {settled.value(), ramps.value(), sine.value(), with_steps.value(), moment.value(), rise[rise.size() / 2], rise.back()};
}

}  // namespace trocar::bench
