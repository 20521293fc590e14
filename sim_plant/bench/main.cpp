// trocar-bench: a whole experiment in lock-step, without real time. Leaves samples.csv, capture.mcap and run.toml; of a haptic one also
// truth.csv.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/capture/rig_capture.hpp"
#include "common/capture/samples_csv.hpp"
#include "common/condense/compile.hpp"
#include "common/config/new_file.hpp"
#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/experiment/experiment.hpp"
#include "common/experiment/experiment_file.hpp"
#include "common/experiment/truth_file.hpp"
#include "common/model/image.hpp"
#include "common/scene/scene.hpp"
#include "common/wire/convert.hpp"
#include "firmware/control/force_observer.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/camera/eye.hpp"
#include "sim_plant/hand/hand_file.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace {

using namespace trocar;

std::atomic<bool> stop_asked{false};
void on_signal(int) { stop_asked.store(true); }

struct Options {
  std::string experiment = "insertion";
  std::string hand;
  std::vector<double> speeds_mm_s;
  std::filesystem::path out;
  std::uint64_t seed = 1;
  bool progress{};
  std::filesystem::path camera_socket;
};

constexpr std::uint64_t session = 1;
constexpr std::size_t batch = 20;
constexpr std::int64_t keep_alive_ns = 20'000'000;

// The scene as the controller's model, in place of tissue.
struct Model {
  Model(const scene::Scene& scene, const rig::Rig& rig) : needle({rig.haptic.fade_s}) {
    condense::Options options;
    options.visible = condense::WithVisible::No;
    bytes = condense::compile_to_memory(scene, options).image;
    const model::ImageStatus status = model::open(bytes.span(), image);
    if (status != model::ImageStatus::Ok) throw config::UserError(scene.file.string() + ": " + to_string(status));
    needle.offer(&image);
  }
  image_file::AlignedBytes bytes;
  model::Image image{};
  virtual_needle::VirtualNeedle needle;
};

// The camera over the phantom: a frame at every whole period of its own, each waited for, so that none is lost and equal seeds give equal
// frames.
class Watcher {
 public:
  Watcher(const Options& options, const sim_plant::PlantConfig& plant, const scene::Scene& scene, const sim_plant::Phantom& phantom)
      : rate_hz_(plant.camera->rate_hz),
        eye_({*plant.camera, options.camera_socket, options.out / "markers_truth.csv", options.seed}, scene, phantom, optics::Clock::Rig) {
    fmt::print("camera at {}\n", options.camera_socket.string());
    std::fflush(stdout);
    if (!eye_.watched(patience))
      throw config::UserError(fmt::format("{}: nobody came to watch for {} s; start trocar track stream:{}", options.camera_socket.string(),
                                          patience.count(), options.camera_socket.string()));
  }
  void look(const sim_plant::Plant& plant, std::int64_t now_ns) {
    if (static_cast<double>(now_ns) < 1e9 * static_cast<double>(number_) / rate_hz_) return;
    eye_.take(plant.phantom(), now_ns, plant.pose(), state_);
    if (!eye_.show(state_, number_++, patience) && watched_) {
      watched_ = false;
      fmt::print(stderr, "trocar-bench: whoever watched the camera is gone; the experiment goes on without\n");
    }
  }
  void finish() { eye_.finish(); }

 private:
  static constexpr std::chrono::seconds patience{20};
  double rate_hz_;
  sim_plant::Eye eye_;
  sim_plant::SurfaceState state_{};
  std::uint64_t number_{};
  bool watched_{true};
};

