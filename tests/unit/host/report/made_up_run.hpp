// A run whose every number is known by construction: forces are straight lines in depth, errors are constants.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "host/report/report.hpp"

namespace made_up {

struct Run {
  trocar::report::RunInfo info;
  std::vector<trocar::Sample> samples;
};

struct Truth {
  double slope_n_per_m = 34.0, intercept_n = 0.085;  // insertion at the first speed; each further one adds 8 N/m
  double pull_n = -1.5;                              // withdrawal, at every depth
  double air_error_m = 20e-6, phantom_error_m = 90e-6;
  double kp_n_per_m = 800.0, friction_n = 0.4;  // thesis gains: the mechanism asks for friction on top of the base force
  double surface_y_m = 0.20, needle_m = 0.10, depth_m = 0.070;
};

class Maker {
 public:
  Maker(const Truth& truth, double angle_rad) : truth_(truth), angle_(angle_rad) {
    run.info.rig = "ubc_twin";
    run.info.scene = "phantom";
    run.info.gains = "default";
    run.info.surface_y_m = truth.surface_y_m;
    run.info.needle_length_m = truth.needle_m;
    run.info.needle_angle_rad = angle_rad;
    run.info.kp_n_per_m = truth.kp_n_per_m;
    run.info.notes = {"made up <by> a test & nothing else"};
  }

  enum class Law { None, Insert, Withdraw };
  // Along the needle from depth to depth; `error_m` is the lag behind the set point along the motion.
  void phase(const std::string& name, trocar::report::Phase::Kind kind, double speed_m_s, const std::string& gains, double from_m,
             double to_m, double dwell_s, double slope_n_per_m, Law law, double error_m) {
    const double travel_s = speed_m_s > 0.0 ? std::abs(to_m - from_m) / speed_m_s : dwell_s;
    const auto ticks = static_cast<std::uint64_t>(std::lround(1000.0 * travel_s));
    trocar::report::Phase p{name, kind, speed_m_s, gains, tick_, tick_ + ticks - 1};
    const double direction = to_m >= from_m ? 1.0 : -1.0;
    for (std::uint64_t i = 0; i < ticks; ++i) {
      const double depth = from_m + (to_m - from_m) * (static_cast<double>(i) + 0.5) / static_cast<double>(ticks);
      double force = 0.0;
      if (law == Law::Insert && depth > 0.0) force = truth_.intercept_n + slope_n_per_m * depth;
      if (law == Law::Withdraw && depth > 0.0) force = truth_.pull_n;
      sample(depth, force, direction * error_m, gains == "thesis" ? direction * truth_.friction_n : 0.0);
    }
    run.info.phases.push_back(std::move(p));
  }

  Run run;

 private:
  void sample(double depth, double force, double lag, double friction) {
    trocar::Sample s;
    const double c = std::cos(angle_), n = std::sin(angle_);
    const double tip_from_base = truth_.needle_m;
    const double along = depth - tip_from_base;  // of the base, from the point of the surface on the needle's line
    s.tick = tick_;
    s.time_ns = static_cast<std::int64_t>(tick_) * 1'000'000;
    s.mode = trocar::Mode::Position;
    s.pose = {along * c, truth_.surface_y_m + along * n, angle_};
    s.setpoint_pose = {s.pose[0] + lag * c, s.pose[1] + lag * n, angle_ + 1e-4};
    s.base_wrench = {force * c, force * n, 0.0};
    s.wrench_command = {(force + friction) * c, (force + friction) * n, 0.0};
    // 1, 2, … 1000 repeated: percentiles are known exactly.
    s.tick_us = static_cast<float>(tick_ % 1000 + 1);
    s.wakeup_late_us = 2.0f * static_cast<float>(tick_ % 1000 + 1);
    run.samples.push_back(s);
    ++tick_;
  }

