#include "host/cli/demo.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <ctime>
#include <memory>
#include <numbers>
#include <optional>
#include <sstream>
#include <string_view>

#include "common/capture/rig_capture.hpp"
#include "common/capture/samples_csv.hpp"
#include "common/condense/compile.hpp"
#include "common/config/new_file.hpp"
#include "common/config/user_error.hpp"
#include "common/experiment/experiment_file.hpp"
#include "common/experiment/truth_file.hpp"
#include "common/scene/scene.hpp"
#include "common/wire/topics.hpp"
#include "host/cli/demo_camera.hpp"
#include "host/cli/process.hpp"
#include "host/experiment/runner.hpp"
#include "host/report/report.hpp"

namespace trocar::cli {

namespace {

constexpr double ready_s = 15.0;
constexpr double end_s = 5.0;

// One live line on a terminal; one line a phase elsewhere.
class ProgressLine {
 public:
  void show(const host::Progress& p) {
    if (!terminal_) {
      if (p.phase != phase_) fmt::print(stderr, "{:3.0f} %  {}\n", 100.0 * p.fraction, p.phase);
      phase_ = p.phase;
      return;
    }
    constexpr int width = 20;
    const auto filled = static_cast<std::size_t>(std::lround(width * p.fraction));
    const int left = static_cast<int>(p.remaining_s);
    fmt::print(
        stderr,
        "\r[{}{}] {:3.0f} %  {:<28.28} depth {:6.2f} mm  force {:6.3f} N  tick p99 {:3.0f} us  {:<8}  faults {}  {}:{:02} left \033[K",
        std::string(filled, '#'), std::string(width - filled, '.'), 100.0 * p.fraction, p.phase, p.depth_mm, p.force_n, p.tick_p99_us,
        to_string(p.mode), p.faults, left / 60, left % 60);
    std::fflush(stderr);
    shown_ = true;
  }
  void end() {
    if (shown_) fmt::print(stderr, "\n");
    shown_ = false;
  }

