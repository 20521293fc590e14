// trocar-camera: the commands of `trocar camera`, and `trocar track`, which start it. A program of its own because of what OpenCV loads
// (README.md).
#include <fmt/format.h>

#include <csignal>
#include <opencv2/core/utils/logger.hpp>
#include <string_view>

#include "host/camera/program/commands.hpp"

namespace {

std::atomic<bool> stop_asked{false};
void on_signal(int) { stop_asked.store(true); }

}  // namespace

// NOLINTNEXTLINE(bugprone-exception-escape): what adds options throws when they contradict each other, in any call
int main(int argc, char** argv) {
  // What OpenCV has to say comes as an exception, or as a status; its own lines would break ours.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  CLI::App app{
      "cameras: calibrate one, and undo its distortion\nExample: trocar camera calibrate left*.jpg --board 9x6 --square-m 0.025 --out "
      "camera.toml",
      "trocar camera"};
  // Typed as `trocar track`, and shown so.
  if (argc > 1 && std::string_view(argv[1]) == "track") app.name("trocar");
  app.require_subcommand(1);
  int code = 0;

  const trocar::camera::Calibrate calibrate(app, code, stop_asked);
  const trocar::camera::Rectify rectify(app, code, stop_asked);
  const trocar::camera::Register registration(app, code);
  const trocar::camera::List list(app, code);
  const trocar::camera::Grab grab(app, code, stop_asked);
  const trocar::camera::Render render(app, code, stop_asked);
  const trocar::camera::Track track(app, code, stop_asked);

  std::signal(SIGINT, on_signal);
  std::signal(SIGTERM, on_signal);
  try {
    app.parse(argc, argv);
    return code;
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    fmt::print(stderr, "trocar: {}\n", e.what());
    return 1;
  }
}