  Truth truth_;
  double angle_;
  std::uint64_t tick_ = 5;
};

inline Run make(const Truth& truth = {}, double angle_rad = std::numbers::pi / 2) {
  using Kind = trocar::report::Phase::Kind;
  using Law = Maker::Law;
  Maker maker(truth, angle_rad);
  double slope = truth.slope_n_per_m;
  for (const double speed : {0.001, 0.005}) {
    const std::string name = std::to_string(static_cast<int>(1000 * speed)) + " mm/s";
    maker.phase("approach", Kind::Air, 0.02, "default", -0.03, 0.0, 0, 0, Law::None, truth.air_error_m);
    maker.phase("insert " + name, Kind::Insert, speed, "default", 0.0, truth.depth_m, 0, slope, Law::Insert, truth.phantom_error_m);
    maker.phase("dwell " + name, Kind::Dwell, 0, "default", truth.depth_m, truth.depth_m, 0.5, slope, Law::Insert, truth.phantom_error_m);
    maker.phase("withdraw " + name, Kind::Withdraw, speed, "default", truth.depth_m, -0.005, 0, slope, Law::Withdraw,
                truth.phantom_error_m);
    slope += 8.0;
  }
  const double force = truth.intercept_n + truth.slope_n_per_m * truth.depth_m;
  const double sag = (force + truth.friction_n) / truth.kp_n_per_m;
  maker.phase("thesis insert", Kind::Insert, 0.005, "thesis", 0.0, truth.depth_m, 0, truth.slope_n_per_m, Law::Insert, sag);
  maker.phase("thesis dwell", Kind::Dwell, 0, "thesis", truth.depth_m, truth.depth_m, 1.0, truth.slope_n_per_m, Law::Insert, sag);
  return std::move(maker.run);
}

// A hand that feels a virtual needle, two seconds with each of two displays: in and out on a triangle of depth, a model force of so much
// per metre, an estimate that is off by a constant, and in the second display a step of the hand's force that the estimate follows with a
// lag.
struct HapticTruth {
  double depth_m = 0.040, stiffness_n_per_m = 50.0;
  double friction_n = 0.3;        // true hand force less model force
  double estimate_error_n = 0.1;  // estimated less true hand force
  double step_n = 2.0;
  int rise_ticks = 12;  // the estimate goes through 90 % of the step so long after it
};

inline Run make_haptic(const HapticTruth& truth = {}) {
  using trocar::Sample;
  Run run;
  run.info.kind = trocar::report::RunInfo::Kind::Haptic;
  run.info.rig = "ubc_twin_haptic";
  run.info.scene = "phantom";
  run.info.gains = "default";
  run.info.surface_y_m = 0.20;
  run.info.needle_length_m = 0.10;
  std::uint64_t tick = 100;
  for (const char* display : {"impedance", "admittance"}) {
    const bool steps = std::string(display) == "admittance";
    const std::uint64_t first = tick;
    for (int i = -5; i < 2000; ++i, ++tick) {
      Sample s;
      s.tick = tick;
      s.time_ns = static_cast<std::int64_t>(tick) * 1'000'000;
      s.mode = i < 0 ? trocar::Mode::Armed : trocar::Mode::Haptic;  // the phase begins a little before the mode
      s.tick_us = 10.0f;
      s.wakeup_late_us = 20.0f;
      const double depth = truth.depth_m * (1.0 - std::abs(static_cast<double>(i) / 1000.0 - 1.0));
      s.virtual_pose = {0.0, 0.10 + depth, std::numbers::pi / 2};
      s.pose = s.virtual_pose;
      s.velocity = {0.0, i < 500 ? 0.04 : 0.0, 0.0};
      s.virtual_wrench = {0.0, truth.stiffness_n_per_m * depth, 0.0};
      double hand = s.virtual_wrench[1] + truth.friction_n, estimate = hand + truth.estimate_error_n;
      if (steps) {  // nothing but the step
        s.virtual_wrench = {};
        hand = i >= 1000 ? truth.step_n : 0.0;
        const double part = std::clamp(static_cast<double>(i - 999) / truth.rise_ticks * 0.9, 0.0, 1.0);
        estimate = part * truth.step_n;
      }
      s.handle_wrench = {0.0, estimate, 0.0};
      s.display_energy_j = 0.001 * std::cos(0.01 * i);
      s.virtual_contacts = static_cast<std::uint32_t>(depth / 0.005);
      s.virtual_status = i == 7 ? 7 : i == 8 ? 4 : 0;  // NotConverged has no solution, TipLost has one
      run.samples.push_back(s);
      run.info.truth.push_back({tick, {0.0, hand, 0.0}});
    }
    run.info.phases.push_back({display, trocar::report::Phase::Kind::Haptic, 0.0, "default", first, tick - 1});
  }
  return run;
}

}  // namespace made_up