int run(const Options& options) {
  experiment::Experiment e = experiment::read_experiment(config::find_share("experiments", options.experiment));
  std::vector<double> speeds;
  for (const double v : options.speeds_mm_s) speeds.push_back(1e-3 * v);
  experiment::replace(e, speeds, options.hand);
  const auto rig_file = config::find_share("rigs", e.rig);
  const rig::Rig rig = config::read_twin(rig_file);
  if (e.haptic()) {  // as trocar-rig does
    const control::Admissible verdict = rig.haptic.present ? control::admit(rig).verdict : control::Admissible::NotPositive;
    if (verdict != control::Admissible::Yes) config::refuse_haptic(rig_file, control::to_text(verdict));
  }
  const scene::Scene scene = scene::read_scene(config::find_share("scenes", e.scene));
  scene::require_insertion(scene);
  const auto entry = scene::entry_m(scene);
  const experiment::Placement placement{entry[1], entry[0], scene.needle->length_m};
  experiment::Sequencer sequencer(e, placement, rig, session);
  const sim_plant::PlantConfig plant = sim_plant::read_plant(config::find_share("plants", e.plant));
  std::unique_ptr<Model> model;
  std::optional<sim_plant::Hand> hand;
  if (e.haptic()) {
    hand = sim_plant::read_hand(config::find_share("hands", e.hand), options.seed);
    model = std::make_unique<Model>(scene, rig);
  }
  sim_plant::Bench bench(rig, plant, model ? std::nullopt : std::optional(scene), options.seed, model ? &model->needle : nullptr);
  if (hand) bench.give_to(&*hand);

  const bool watched = !options.camera_socket.empty();
  if (watched && (model || !plant.camera))
    throw config::UserError(fmt::format("--camera-socket: {}; leave it out", model
                                                                                 ? "no tissue stands before the machine in this experiment"
                                                                                 : "plant " + e.plant + " has no [camera]"));
  std::error_code error;
  const bool made = std::filesystem::create_directories(options.out, error);
  if (error)
    throw config::UserError(
        fmt::format("{}: cannot be made ({}): give a folder that you may write to with --out", options.out.string(), error.message()));
  std::unique_ptr<Watcher> eye;
  try {
    if (watched) eye = std::make_unique<Watcher>(options, plant, scene, bench.plant().physics().phantom());
  } catch (...) {
    if (made) std::filesystem::remove(options.out, error);  // still empty: nothing was run
    throw;
  }
  capture::RigCaptureWriter capture(options.out / "capture.mcap");
  capture::SamplesCsv csv(options.out / "samples.csv");
  std::optional<experiment::TruthFile> truth_file;
  if (hand) truth_file.emplace(options.out / "truth.csv");

  const auto begin = std::chrono::steady_clock::now();
  std::vector<Sample> pending;
  std::int64_t next_keep_alive_ns = 0;
  std::uint64_t ticks = 0;
  const auto write_pending = [&] {
    if (!pending.empty()) capture.write_samples(pending);
    pending.clear();
  };
  while (!sequencer.finished() && !stop_asked.load()) {
    if (auto command = sequencer.next()) {
      capture.write(wire::to_wire(*command, rig.gain_set[command->gain_set].name.data(), bench.now_ns(), 0),
                    static_cast<std::uint64_t>(bench.now_ns()));
      bench.mail().commands.push(*command);
    }
    if (bench.now_ns() >= next_keep_alive_ns) {
      bench.mail().commands.push({.session = session, .kind = CommandKind::KeepAlive});
      next_keep_alive_ns = bench.now_ns() + keep_alive_ns;
    }
    experiment::Truth truth;
    if (hand) truth = {0, bench.now_ns(), hand->wrench(), bench.plant().physics().pose()};
    bench.tick();
    if (truth_file) {
      truth.tick = bench.sample().tick;
      truth_file->write(truth);
    }
    if (eye) eye->look(bench.plant().physics(), bench.now_ns());
    const auto time_ns = static_cast<std::uint64_t>(bench.now_ns());
    csv.write(bench.sample());
    pending.push_back(bench.sample());
    if (pending.size() == batch) write_pending();
    Event event;
    while (bench.mail().events.pop(event)) capture.write(wire::to_wire(event), time_ns);
    Reply reply;
    std::vector<Reply> replies;
    while (bench.mail().replies.pop(reply)) {
      capture.write(wire::to_wire(reply), time_ns);
      replies.push_back(reply);
    }
    sequencer.on_sample(bench.sample());
    for (const Reply& r : replies) sequencer.on_reply(r);
    if (options.progress && ++ticks % 500 == 0 && std::isfinite(bench.sample().pose[1]))
      fmt::print(stderr, "progress {:.4f} {:.3f} {:.4f} {} {}\n", sequencer.progress(), 1e3 * sequencer.tip_depth_m(bench.sample()),
                 sequencer.axial_force_n(bench.sample()), to_string(bench.sample().mode), sequencer.phase_name());
  }
  write_pending();
  capture.close();
  csv.finish();
  if (truth_file) truth_file->finish();
  if (eye) eye->finish();
  eye.reset();

  experiment::Run result;
  result.experiment = e.name;
  result.haptic = e.haptic();
  result.rig = rig.name.data();
  result.scene = e.scene;
  result.lockstep = true;
  result.placement = placement;
  for (std::size_t i = 0; i < rig.gain_sets; ++i)
    if (std::string(rig.gain_set[i].name.data()) == "thesis") result.thesis_stiffness_n_per_m = rig.gain_set[i].translation.proportional;
  result.simulated_s = 1e-9 * static_cast<double>(bench.now_ns());
  result.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  result.completed = sequencer.finished() && !sequencer.failed();
  result.outcome = stop_asked.load() ? "stopped by the user" : sequencer.failure();
  result.phases = sequencer.phases();
  result.notes = sequencer.notes();
  experiment::write_run(options.out, result);
  fmt::print("{:.1f} s simulated in {:.1f} s ({:.1f} times real time)\n", result.simulated_s, result.wall_s,
             result.simulated_s / result.wall_s);
  if (result.completed) return 0;
  fmt::print(stderr, "trocar-bench: {}\n", result.outcome);
  return 1;
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): what adds options throws when they contradict each other, in any call
int main(int argc, char** argv) {
  Options options;
  CLI::App app{
      "trocar-bench: controller and simulated plant in lock-step on a virtual clock.\nExample: trocar-bench --experiment insertion --out "
      "runs/bench"};
  app.add_option("--experiment", options.experiment, "experiment name, or path of its TOML file")->capture_default_str();
  app.add_option("--speeds", options.speeds_mm_s, "insertion speeds in mm/s instead of the file's, such as 1,9")
      ->delimiter(',')
      ->check(CLI::Range(0.01, 200.0));
  app.add_option("--hand", options.hand, "who holds the handle, instead of the experiment's: hand name, or path of its TOML file");
  app.add_option("--out", options.out, "folder for the results")->required();
  app.add_option("--seed", options.seed, "of all noise")->capture_default_str();
  app.add_option("--camera-socket", options.camera_socket,
                 "socket on which the camera over the phantom is served (trocar track stream:SOCKET); waits for who watches");
  app.add_flag("--progress", options.progress, "progress for a parent program, on stderr");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  try {
    return run(options);
  } catch (const std::exception& error) {
    fmt::print(stderr, "trocar-bench: {}\n", error.what());
    return 1;
  }
}
