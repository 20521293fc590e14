#include "tests/benchmarks/realtime/course.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "common/condense/compile.hpp"
#include "common/config/rig_file.hpp"
#include "firmware/control/force_observer.hpp"
#include "sim_plant/plant/plant_file.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

constexpr std::uint64_t session = 1;
constexpr int cycles = 9;  // more than 60 s
const std::filesystem::path share(TROCAR_SHARE);

rig::Rig rig_at(double tick_hz) {
  rig::Rig rig = config::read_twin(share / "rigs/ubc_twin_haptic.toml");
  rig.timing.tick_hz = tick_hz;
  // How late the machine is, is what is measured here; it must not end the measurement.
  rig.timing.late_tick_best_effort_us = 60'000'000;
  const control::Admission admission = control::admit(rig);
  if (admission.verdict != control::Admissible::Yes)
    throw std::runtime_error(
        fmt::format("the force observer is not admissible at {} Hz: {}", tick_hz, control::to_text(admission.verdict)));
  return rig;
}

// 20 kHz, so that a period at 4 kHz is whole steps.
sim_plant::PlantConfig plant_config() {
  sim_plant::PlantConfig plant = sim_plant::read_plant(share / "plants/ubc_twin_haptic.toml");
  plant.step_hz = 20000.0;
  return plant;
}

// Nothing stands in front of the machine itself.
scene::Scene air() {
  scene::Scene scene = scene::read_scene(share / "scenes/phantom.toml");
  scene.tissue.grid->axis_m[0] = {-0.05, 0.0, 0.05};
  scene.tissue.grid->axis_m[1] = {1.0, 1.05, 1.1};
  return scene;
}

// A firm arm whose tremor never lets the handle rest.
sim_plant::HandConfig arm() {
  sim_plant::HandConfig hand = sim_plant::scaled({}, 2.0);
  hand.translation.tremor = 0.2;
  return hand;
}

std::array<double, 3> homing_pose(const rig::Rig& rig) { return {rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]}; }

}  // namespace

