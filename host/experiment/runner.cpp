#include "host/experiment/runner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/scene/scene.hpp"
#include "host/rig/client.hpp"

namespace trocar::host {

namespace {

double steady_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

constexpr double bring_up_s = 10.0;
constexpr double silence_s = 2.0;  // no samples for this long: the rig is gone
constexpr double flight_s = 2.0;   // for a fault's flight recording to come
constexpr std::size_t p99_window = 1000;

}  // namespace

ExperimentSetup read_setup(const std::string& name, const std::vector<double>& speeds_m_s, const std::string& hand) {
  ExperimentSetup s;
  s.experiment = experiment::read_experiment(config::find_share("experiments", name));
  experiment::replace(s.experiment, speeds_m_s, hand);
  s.rig_file = config::find_share("rigs", s.experiment.rig);
  s.rig = config::read_twin(s.rig_file);
  if (s.experiment.haptic() && !s.rig.haptic.present) config::refuse_haptic(s.rig_file, "");
  s.scene_file = config::find_share("scenes", s.experiment.scene);
  const scene::Scene scene = scene::read_scene(s.scene_file);
  scene::require_insertion(scene);
  const auto entry = scene::entry_m(scene);
  s.placement = {entry[1], entry[0], scene.needle->length_m};
  for (std::size_t i = 0; i < s.rig.gain_sets; ++i)
    if (std::string(s.rig.gain_set[i].name.data()) == "thesis") s.thesis_stiffness_n_per_m = s.rig.gain_set[i].translation.proportional;
  try {  // poses that the rig cannot take are told before anything starts
    const experiment::Sequencer trial(s.experiment, s.placement, s.rig, 1);
  } catch (const std::invalid_argument& e) {
    throw config::UserError(e.what());
  }
  return s;
}

experiment::Run run_experiment(const ExperimentSetup& setup, std::uint32_t domain, const std::atomic<bool>& stop,
                               const std::function<void(const Progress&)>& show) {
  RigClient client(domain);
  const double begin = steady_s();
  const RigStatus first = client.wait_for_rig(bring_up_s);
  if (first.session != 0)
    throw config::UserError(
        fmt::format("rig {} is held by another commander (mode {}): wait until it disarms, or stop it with: trocar rig stop", first.rig,
                    to_string(first.mode)));
  if (first.rig != setup.rig.name.data())
    throw config::UserError(fmt::format("the rig on DDS domain {} is {}, the experiment wants {}: start trocar-rig --rig {}", domain,
                                        first.rig, setup.rig.name.data(), setup.rig.name.data()));

  experiment::Sequencer sequencer(setup.experiment, setup.placement, setup.rig, client.session());
  Progress progress;
  std::vector<float> ticks_us;
  ticks_us.reserve(p99_window);
  std::uint64_t first_tick = 0, last_tick = 0;
  double last_sample_s = steady_s();
  double last_show_s = 0.0;
  std::string why;  // of the last refusal or fault
  RigStatus status = first;
  bool stopped_by_user = false;
  bool flight_due = false;  // a fault's flight recording follows it after a moment
  Sample sample;

  while (!sequencer.finished()) {
    client.poll(0.005, {.sample =
                            [&](const Sample& s) {
                              if (first_tick == 0) first_tick = s.tick;
                              last_tick = s.tick;
                              last_sample_s = steady_s();
                              sample = s;
                              if (ticks_us.size() == p99_window) ticks_us.erase(ticks_us.begin(), ticks_us.begin() + p99_window / 10);
                              ticks_us.push_back(s.tick_us);
                              sequencer.on_sample(s);
                            },
                        .reply =
                            [&](const RigReply& r) {
                              if (!r.text.empty()) why = r.text;
                              sequencer.on_reply(r.reply);
                            },
                        .event =
                            [&](const RigEvent& e) {
                              if (e.event.kind == EventKind::FaultLatched && e.event.tick >= first_tick && first_tick != 0) {
                                ++progress.faults;
                                why = e.text;
                                flight_due = true;
                              }
                              if (e.event.kind == EventKind::FlightRecorded) flight_due = false;
                            },
                        .status = [&](const RigStatus& s) { status = s; }});
    client.keep_alive();
    if (auto command = sequencer.next()) client.send(*command, setup.rig.gain_set[command->gain_set].name.data());
    const double now = steady_s();
    if (stop.load()) {
      stopped_by_user = true;
      break;
    }
    if (now - last_sample_s > silence_s) {
      why = fmt::format("the rig has been silent for {:g} s", silence_s);
      break;
    }
    if (sample.mode == Mode::Off && now - begin > 2.0 * bring_up_s) {
      why = fmt::format("the drives do not become operational: {}", status.text);
      break;
    }
    if (show && now - last_show_s >= 0.1 && first_tick != 0) {
      last_show_s = now;
      progress.phase = sequencer.phase_name();
      progress.fraction = sequencer.progress();
      progress.remaining_s = (1.0 - progress.fraction) * sequencer.expected_s();
      progress.depth_mm = 1e3 * sequencer.tip_depth_m(sample);
      progress.force_n = sequencer.axial_force_n(sample);
      progress.mode = sample.mode;
      auto sorted = ticks_us;
      std::sort(sorted.begin(), sorted.end());
      progress.tick_p99_us = sorted.empty() ? 0.0 : static_cast<double>(sorted[sorted.size() * 99 / 100]);
      show(progress);
    }
  }

  experiment::Run run;
  run.experiment = setup.experiment.name;
  run.haptic = setup.experiment.haptic();
  run.rig = setup.rig.name.data();
  run.scene = setup.experiment.scene;
  run.placement = setup.placement;
  run.thesis_stiffness_n_per_m = setup.thesis_stiffness_n_per_m;
  run.simulated_s = static_cast<double>(last_tick - first_tick) / setup.rig.timing.tick_hz;
  run.wall_s = steady_s() - begin;
  run.phases = sequencer.phases();
  run.notes = sequencer.notes();
  run.completed = sequencer.finished() && !sequencer.failed();
  if (!run.completed) {
    run.outcome = stopped_by_user ? "stopped by the user" : sequencer.failed() ? sequencer.failure() : why;
    if (!stopped_by_user && sequencer.failed() && !why.empty()) run.outcome += ": " + why;
    client.send({.session = client.session(), .id = 0, .kind = CommandKind::Stop});
    client.poll(0.1, {});
    const double end = steady_s() + flight_s;
    while (flight_due && steady_s() < end)
      client.poll(0.05, {.event = [&](const RigEvent& e) { flight_due = flight_due && e.event.kind != EventKind::FlightRecorded; }});
  }
  return run;
}

}  // namespace trocar::host
