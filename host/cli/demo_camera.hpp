// The eyes of a simulated run: trocar-camera tracks the markers that the plant's camera sees, through a socket of its own.
// Leaves markers.csv, markers.toml (the summary), markers.jpg and, from the simulation, markers_truth.csv in the run's folder.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/optics/simulated_camera.hpp"
#include "host/cli/process.hpp"

namespace trocar::cli {

class DemoCamera {
 public:
  DemoCamera(const optics::SimulatedCamera& camera, std::filesystem::path out);
  ~DemoCamera();
  DemoCamera(const DemoCamera&) = delete;
  DemoCamera& operator=(const DemoCamera&) = delete;

  [[nodiscard]] std::string socket() const { return (folder_ / "camera").string(); }
  [[nodiscard]] std::string truth() const { return (out_ / "markers_truth.csv").string(); }
  // Once the simulation serves its camera. With a domain: on the clock of the rig there, and published.
  void start(std::optional<std::uint32_t> domain);
  void drain();  // now and then, so that what it says finds room
  // After the simulation has ended, or (live) before: false when it failed, which is then said.
  bool finish(bool ask);

 private:
  optics::SimulatedCamera camera_;
  std::filesystem::path out_, folder_;
  std::optional<Process> tracker_{};
};

// The camera of this plant file, when there is one and trocar-camera is installed; says on stderr when it is not.
[[nodiscard]] std::optional<optics::SimulatedCamera> demo_camera(const std::string& plant);

}  // namespace trocar::cli
