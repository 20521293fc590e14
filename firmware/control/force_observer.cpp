#include "firmware/control/force_observer.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "firmware/control/hysteresis.hpp"

namespace trocar::control {

using mechanism::Mat2;
using mechanism::Mat34;
using mechanism::Mat43;
using mechanism::Status;
using mechanism::TwinState;
using mechanism::Vec2;
using mechanism::Vec3;
using mechanism::Vec4;

namespace {

struct Linkages {
  std::array<Mat2, 2> D, C;
};

Status dynamics(const mechanism::TwinModel& model, const Vec4& angle, const Vec4& velocity, Linkages& out) noexcept {
  for (std::size_t k = 0; k < 2; ++k) {
    const auto row = static_cast<Eigen::Index>(2 * k);
    const Vec2 theta = angle.segment<2>(row), rate = velocity.segment<2>(row);
    if (const Status status = mechanism::dynamics(model.linkage[k], theta, rate, out.D[k], out.C[k]); status != Status::Ok) return status;
    if (!(out.D[k](0, 0) > 0.0 && out.D[k].determinant() > 0.0)) return Status::Singular;
  }
  return Status::Ok;
}

Vec4 friction(const ForceObserverConfig& config, const Vec4& velocity) noexcept {
  Vec4 torque;
  for (Eigen::Index i = 0; i < 4; ++i) torque(i) = friction_torque_nm(config.friction[static_cast<std::size_t>(i)], velocity(i));
  return torque;
}

template <class Part>
Vec4 each(const Linkages& linkages, const Part& part) noexcept {
  Vec4 out;
  out.head<2>() = part(linkages.D[0], linkages.C[0], Eigen::Index{0});
  out.tail<2>() = part(linkages.D[1], linkages.C[1], Eigen::Index{2});
  return out;
}

Vec4 accelerate(const Linkages& linkages, const Vec4& torque) noexcept {
  return each(linkages, [&](const Mat2& D, const Mat2&, Eigen::Index row) -> Vec2 { return D.inverse() * torque.segment<2>(row); });
}

Vec4 weigh(const Linkages& linkages, const Vec4& rate) noexcept {
  return each(linkages, [&](const Mat2& D, const Mat2&, Eigen::Index row) -> Vec2 { return D * rate.segment<2>(row); });
}

Status nicosia(const ForceObserverConfig& config, ForceObserverState& s, const Vec4& angle, const Vec4& torque, double step_s) noexcept {
  const Vec4 velocity = s.estimate.joint_velocity;
  Linkages linkages;
  if (const Status status = dynamics(config.model, 0.5 * (s.angle + angle), velocity, linkages); status != Status::Ok) return status;
  const Vec4 coriolis = each(linkages, [&](const Mat2&, const Mat2& C, Eigen::Index row) -> Vec2 { return C * velocity.segment<2>(row); });
  const Vec4 known = accelerate(linkages, torque - friction(config, velocity) - coriolis);
  const DisturbanceGains gains = disturbance_gains(config.bandwidth_rad_s, step_s);
  Vec4 unknown;
  for (std::size_t i = 0; i < 4; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const DisturbanceEstimate found = update(gains, s.joint[i], angle(row), known(row));
    unknown(row) = found.acceleration;
    s.estimate.joint_velocity(row) = found.velocity;
  }
  s.estimate.external_torque = weigh(linkages, unknown);
  return Status::Ok;
}

Status momentum(const ForceObserverConfig& config, ForceObserverState& s, const Vec4& angle, const Vec4& torque, double step_s) noexcept {
  const Vec4 velocity = (angle - s.angle) / step_s;  // in the middle of the step
  Linkages linkages;
  if (const Status status = dynamics(config.model, 0.5 * (s.angle + angle), velocity, linkages); status != Status::Ok) return status;
  const double part = -std::expm1(-config.bandwidth_rad_s * step_s);
  // Friction takes a low-passed velocity: the plain one turns with every count.
  const Vec4 smooth = s.last.low_pass_velocity + part * (velocity - s.last.low_pass_velocity);
  const Vec4 known = torque - friction(config, smooth) + each(linkages, [&](const Mat2&, const Mat2& C, Eigen::Index row) -> Vec2 {
                       return C.transpose() * velocity.segment<2>(row);
                     });
  const Vec4 amount = weigh(linkages, velocity);
  Vec4& r = s.estimate.external_torque;
  if (s.last.known) {
    const double between_s = 0.5 * (s.last.step_s + step_s);
    const Vec4 mean = (0.5 * s.last.step_s * s.last.torque + 0.5 * step_s * known) / between_s;
    r += -std::expm1(-config.bandwidth_rad_s * between_s) * ((amount - s.last.momentum) / between_s - mean - r);
  }
  // Velocity: a first-order filter that the acceleration found so far carries along, so that it does not lag.
  const Vec4 acceleration = accelerate(
      linkages, torque - friction(config, smooth) + r -
                    each(linkages, [&](const Mat2&, const Mat2& C, Eigen::Index row) -> Vec2 { return C * velocity.segment<2>(row); }));
  const Vec4 predicted = s.estimate.joint_velocity + step_s * acceleration;
  s.estimate.joint_velocity = predicted + part * (velocity + 0.5 * step_s * acceleration - predicted);
  s.last = {true, step_s, amount, known, smooth};
  return Status::Ok;
}

bool finite(const ForceObserverState& s) noexcept {
  bool all = s.estimate.wrench.allFinite() && s.estimate.joint_velocity.allFinite() && s.estimate.handle_velocity.allFinite() &&
             s.last.momentum.allFinite() && s.last.torque.allFinite() && s.last.low_pass_velocity.allFinite();
  for (const DisturbanceState& joint : s.joint) all = all && std::isfinite(joint.position) && std::isfinite(joint.velocity);
  return all;
}

Status take(const ForceObserverConfig& config, ForceObserverState& s, const Vec4& angle, const Vec4& torque, double step_s) noexcept {
  TwinState at;
  Mat43 H;
  Mat34 F;
  if (const Status status = mechanism::forward(config.model, angle, 0.0, at); status != Status::Ok) return status;
  if (const Status status = mechanism::velocity_map(config.model, at, H); status != Status::Ok) return status;
  if (const Status status = mechanism::pose_map(config.model, at, F); status != Status::Ok) return status;
  if (!s.started) {
    s = {};
    s.started = true;
    for (std::size_t i = 0; i < 4; ++i) s.joint[i] = {angle(static_cast<Eigen::Index>(i)), 0.0, true};
  } else {
    const double turning = s.estimate.handle_velocity(2);
    const Status status =
        config.kind == ObserverKind::Nicosia ? nicosia(config, s, angle, torque, step_s) : momentum(config, s, angle, torque, step_s);
    if (status != Status::Ok) return status;
    s.estimate.handle_velocity = F * s.estimate.joint_velocity;
    s.estimate.wrench = H.transpose() * s.estimate.external_torque;
    s.estimate.wrench(2) += config.spare_inertia_kg_m2 * (s.estimate.handle_velocity(2) - turning) / step_s;
  }
  s.angle = angle;
  s.gap_s = 0.0;
  return finite(s) ? Status::Ok : Status::NotFinite;
}

}  // namespace

ForceObserverConfig force_observer_config(const rig::Rig& rig, ObserverKind kind, double bandwidth_rad_s) noexcept {
  ForceObserverConfig config;
  config.kind = kind;
  config.bandwidth_rad_s = bandwidth_rad_s;
  const double count_rad = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  config.friction.fill({rig.actuation.friction_coulomb_nm, rig.actuation.friction_viscous_nm_s,
                        std::max(least_smoothing_rad_s, bandwidth_rad_s * count_rad)});
  config.play_rad = 1.001 * count_rad;
  config.model = rig.twin;
  const double share = rig.twin.handle_com_m / rig.twin.coupling_m;
  config.model.linkage[0].end_point_mass_kg += (1.0 - share) * rig.twin.handle_mass_kg;
  config.model.linkage[1].end_point_mass_kg += share * rig.twin.handle_mass_kg;
  config.model.handle_mass_kg = 0.0;
  config.model.handle_inertia_kg_m2 = 0.0;
  config.spare_inertia_kg_m2 =
      rig.twin.handle_inertia_kg_m2 - share * (1.0 - share) * rig.twin.handle_mass_kg * rig.twin.coupling_m * rig.twin.coupling_m;
  return config;
}

Status update(const ForceObserverConfig& config, ForceObserverState& state, const Vec4& angle_rad, const Vec4& torque_nm,
              double dt_s) noexcept {
  if (!(dt_s > 0.0 && std::isfinite(dt_s))) return Status::NotFinite;
  const double step_s = state.gap_s + dt_s;
  Status status = Status::NotFinite;
  if (angle_rad.allFinite() && torque_nm.allFinite()) {
    ForceObserverState next = state;
    Vec4 angle = angle_rad;
    if (state.started)
      for (Eigen::Index i = 0; i < 4; ++i) angle[i] = hysteresis(state.angle[i], angle_rad[i], config.play_rad);
    status = take(config, next, angle, torque_nm, step_s);
    if (status == Status::Ok) {
      state = next;
      return status;
    }
  }
  if (state.started) state.gap_s = step_s;
  return status;
}

const char* to_text(Admissible verdict) noexcept {
  switch (verdict) {
    case Admissible::Yes:
      return "yes";
    case Admissible::NotPositive:
      return "bandwidth, tick, counts and smoothing must be positive";
    case Admissible::NotAPose:
      return "the mechanism cannot take every pose of its workspace";
    case Admissible::TooFastForTick:
      return "too high for the tick; lower it";
    case Admissible::TooSlowForSpeed:
      return "too low for the speeds that the limits allow; raise it, or take the momentum observer";
    case Admissible::FrictionTooSteep:
      return "too low for the joints' friction; raise it, or take the momentum observer";
    case Admissible::EncoderTooCoarse:
      return "too high for the encoder; lower it, or allow more in count_force_n";
  }
  return "";
}

namespace {

constexpr int positions = 5;      // along each side of the workspace
constexpr int orientations = 12;  // of the handle
constexpr int directions = 16;    // of a speed

double largest_singular_value(const Mat2& m) noexcept {
  const double square = m.squaredNorm(), det = m.determinant();
  return std::sqrt(0.5 * (square + std::sqrt(std::max(0.0, square * square - 4.0 * det * det))));
}

// The peak is where |z-1|^2 = b/sqrt(a0), which is on the circle as long as the tick is admissible.
bool fast_enough(const DisturbanceGains& g) noexcept { return g.b <= 4.0 * std::sqrt(g.a0); }
double velocity_gain(const DisturbanceGains& g) noexcept {
  return 0.25 * g.step_s * (1.0 + g.a1 + g.a0) / std::sqrt(g.a1 * (1.0 + g.a0) - 4.0 * g.a0 + 2.0 * g.b * std::sqrt(g.a0));
}

// RMS of the acceleration found over that of white errors of position, 1/s^2: the norms, summed in closed form, of
//   Nicosia b/T^2 (z-1)^2/(z^2 - a1 z + a0),   Momentum (1-p)/T^2 (z-1)^2/(z (z-p)) with p = exp(-w T).
double noise_gain(ObserverKind kind, double bandwidth_rad_s, double tick_s) noexcept {
  if (kind == ObserverKind::Nicosia) {
    const DisturbanceGains g = disturbance_gains(bandwidth_rad_s, tick_s);
    const double above = 6.0 * (1.0 + g.a0) - 8.0 * g.a1 + 2.0 * (g.a1 * g.a1 - g.a0 * (1.0 + g.a0));
    return g.b / (tick_s * tick_s) * std::sqrt(above / ((1.0 - g.a0) * g.b * (1.0 + g.a0 + g.a1)));
  }
  const double p = std::exp(-bandwidth_rad_s * tick_s), r = -std::expm1(-bandwidth_rad_s * tick_s);
  return r / (tick_s * tick_s) * std::sqrt(1.0 + (2.0 - p) * (2.0 - p) + r * r * r / (1.0 + p));
}

struct Worst {
  double coriolis{};  // |D^-1 C|, 1/s
  double friction{};  // |D^-1 tau_f'|, 1/s
  double force{};     // N of RMS for 1 rad/s^2 of it at every joint
};

Status look(const ForceObserverConfig& config, const rig::Limits& limits, const Vec3& pose, Worst& worst) noexcept {
  TwinState at;
  Mat43 H;
  if (const Status status = mechanism::at_pose(config.model, pose, Vec4::Zero(), at); status != Status::Ok) return status;
  if (const Status status = mechanism::velocity_map(config.model, at, H); status != Status::Ok) return status;
  Linkages linkages;
  // C is linear in the speed, so |D^-1 C| is greatest at a corner of the speeds: a polygon around the circle, either way round.
  const double around = limits.fault_speed_m_s / std::cos(std::numbers::pi / directions);
  for (int k = 0; k < directions; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / directions;
    for (const double turn : {-1.0, 1.0}) {
      const Vec3 speed(around * std::cos(angle), around * std::sin(angle), turn * limits.fault_angular_speed_rad_s);
      if (const Status status = dynamics(config.model, at.q, H * speed, linkages); status != Status::Ok) return status;
      for (std::size_t i = 0; i < 2; ++i)
        worst.coriolis = std::max(worst.coriolis, largest_singular_value(linkages.D[i].inverse() * linkages.C[i]));
    }
  }
  double square = 0.0;
  for (std::size_t i = 0; i < 2; ++i) {
    const Vec2 slope(friction_slope_nm_s(config.friction[2 * i]), friction_slope_nm_s(config.friction[2 * i + 1]));
    const Mat2 steep = linkages.D[i].inverse() * slope.asDiagonal();
    worst.friction = std::max(worst.friction, largest_singular_value(steep));
    const Mat2 map = H.block<2, 2>(static_cast<Eigen::Index>(2 * i), 0).transpose() * linkages.D[i];
    square += map.squaredNorm();
  }
  worst.force = std::max(worst.force, std::sqrt(square));
  return Status::Ok;
}

}  // namespace

Admission admit(const ForceObserverConfig& config, const rig::Rig& rig, double count_force_allowed_n) noexcept {
  Admission out;
  const double w = config.bandwidth_rad_s, tick_s = 1.0 / rig.timing.tick_hz;
  const auto positive = [](double value) noexcept { return value > 0.0 && std::isfinite(value); };
  bool good = positive(w) && positive(tick_s) && rig.actuation.encoder_counts_per_turn > 0;
  for (const JointFriction& f : config.friction) good = good && (f.coulomb_nm == 0.0 || positive(f.smoothing_rad_s));
  if (!good) return {.verdict = Admissible::NotPositive};
  const DisturbanceGains gains = disturbance_gains(w, tick_s);
  if (!fast_enough(gains)) return {.verdict = Admissible::TooFastForTick};

  Worst worst;
  const auto& x = rig.limits.workspace_x_m;
  const auto& y = rig.limits.workspace_y_m;
  for (int i = 0; i < positions; ++i)
    for (int j = 0; j < positions; ++j)
      for (int k = 0; k < orientations; ++k) {
        const Vec3 pose(x[0] + (x[1] - x[0]) * i / (positions - 1), y[0] + (y[1] - y[0]) * j / (positions - 1),
                        2.0 * std::numbers::pi * k / orientations);
        if (look(config, rig.limits, pose, worst) != Status::Ok) return {.verdict = Admissible::NotAPose};
      }
  const double count_rad = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  out.count_force_n = worst.force * noise_gain(config.kind, w, tick_s) * count_rad / std::sqrt(12.0);
  if (config.kind == ObserverKind::Nicosia) {
    const double gain = velocity_gain(gains);
    out.speed_gain = 3.0 * gain * worst.coriolis;
    out.friction_gain = gain * worst.friction;
  }
  if (!(out.speed_gain < 1.0)) {
    out.verdict = Admissible::TooSlowForSpeed;
  } else if (!(out.speed_gain + out.friction_gain < 1.0)) {
    out.verdict = Admissible::FrictionTooSteep;
  } else if (!(out.count_force_n <= count_force_allowed_n)) {
    out.verdict = Admissible::EncoderTooCoarse;
  }
  return out;
}

}  // namespace trocar::control
