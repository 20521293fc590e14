// trocar-plant: the simulated machine behind the real wire. A controller cannot tell it from hardware.
#include <fmt/format.h>
#include <sys/prctl.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/scene/scene.hpp"
#include "hal/can/candump.hpp"
#include "hal/can/endpoint_bus.hpp"
#include "hal/realtime/clock.hpp"
#include "sim_plant/camera/eye.hpp"
#include "sim_plant/hand/hand_file.hpp"
#include "sim_plant/plant/plant_file.hpp"
#include "sim_plant/wired/wired_plant.hpp"

namespace {

using namespace trocar;
namespace rt = hal::realtime;

std::atomic<bool> stop_asked{false};
void on_signal(int) { stop_asked.store(true); }

struct Options {
  std::string rig = "ubc_twin";
  std::string scene = "phantom";
  bool no_tissue{};
  std::string plant = "ubc_twin";
  std::string hand;
  std::uint64_t seed = 1;
  bool log_drives{};
  std::string can_log;
  std::filesystem::path camera_socket, camera_truth;
};

// Every frame of both buses, as candump -L of can-utils writes them.
class CanLog {
 public:
  void open(const std::string& path, const rig::Buses& buses) {
    file_ = std::fopen(path.c_str(), "we");
    if (file_ == nullptr)
      throw config::UserError(
          fmt::format("--can-log {}: cannot write there ({}): give a file in a folder that you may write to", path, std::strerror(errno)));
    path_ = path;
    // A tunnel has no interface: its bus is named after what hangs on it.
    const auto name = [](const rig::BusEndpoint& endpoint, const char* without) {
      return std::string(endpoint.interface[0] != '\0' ? endpoint.interface.data() : without);
    };
    drives_ = name(buses.drives, "drives");
    sensor_ = name(buses.sensor, "sensor");
  }
  ~CanLog() {
    if (file_ != nullptr) std::fclose(file_);
  }
  CanLog() = default;
  CanLog(const CanLog&) = delete;
  CanLog& operator=(const CanLog&) = delete;

