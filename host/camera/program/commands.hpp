// The commands of this program: each adds itself to the command line, holds what the parser fills in, and leaves its exit code. They
// outlive the parsing.
#pragma once

#include <CLI/CLI.hpp>
#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "host/camera/calibrate_command.hpp"
#include "host/camera/grab_command.hpp"
#include "host/camera/rectify_command.hpp"
#include "host/camera/register_command.hpp"
#include "host/camera/render_command.hpp"
#include "host/tracking/track_command.hpp"

namespace trocar::camera {

void add_source(CLI::App& command, std::vector<std::string>& names, SourceOptions& options);
void add_grid(CLI::App& command, optics::MarkerGrid& grid);

struct Calibrate {
  Calibrate(CLI::App& app, int& code, const std::atomic<bool>& stop);
  camera::CalibrateOptions calibrate{};
  std::string window{"11"};
};

struct Rectify {
  Rectify(CLI::App& app, int& code, const std::atomic<bool>& stop);
  camera::RectifyOptions rectify{};
  std::string camera_name{}, method{"newton"};
};

struct Register {
  Register(CLI::App& app, int& code);
  camera::RegisterOptions registration{};
  std::string registered_camera{};
};

struct List {
  List(CLI::App& app, int& code);
  bool list_json{};
};

struct Grab {
  Grab(CLI::App& app, int& code, const std::atomic<bool>& stop);
  camera::GrabOptions grab{};
};

struct Render {
  Render(CLI::App& app, int& code, const std::atomic<bool>& stop);
  camera::RenderOptions render{};
  std::string format{"mono"};
  std::optional<double> exposure_s{}, noise{};
};

struct Track {
  Track(CLI::App& app, int& code, const std::atomic<bool>& stop);
  tracking::TrackOptions track{};
  std::string tracked_camera{}, tracked_by{"edge"};
  std::vector<std::string> corners{};
};

}  // namespace trocar::camera