 private:
  bool terminal_ = isatty(STDERR_FILENO) == 1;
  bool shown_ = false;
  std::string phase_;
};

std::filesystem::path make_folder(std::filesystem::path out) {
  if (out.empty()) out = std::filesystem::path("runs") / fmt::format("{:%Y-%m-%d_%H-%M-%S}", fmt::localtime(std::time(nullptr)));
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (!error && access(out.c_str(), W_OK | X_OK) != 0) error.assign(errno, std::generic_category());
  if (error)
    throw config::UserError(
        fmt::format("{}: cannot write there ({}): give a folder that you may write to with --out", out.string(), error.message()));
  for (const char* name : {"capture.mcap", "samples.csv", "truth.csv", "model.image", "markers.csv", "run.toml", "report.html"})
    if (std::filesystem::exists(out / name))
      throw config::UserError(fmt::format("{}: holds {} of an earlier run: give another folder with --out, or none", out.string(), name));
  return out;
}

// Of a simulated run, before tissue.
std::optional<optics::SimulatedCamera> camera_of(const DemoOptions& options, const host::ExperimentSetup& setup) {
  if (!options.camera || !options.own_rig || setup.experiment.haptic() || setup.experiment.plant.empty()) return std::nullopt;
  return demo_camera(setup.experiment.plant);
}

int run_lockstep(const DemoOptions& options, const host::ExperimentSetup& setup, const std::filesystem::path& out,
                 std::atomic<bool>& stop) {
  std::vector<std::string> arguments{"--experiment", options.experiment,           "--out",     out.string(),
                                     "--seed",       std::to_string(options.seed), "--progress"};
  if (!options.speeds_mm_s.empty()) {
    arguments.push_back("--speeds");
    arguments.push_back(fmt::format("{}", fmt::join(options.speeds_mm_s, ",")));
  }
  if (!options.hand.empty()) arguments.insert(arguments.end(), {"--hand", options.hand});
  std::optional<DemoCamera> camera;
  if (const auto seen = camera_of(options, setup)) {
    camera.emplace(*seen, out);
    arguments.insert(arguments.end(), {"--camera-socket", camera->socket()});
  }
  Process bench("trocar-bench", arguments);
  if (camera) {
    bench.wait_for_line("camera at", ready_s);
    camera->start(std::nullopt);
  }
  ProgressLine line;
  std::string rest;
  std::string said;  // everything that is not progress
  while (true) {
    const std::string text = bench.read(0.1);
    if (text.empty() && !bench.running()) break;
    if (camera) camera->drain();
    if (stop.load()) bench.signal(SIGINT);
    rest += text;
    for (std::size_t end = rest.find('\n'); end != std::string::npos; end = rest.find('\n')) {
      const std::string one = rest.substr(0, end);
      rest.erase(0, end + 1);
      std::istringstream in(one);
      std::string word, mode;
      host::Progress p;
      if (in >> word >> p.fraction >> p.depth_mm >> p.force_n >> mode && word == "progress") {
        std::getline(in >> std::ws, p.phase);
        for (const Mode m : {Mode::Off, Mode::Ready, Mode::Armed, Mode::Position, Mode::Haptic, Mode::Hold, Mode::Fault})
          if (mode == to_string(m)) p.mode = m;
        line.show(p);
      } else {
        said += one + "\n";
      }
    }
  }
  line.end();
  const int code = bench.wait(end_s);
  fmt::print(stderr, "{}", said);
  const bool seen = !camera || camera->finish(false);
  return code == 0 && !seen ? 1 : code;
}

void compile_image(const std::filesystem::path& scene, const std::filesystem::path& image, const std::atomic<bool>& stop) {
  condense::Options options;
  options.visible = condense::WithVisible::No;
  options.progress = [&stop](std::string_view, double) {
    if (stop.load()) throw config::UserError("stopped by the user; nothing was run");
  };
  const auto bytes = condense::compile_to_memory(scene::read_scene(scene), options).image;
  config::NewFile file(image);
  file.stream().write(reinterpret_cast<const char*>(bytes.span().data()), static_cast<std::streamsize>(bytes.span().size()));
  file.keep();
}

int run_processes(const DemoOptions& options, const host::ExperimentSetup& setup, const std::filesystem::path& out,
                  std::atomic<bool>& stop) {
  const std::uint32_t domain = options.domain >= 0 ? static_cast<std::uint32_t>(options.domain) : setup.rig.dds_domain;
  std::optional<DemoCamera> camera;
  std::optional<Process> plant, rig, recorder;
  if (options.own_rig) {
    std::vector<std::string> plant_arguments{"--rig", setup.rig_file.string(), "--seed", std::to_string(options.seed), "--die-with-parent"};
    std::vector<std::string> rig_arguments{"--rig",         setup.rig_file.string(), "--domain", std::to_string(domain),
                                           "--best-effort", "--die-with-parent",     "--flight", (out / "flight").string()};
    if (!setup.experiment.plant.empty()) plant_arguments.insert(plant_arguments.end(), {"--plant", setup.experiment.plant});
    if (setup.experiment.haptic()) {  // the scene is the controller's model, and nothing stands in front of the machine but a person
      const auto image = out / "model.image";
      compile_image(setup.scene_file, image, stop);
      plant_arguments.insert(plant_arguments.end(), {"--no-tissue", "--hand", setup.experiment.hand});
      rig_arguments.insert(rig_arguments.end(), {"--model", image.string()});
    } else {
      plant_arguments.insert(plant_arguments.end(), {"--scene", setup.scene_file.string()});
      if (const auto seen = camera_of(options, setup)) {
        camera.emplace(*seen, out);
        plant_arguments.insert(plant_arguments.end(), {"--camera-socket", camera->socket(), "--camera-truth", camera->truth()});
      }
    }
    plant.emplace("trocar-plant", plant_arguments);
    plant->wait_for_line(", seed", ready_s);
    rig.emplace("trocar-rig", rig_arguments);
    rig->wait_for_line("DDS domain", ready_s);
    if (camera) camera->start(domain);
  }
  recorder.emplace("trocar", std::vector<std::string>{"record", "--out", (out / "capture.mcap").string(), "--domain",
                                                      std::to_string(domain), "--die-with-parent"});
  recorder->wait_for_line("recording to", ready_s);

  ProgressLine line;
  experiment::Run run;
  try {
    run = host::run_experiment(setup, domain, stop, [&](const host::Progress& p) {
      line.show(p);
      if (camera) camera->drain();
    });
  } catch (...) {
    line.end();
    recorder->signal(SIGINT);
    recorder->wait(end_s);
    std::error_code ignored;
    // Nothing was run: a recording of it would be half a result.
    camera.reset();
    if (plant) {
      plant->signal(SIGTERM);  // it removes its own unfinished files
      plant->wait(end_s);
    }
    for (const char* name : {"capture.mcap", "markers.csv", "markers.toml", "markers.jpg", "markers_truth.csv"})
      std::filesystem::remove(out / name, ignored);
    throw;
  }
  line.end();
  // The last samples are on their way: the recorder goes first only after they had time to arrive.
  (void)recorder->read(0.3);
  bool clean = true;
  const auto stop_child = [&](std::optional<Process>& child, const char* name, int number) {
    if (!child) return;
    child->signal(number);
    const int code = child->wait(end_s);
    if (code != 0) {
      clean = false;
      fmt::print(stderr, "trocar: {} ended with code {}: {}\n", name, code, child->output());
    }
  };
  stop_child(rig, "trocar-rig", SIGTERM);
  stop_child(recorder, "the recorder", SIGINT);
  if (camera && !camera->finish(true)) clean = false;
  stop_child(plant, "trocar-plant", SIGTERM);

  experiment::write_run(out, run);
  const capture::RigLog log = capture::read_capture(out / "capture.mcap");
  capture::write_samples_csv(out / "samples.csv", log.samples);
  if (!run.completed) {
    fmt::print(stderr, "trocar: the experiment did not finish: {}\n", run.outcome);
    return 1;
  }
  return clean ? 0 : 1;
}

report::Phase::Kind report_kind(experiment::PhaseKind kind) {
  using From = experiment::PhaseKind;
  using To = report::Phase::Kind;
  switch (kind) {
    case From::Air:
      return To::Air;
    case From::Touch:
      return To::Touch;
    case From::Insert:
      return To::Insert;
    case From::Dwell:
      return To::Dwell;
    case From::Withdraw:
      return To::Withdraw;
    case From::Haptic:
      return To::Haptic;
    case From::Prepare:
      return To::Other;
  }
  return To::Other;
}

void print_summary(const report::Summary& s, const std::optional<report::Eyes>& eyes) {
  for (const auto& d : s.displays) {
    if (d.ticks == 0) {
      fmt::print("{:<12} was not felt\n", d.name);
      continue;
    }
    fmt::print("{:<12} depth {:5.1f} mm, force {:6.3f} N, hand less model {:.3f} N RMS, least energy {:+.1f} mJ, {} of {} ticks unsolved\n",
               d.name, 1e3 * d.depth_m, d.force_n, d.difference.rms_n, 1e3 * d.least_energy_j, d.unsolved_ticks, d.ticks);
    if (d.observer.ticks > 0) fmt::print("{:<12} estimate less true hand {:.3f} N RMS\n", "", d.observer.rms_n);
  }
  for (const auto& i : s.insertions)
    fmt::print("{:<34} force at depth {:6.3f} N, slope {:5.1f} N/m, tracking RMS {:.3f} mm\n", i.name, i.full_depth_force_n,
               i.fit ? i.fit->slope_n_per_m : report::not_measured, 1e3 * i.insert.rms_m);
  for (const auto& g : s.tracking) {
    if (g.air.ticks > 0) fmt::print("tracking RMS in the air, {:<9} {:.3f} mm\n", g.gain_set, 1e3 * g.air.rms_m);
    if (g.phantom.ticks > 0) fmt::print("tracking RMS in phantom, {:<9} {:.3f} mm\n", g.gain_set, 1e3 * g.phantom.rms_m);
  }
  for (const auto& g : s.sags)
    fmt::print("sag, {:<29} {:.2f} mm; F/Kp is {:.2f} mm for the {:.2f} N at the base, {:.2f} mm with the friction of the mechanism\n",
               g.phase, 1e3 * g.error_m, 1e3 * g.expected_m, g.force_n, 1e3 * g.expected_command_m);
  if (s.tick_us.count > 0)
    fmt::print("tick p50 {:.0f} us, p99 {:.0f} us, p99.99 {:.0f} us; wake-up late p50 {:.0f} us, p99 {:.0f} us, p99.99 {:.0f} us\n",
               s.tick_us.p50, s.tick_us.p99, s.tick_us.p99_99, s.wakeup_late_us.p50, s.wakeup_late_us.p99, s.wakeup_late_us.p99_99);
  if (eyes)
    fmt::print("camera: {} frames of {} markers, {} lost, {} dropped, {} of {} places not seen{}; tracked in {:.1f} ms a frame\n",
               eyes->frames, eyes->markers, eyes->lost, eyes->dropped, eyes->not_seen, eyes->frames * eyes->markers,
               eyes->error ? fmt::format(", off by {:.3f} px and {:.1f} um RMS", eyes->error->rms_px, 1e6 * eyes->error->rms_m) : "",
               1e3 * eyes->track_s_p50);
  fmt::print("{} samples, {} lost, {} ticks without feedback, faults: {}\n", s.samples, s.lost_ticks, s.ticks_without_feedback,
             s.faults.empty() ? "none" : fmt::format("{}", fmt::join(s.faults, ", ")));
}

}  // namespace

int make_report(const std::filesystem::path& folder, bool json) {
  const experiment::Run run = experiment::read_run(folder);
  const capture::RigLog log = capture::read_capture(folder / "capture.mcap");
  if (log.samples.empty()) throw config::UserError(fmt::format("{}: the capture holds no samples: nothing to report", folder.string()));
  report::RunInfo info;
  info.folder = folder;
  info.rig = run.rig;
  info.scene = run.scene;
  info.kind = run.haptic ? report::RunInfo::Kind::Haptic : report::RunInfo::Kind::Insertion;
  info.lockstep = run.lockstep;
  info.surface_y_m = run.placement.surface_y_m;
  info.needle_length_m = run.placement.needle_length_m;
  info.kp_n_per_m = run.thesis_stiffness_n_per_m;
  info.notes = run.notes;
  if (log.machine && !run.lockstep) info.machine = {log.machine->text, log.machine->real_time, log.machine->loop};
  info.gains = run.phases.empty() ? "" : run.phases.front().gain_set;
  double insertion_speed_m_s = 0.0;  // a withdrawal belongs to the insertion before it, whatever its own speed
  for (const auto& p : run.phases) {
    if (p.kind == experiment::PhaseKind::Insert) insertion_speed_m_s = p.speed_m_s;
    const bool back = p.kind == experiment::PhaseKind::Withdraw && insertion_speed_m_s > 0.0;
    info.phases.push_back({p.name, report_kind(p.kind), back ? insertion_speed_m_s : p.speed_m_s, p.gain_set, p.first_tick, p.last_tick});
  }
  if (std::filesystem::exists(folder / "truth.csv"))
    for (const experiment::Truth& t : experiment::read_truth(folder / "truth.csv")) info.truth.push_back({t.tick, t.hand_wrench});
  info.eyes = report::read_eyes(folder);
  if (!run.completed) info.notes.push_back("the experiment did not finish: " + run.outcome);
  for (const capture::EventRecord& e : log.events) {
    // A recording of before this run is still sent to whoever comes late.
    if (e.event.kind != EventKind::FlightRecorded || e.event.tick < log.samples.front().tick) continue;
    info.notes.push_back(fmt::format("flight recording of {} at tick {}: in capture.mcap on {}, and {}{}", to_string(e.event.fault),
                                     e.event.tick, wire::flight_topic.name, e.event.value > 0 ? "in " : "not on disk: ", e.text));
  }
  if (run.lockstep)
    info.notes.push_back(
        fmt::format("{:.1f} s simulated in {:.1f} s, {:.1f} times real time", run.simulated_s, run.wall_s, run.simulated_s / run.wall_s));
  const report::Summary summary = report::summarise(info, log.samples);
  report::write_report(info, summary, log.samples);
  if (json) {
    fmt::print("{}\n", report::to_json(info, summary));
  } else {
    print_summary(summary, info.eyes);
    fmt::print("report: {}\n", (folder / "report.html").string());
  }
  return 0;
}

int run_demo(const DemoOptions& options, std::atomic<bool>& stop) {
  std::vector<double> speeds;
  for (const double v : options.speeds_mm_s) speeds.push_back(1e-3 * v);
  const host::ExperimentSetup setup = host::read_setup(options.experiment, speeds, options.hand);
  const auto out = make_folder(options.out);
  int code = 1;
  try {
    code = options.lockstep ? run_lockstep(options, setup, out, stop) : run_processes(options, setup, out, stop);
  } catch (...) {
    // Nothing half-made stays behind: a folder that holds no recording is removed again.
    std::error_code ignored;
    if (!std::filesystem::exists(out / "capture.mcap")) {
      std::filesystem::remove(out / "model.image", ignored);
      std::filesystem::remove(out, ignored);
      if (options.out.empty()) std::filesystem::remove(out.parent_path(), ignored);  // runs/, unless it holds others
    }
    throw;
  }
  if (std::filesystem::exists(out / "run.toml")) make_report(out, options.json);
  return code;
}

}  // namespace trocar::cli