  void drives(const hal::CanFrame& frame) noexcept { write(frame, drives_); }
  void sensor(const hal::CanFrame& frame) noexcept { write(frame, sensor_); }
  // False: something could not be written (the disk may be full).
  [[nodiscard]] bool close() noexcept {
    if (file_ == nullptr) return true;
    const bool good = std::ferror(file_) == 0;
    return (std::fclose(std::exchange(file_, nullptr)) == 0) && good;
  }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  void write(const hal::CanFrame& frame, const std::string& interface) noexcept {
    if (file_ == nullptr) return;
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const auto time_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
    std::fputs(hal::candump_line(frame, time_ns, interface.c_str()).data(), file_);
  }
  std::FILE* file_{};
  std::string path_, drives_, sensor_;
};

// A starved simulation slows down instead of integrating an old torque for long: real drives would not have been starved.
constexpr std::int64_t longest_step_ns = 5'000'000;

int run(const Options& options) {
  const auto rig_file = config::find_share("rigs", options.rig);
  const rig::Rig rig = config::read_twin(rig_file);
  const auto plant_config = sim_plant::read_plant(config::find_share("plants", options.plant));
  std::optional<scene::Scene> scene;
  if (!options.no_tissue) scene = scene::read_scene(config::find_share("scenes", options.scene));
  std::optional<sim_plant::Hand> hand;
  if (!options.hand.empty()) hand = sim_plant::read_hand(config::find_share("hands", options.hand), options.seed);
  hal::EndpointBus drives;
  hal::EndpointBus sensor;
  const auto open = [&](hal::EndpointBus& bus, const rig::BusEndpoint& endpoint, const char* name) {
    const hal::OpenStatus status = bus.open(endpoint, hal::BusSide::Plant);
    if (status.error_number != 0) config::refuse_bus(rig_file, name, "plant_port", status.message.data());
  };
  open(drives, rig.buses.drives, "drives");
  open(sensor, rig.buses.sensor, "sensor");
  CanLog log;
  if (!options.can_log.empty()) log.open(options.can_log, rig.buses);
  auto plant = std::make_unique<sim_plant::WiredPlant>(rig, plant_config, scene, options.seed);
  if (hand) plant->give_to(&*hand);
  std::optional<sim_plant::LiveEye> eye;
  if (!options.camera_socket.empty()) {
    if (!scene || !plant_config.camera)
      throw config::UserError(fmt::format("--camera-socket: {}; leave it out",
                                          scene ? "plant " + options.plant + " has no [camera]" : "there is no tissue to look at"));
    eye.emplace(sim_plant::EyeOptions{*plant_config.camera, options.camera_socket, options.camera_truth, options.seed}, *scene,
                plant->physics().phantom());
  }
  fmt::print("trocar-plant: {} before {}{}, seed {}\n", rig.name.data(), scene ? "scene " + options.scene : "no tissue",
             hand ? ", with hand " + options.hand : "", options.seed);
  std::fflush(stdout);

  // Twice a tick, though no longer than keeps starvation apart from waiting.
  const std::int64_t longest_wait_ns = std::min(static_cast<std::int64_t>(0.5e9 / rig.timing.tick_hz), longest_step_ns / 2);
  const std::array<int, 2> inputs{drives.file_descriptor(), sensor.file_descriptor()};
  std::int64_t wall_ns = rt::monotonic_now_ns();
  std::int64_t now_ns = 0;  // the plant's own clock
  std::uint64_t starved = 0;
  std::int64_t heard_ns = 0;  // when the controller's last frame for the drives came
  std::array<hal::canopen::DriveState, sim_plant::WiredPlant::drives> known{};
  hal::CanFrame frame;
  while (!stop_asked.load()) {
    rt::wait_for_input(inputs, rt::monotonic_now_ns() + longest_wait_ns);
    const std::int64_t wall = rt::monotonic_now_ns();
    if (wall - wall_ns > longest_step_ns) ++starved;
    now_ns += std::min(wall - wall_ns, longest_step_ns);
    wall_ns = wall;
    plant->advance(now_ns);
    while (drives.receive(frame, now_ns)) {
      heard_ns = now_ns;
      log.drives(frame);
      for (std::size_t i = 0; i < plant->drives; ++i) plant->drive_receives(i, frame, now_ns);
    }
    while (sensor.receive(frame, now_ns)) {
      log.sensor(frame);
      plant->sensor_receives(frame, now_ns);
    }
    for (std::size_t i = 0; i < plant->drives; ++i) {
      while (plant->drive_transmits(i, frame)) {
        log.drives(frame);
        drives.send(frame, now_ns);
      }
    }
    drives.flush(now_ns);
    while (plant->sensor_transmits(frame)) {
      log.sensor(frame);
      sensor.send(frame, now_ns);
    }
    sensor.flush(now_ns);
    if (eye) eye->look(plant->physics().phantom(), plant->physics().pose(), wall);
    if (!options.log_drives) continue;
    for (std::size_t i = 0; i < plant->drives; ++i) {
      if (plant->drive(i).state() == known[i]) continue;
      known[i] = plant->drive(i).state();
      fmt::print("drive {} {} at {:.1f} ms, motor torque {:g} N m, {:.1f} ms after the controller's last frame\n", i + 1,
                 hal::canopen::to_string(known[i]), 1e-6 * static_cast<double>(now_ns), plant->drive(i).motor_torque_nm(),
                 1e-6 * static_cast<double>(now_ns - heard_ns));
      std::fflush(stdout);
    }
  }
  if (!log.close()) throw config::UserError(fmt::format("--can-log {}: not everything could be written: is the disk full?", log.path()));
  if (eye) eye->finish();
  const auto& p = plant->physics();
  fmt::print("trocar-plant: stopped after {:.1f} s; starved {} times", 1e-9 * static_cast<double>(p.time_ns()), starved);
  if (scene) fmt::print("; phantom: {} steps, {} unconverged", p.phantom().counters().steps, p.phantom().counters().unconverged);
  if (eye) fmt::print("; camera: {} frames sent, {} skipped", eye->sent(), eye->skipped());
  fmt::print("\n");
  if (eye && !eye->problem().empty()) throw config::UserError(fmt::format("the camera ended early: {}", eye->problem()));
  return 0;
}

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): what adds options throws when they contradict each other, in any call
int main(int argc, char** argv) {
  Options options;
  bool die_with_parent = false;
  CLI::App app{
      "trocar-plant: a simulated rig and tissue on the rig's buses.\nExample: trocar-plant --rig ubc_twin --scene phantom\nA virtual "
      "needle: trocar-plant --rig "
      "ubc_twin_haptic --plant ubc_twin_haptic --no-tissue --hand person"};
  app.add_option("--rig", options.rig, "rig name, or path of its TOML file")->capture_default_str();
  auto* scene = app.add_option("--scene", options.scene, "scene name, or path of its TOML file")->capture_default_str();
  app.add_flag("--no-tissue", options.no_tissue, "nothing in front of the machine, as for a virtual needle")->excludes(scene);
  app.add_option("--hand", options.hand, "who takes the handle when the motors come on: hand name, or path of its TOML file");
  app.add_option("--plant", options.plant, "plant name (how the machine differs from its rig file), or path")->capture_default_str();
  app.add_option("--seed", options.seed, "of all noise")->capture_default_str();
  app.add_flag("--log-drives", options.log_drives,
               "print every change of a drive's state, with the plant's time, torque and the controller's silence");
  app.add_option("--can-log", options.can_log, "file for every frame of both buses, in the format of candump -L (can-utils reads it)");
  auto* socket = app.add_option("--camera-socket", options.camera_socket,
                                "socket on which the camera over the phantom is served in real time (trocar track stream:SOCKET)");
  app.add_option("--camera-truth", options.camera_truth, "CSV of where its markers were: frame,t_s,row,col,u_px,v_px,x_m,y_m,visible")
      ->needs(socket);
  app.add_flag("--die-with-parent", die_with_parent, "stop when the process that started this one ends");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  if (die_with_parent) prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  try {
    return run(options);
  } catch (const std::exception& e) {
    fmt::print(stderr, "trocar-plant: {}\n", e.what());
    return 1;
  }
}
