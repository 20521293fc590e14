#include "tests/benchmarks/observer/course.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "common/mechanism/redundancy.hpp"
#include "firmware/control/velocity_observer.hpp"
#include "sim_plant/bench/bench.hpp"

namespace trocar::bench {
namespace {

using mechanism::Mat43;
using mechanism::Status;
using mechanism::Vec3;
using mechanism::Vec4;

constexpr double step_s = 5e-5;  // of the simulation
constexpr double half_range_n = 6.0;
constexpr double begin_s = 0.2;
constexpr int steps_an_axis = 12;
constexpr double between_steps_s = 0.2037;  // so that steps fall anywhere within a tick
constexpr double ramp_s = 1.0;              // 12 N/s
constexpr int ramps = 4;
constexpr double sine_hz = 2.0, sine_s = 3.0;
constexpr double moment_nm = 0.02;
constexpr double circle_m = 0.03, circle_hz = 0.5;  // of the held pose, while the hand ramps

struct Hold {
  Vec3 stiffness{800.0, 800.0, 1.0};
  Vec3 damping{12.0, 12.0, 0.02};
  double velocity_bandwidth_rad_s = 300.0;
};

struct Times {
  double steps_end = begin_s + 2 * steps_an_axis * between_steps_s;
  double ramps_end = steps_end + ramps * ramp_s;
  double end = ramps_end + sine_s;
};

int steps_done(double t) { return t < begin_s ? 0 : static_cast<int>((t - begin_s) / between_steps_s) + 1; }

Vec3 hand_at(double t) {
  const Times at;
  Vec3 hand = Vec3::Zero();
  if (t < begin_s) return hand;
  if (t < at.steps_end) {
    const int n = steps_done(t) - 1;
    hand(n < steps_an_axis ? 0 : 1) = n % 2 == 0 ? -half_range_n : half_range_n;
  } else if (t < at.ramps_end) {
    const double phase = std::fmod((t - at.steps_end) / ramp_s, 2.0);
    const double force = half_range_n * (phase < 1.0 ? 2.0 * phase - 1.0 : 3.0 - 2.0 * phase);
    hand.head<2>() = force * Eigen::Vector2d(std::cos(std::numbers::pi / 6), std::sin(std::numbers::pi / 6));
  } else {
    const double phase = 2.0 * std::numbers::pi * sine_hz * (t - at.ramps_end);
    hand = {half_range_n * std::cos(phase), half_range_n * std::sin(phase), moment_nm * std::sin(phase)};
  }
  return hand;
}

Vec3 held_pose(double t) {
  const Times at;
  Vec3 pose(0.0, 0.15, 0.5 * std::numbers::pi);
  if (t >= at.steps_end && t < at.ramps_end) {
    const double phase = 2.0 * std::numbers::pi * circle_hz * (t - at.steps_end);
    pose.x() += circle_m * std::sin(phase);
    pose.y() += circle_m * (1.0 - std::cos(phase)) * 0.5;
  }
  return pose;
}

Course empty_course(const std::string& machine, double tick_s) {
  const Times at;
  Course course;
  course.machine = machine;
  course.tick_s = tick_s;
  course.parts = {{"steps", begin_s, at.steps_end}, {"ramps", at.steps_end, at.ramps_end}, {"sine", at.ramps_end, at.end}};
  for (int n = 1; n < 2 * steps_an_axis; ++n) {
    if (n == steps_an_axis) continue;  // there the axis changes
    const double to = n % 2 == 0 ? -half_range_n : half_range_n;
    course.steps.push_back({begin_s + n * between_steps_s, n < steps_an_axis ? 0 : 1, -to, to});
  }
  return course;
}

}  // namespace

Course record(const rig::Rig& rig, const Machine& machine, double tick_s) {
  const Times at;
  Course course = empty_course(machine.name, tick_s);
  sim_plant::TwinBody body(machine.body);
  if (body.place(held_pose(0.0)) != Status::Ok) throw std::runtime_error("the handle cannot take its place");
  const Hold hold;
  const double count = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  const double most = rig.actuation.joint_torque_nm(rig.actuation.peak_current_a, 0);
  const double follow = machine.current_loop_hz > 0.0 ? -std::expm1(-2.0 * std::numbers::pi * machine.current_loop_hz * step_s) : 1.0;
  const auto per_tick = static_cast<long>(std::lround(tick_s / step_s));
  std::array<control::VelocityObserverState, 3> velocity{};
  mechanism::TwinState state;
  state.x = held_pose(0.0);
  Vec4 command = Vec4::Zero(), torque = Vec4::Zero();
  for (long n = 0; static_cast<double>(n) * tick_s < at.end; ++n) {
    const double t = static_cast<double>(n) * tick_s;
    const Vec4 angle = (body.joint_angle_rad() / count).array().round() * count;
    course.samples.push_back({t, angle, command, hand_at(t)});

    Mat43 H;
    if (mechanism::forward(rig.twin, angle, state.x(2), state) != Status::Ok || mechanism::velocity_map(rig.twin, state, H) != Status::Ok)
      throw std::runtime_error("the held handle left its workspace");
    const Vec3 error = held_pose(t) - state.x;
    Vec3 wrench;
    for (Eigen::Index i = 0; i < 3; ++i)
      wrench(i) =
          hold.stiffness(i) * error(i) -
          hold.damping(i) * control::update({hold.velocity_bandwidth_rad_s}, velocity[static_cast<std::size_t>(i)], state.x(i), tick_s);
    command = mechanism::joint_torque(H, wrench).cwiseMax(-most).cwiseMin(most);
    course.most_torque_nm = std::max(course.most_torque_nm, command.cwiseAbs().maxCoeff());
    for (long k = 0; k < per_tick; ++k) {
      torque += follow * (command - torque);
      body.step(torque, hand_at(t + (static_cast<double>(k) + 0.5) * step_s), step_s);
      course.fastest_m_s = std::max(course.fastest_m_s, body.velocity().head<2>().norm());
    }
  }
  if (body.counters().caught + body.counters().stopped > 0) throw std::runtime_error("the handle was caught or stopped");
  return course;
}

Course record_on_bus(rig::Rig rig, const sim_plant::PlantConfig& plant) {
  rig.limits.command_force_n = 14.0;
  rig.limits.command_moment_nm = 0.5;
  rig.limits.tracking_m = 0.05;
  rig.limits.tracking_rad = 1.0;
  rig.limits.fault_speed_m_s = 3.0;
  rig.limits.fault_angular_speed_rad_s = 60.0;
  const Times at;
  Course course = empty_course("on the bus", 1.0 / rig.timing.tick_hz);
  sim_plant::Bench bench(rig, plant, std::nullopt, 1);
  Command command{.session = 1};
  const auto tick = [&] {
    bench.mail().commands.push({.session = 1, .kind = CommandKind::KeepAlive});
    bench.tick();
    if (bench.sample().mode == Mode::Fault) throw std::runtime_error(std::string("the bench latched ") + to_string(bench.sample().fault));
  };
  const auto send = [&](CommandKind kind, int ticks) {
    command.kind = kind;
    ++command.id;
    bench.mail().commands.push(command);
    for (int i = 0; i < ticks; ++i) tick();
  };
  for (int i = 0; i < 1500; ++i) tick();
  const std::array<std::int32_t, 4> home_counts = bench.sample().position_counts;
  Vec4 home;
  if (mechanism::inverse(rig.twin, {rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}, Vec4::Zero(), home) != Status::Ok)
    throw std::runtime_error("the homing pose is out of reach");
  send(CommandKind::Home, 100);
  send(CommandKind::Arm, 300);
  const auto go = [&](const Vec3& pose, double speed_m_s) {
    command.target_pose = {pose[0], pose[1], pose[2]};
    command.speed_m_s = speed_m_s;
    command.angular_speed_rad_s = 1.0;
    send(CommandKind::Move, 0);
  };
  const Vec3 middle = held_pose(0.0);
  go(middle, 0.05);
  for (int i = 0; i < 2000; ++i) tick();

  const double start_s = 1e-9 * static_cast<double>(bench.now_ns());
  std::vector<sim_plant::RecordedWrench> pushes;
  for (double t = 0.0; t <= at.end; t += step_s) {
    const Vec3 w = hand_at(t);
    pushes.push_back({start_s + t, {w[0], w[1], w[2]}});
  }
  sim_plant::Hand hand(sim_plant::HandConfig{}, sim_plant::Hand::Vector3{});
  hand.replay(std::move(pushes));
  bench.plant().give_to(&hand);
  const double rad_per_count = 2.0 * std::numbers::pi / rig.actuation.encoder_counts_per_turn;
  // A torque is sent in one tick, applied by the next SYNC and has acted when the SYNC after that latches the angles.
  std::array<Vec4, 2> sent{Vec4::Zero(), Vec4::Zero()};
  int moves = 0;
  for (long n = 0; static_cast<double>(n) * course.tick_s < at.end; ++n) {
    const double t = static_cast<double>(n) * course.tick_s;
    if (t >= at.steps_end + 0.9 * moves && t < at.ramps_end) go(middle + Vec3(++moves % 2 == 1 ? circle_m : 0.0, 0.0, 0.0), 0.06);
    const Vec3 push = Vec3(hand.wrench().data());
    tick();
    Vec4 angle, told;
    for (Eigen::Index i = 0; i < 4; ++i) {
      const auto k = static_cast<std::size_t>(i);
      angle[i] = home[i] + rad_per_count * (bench.sample().position_counts[k] - home_counts[k]);
      told[i] = bench.sample().joint_torque_command_nm[k];
    }
    course.samples.push_back({t, angle, sent[0], push});
    sent = {sent[1], told};
    const auto& v = bench.plant().physics().velocity();
    course.fastest_m_s = std::max(course.fastest_m_s, std::hypot(v[0], v[1]));
    course.most_torque_nm = std::max(course.most_torque_nm, told.cwiseAbs().maxCoeff());
  }
  return course;
}

}  // namespace trocar::bench