void compile_model(const std::filesystem::path& file) {
  condense::Options options;
  options.visible = condense::WithVisible::No;
  const condense::Compiled compiled = condense::compile_to_memory(scene::read_scene(TROCAR_REALTIME_SCENE), options);
  const auto bytes = compiled.image.span();
  std::filesystem::create_directories(file.parent_path());
  write_file(file, std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

Course::Course(double tick_hz, const model::Image& image)
    : rig_(rig_at(tick_hz)),
      period_ns_(static_cast<std::int64_t>(1e9 / tick_hz)),
      needle_({rig_.haptic.fade_s}),
      plant_(rig_, plant_config(), air(), 1),
      hand_(arm(), homing_pose(rig_)),
      gate_(rig_) {
  needle_.offer(&image);
  controller_ = std::make_unique<controller::Controller>(rig_, mail_, false, &needle_);
  feedback_.drives = rig_.drives();
  feedback_.state = hal::LinkState::Operational;
  for (auto& drive : feedback_.drive) drive.heartbeat_ok = true;
  measure();
  const int second = static_cast<int>(tick_hz);
  run(second / 2);
  send({.kind = CommandKind::Home}, 100, Mode::Ready);
  send({.kind = CommandKind::Tare}, 300, Mode::Ready);
  send({.kind = CommandKind::Arm}, 100, Mode::Armed);
  hand_.hold(plant_.pose());
  held_ = true;
  run(second / 4);
  send({.kind = CommandKind::Haptic, .display = Display::FourChannel}, second, Mode::Haptic);
  intend(plant_.pose());
}

// Base 77 to 81 mm beyond the homing pose for an arm on a spring: the tip stands some 70 mm deep. Sides change from cycle to cycle.
void Course::intend(const std::array<double, 3>& from) {
  constexpr double aside = 0.008, turned = 0.15;
  const double deep = rig_.limits.workspace_y_m[1] - 0.005;
  std::vector<sim_plant::Intention> way{{1e-9 * static_cast<double>(now_ns_), from}};
  const auto go = [&](double seconds, double x, double y, double turn) {
    way.push_back({way.back().time_s + seconds, {from[0] + x, y, from[2] + turn}});
  };
  for (int k = 0; k < cycles; ++k) {
    const double side = k % 2 == 0 ? 1.0 : -1.0;
    go(1.2, 0.0, deep, 0.0);
    go(0.8, side * aside, deep, 0.0);
    go(0.8, -side * aside, deep, 0.0);
    go(0.5, 0.0, deep - 0.004, 0.0);
    go(0.5, 0.0, deep + 0.004, 0.0);
    go(0.7, 0.0, deep, side * turned);
    go(0.7, 0.0, deep, -side * turned);
    go(0.6, 0.0, deep, 0.0);
    go(1.2, 0.0, from[1], 0.0);
    go(0.5, 0.0, from[1], 0.0);
  }
  hand_.want(std::move(way));
}

void Course::run(int ticks) noexcept {
  for (int k = 0; k < ticks; ++k) {
    const controller::TickInput input = begin(0);
    end(controller_->tick(input));
  }
}

void Course::send(Command command, int ticks, Mode expected) {
  command.session = session;
  command.id = ++id_;
  mail_.commands.push(command);
  run(ticks);
  const controller::Status status = controller_->status();
  if (status.mode != expected)
    throw std::runtime_error(fmt::format("the controller is in {} ({}) and not in {} after {}", to_string(status.mode),
                                         to_string(status.fault), to_string(expected), to_string(command.kind)));
}

controller::TickInput Course::begin(std::int64_t wakeup_late_ns) noexcept {
  mail_.commands.push({.session = session, .kind = CommandKind::KeepAlive});
  return {now_ns_, wakeup_late_ns, &feedback_};
}

void Course::end(const hal::LinkCommand& command) noexcept {
  const rig::Actuation& a = rig_.actuation;
  const std::int64_t next_ns = now_ns_ + period_ns_;
  const std::int64_t step_ns = 50'000;
  for (std::int64_t t = now_ns_ + step_ns; t <= next_ns; t += step_ns) {
    if (held_) plant_.set_hand_wrench(hand_.advance(1e-9 * static_cast<double>(t), plant_.pose(), plant_.velocity(), 1e-9 * step_ns));
    plant_.advance_to(t, acting_nm_);
  }
  now_ns_ = next_ns;
  const hal::TorqueWords words = gate_.pass(command.joint_torque_nm, command.request == hal::DriveRequest::Enable);
  for (std::size_t i = 0; i < words.size(); ++i) acting_nm_[i] = gate_.joint_torque_nm(i, words[i]) / (a.gear_ratio[i] * a.gear_efficiency);
  request_ = command.request;
  measure();
  Reply reply;
  while (mail_.replies.pop(reply)) {
  }
  Event event;
  while (mail_.events.pop(event)) {
  }
}

void Course::measure() noexcept {
  const double counts_per_rad = rig_.actuation.encoder_counts_per_turn / (2.0 * std::numbers::pi);
  const std::array<double, capacity::drives> torque = plant_.joint_torque_nm();
  for (std::size_t i = 0; i < rig_.drives(); ++i) {
    hal::DriveFeedback& drive = feedback_.drive[i];
    drive.position_counts = static_cast<std::int32_t>(std::floor(counts_per_rad * plant_.joint_angle_rad()[i]));
    drive.joint_torque_nm = torque[i];
    drive.fresh = true;
    drive.enabled = request_ == hal::DriveRequest::Enable;
  }
  feedback_.complete = true;
  feedback_.sensor.force_torque = plant_.sensor_wrench();
  feedback_.sensor.fresh = true;
}

Counts Course::counts() const noexcept {
  const insertion::Result& r = needle_.result();
  return {r.contacts, r.newton, r.iterations, r.pivots, needle_.unsolved_ticks() == 0};
}

}  // namespace trocar::bench
