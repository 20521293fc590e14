#include "host/camera/render_command.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "common/config/quote.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/optics/pose_file.hpp"
#include "host/camera/new_folder.hpp"

namespace trocar::camera {
namespace {

// The camera turned about its u axis, and moved so that it still looks at the grid's middle from as far away.
optics::Pose tilted(const optics::Pose& pose, const optics::MarkerGrid& grid, double tilt_rad) {
  if (tilt_rad == 0.0) return pose;
  // Rot_x(tilt) Rot_x(pi) is one turn about the same axis.
  const double angle = pose.rotation_rad[0] + tilt_rad;
  const double x = 0.5 * (grid.columns - 1) * grid.spacing_m, y = 0.5 * (grid.rows - 1) * grid.spacing_m;
  const auto& t = pose.translation_m;
  const double middle_x = t[0] + x, middle_y = t[1] - y, depth = t[2];  // of the grid, before
  return {{angle, 0.0, 0.0}, {middle_x - x, middle_y - std::cos(angle) * y, depth - std::sin(angle) * y}};
}

}  // namespace

int run_render(const RenderOptions& options, const std::atomic<bool>& stop) {
  const std::filesystem::path camera_file = config::find_share("cameras", options.camera);
  const optics::Camera camera = optics::read_camera(camera_file);
  const optics::Pose pose = tilted(optics::looking_down(camera, options.grid, options.m_per_px), options.grid, options.tilt_rad);
  NewFolder folder(options.out);
  std::optional<optics::Renderer> renderer;
  try {
    renderer.emplace(camera, pose, options.grid, options.appearance, options.seed);
  } catch (const std::invalid_argument& e) {
    throw config::UserError(
        fmt::format("{}: {}; take another camera, a smaller --tilt-rad, or a larger --m-per-px", camera_file.string(), e.what()));
  }
  std::ofstream truth(folder.part() / "truth.csv", std::ios::binary);
  truth << "frame,t_s,row,col,u_px,v_px,x_m,y_m,visible\n";
  const bool show = isatty(STDERR_FILENO) == 1;
  optics::Frame frame;
  std::size_t hidden = 0;
  for (int k = 0; k < options.frames; ++k) {
    if (stop.load()) throw config::UserError("stopped; nothing was written");
    if (show) fmt::print(stderr, "\r{} of {} \x1b[K", k + 1, options.frames);
    const double t_s = k / options.rate_hz;
    renderer->render(options.motion.markers(options.grid, t_s), options.motion.needle(options.grid, t_s), static_cast<std::uint64_t>(k),
                     std::llround(1e9 * t_s), frame);
    const bool colour = frame.format == optics::PixelFormat::Rgb8;
    cv::Mat image(frame.height_px, frame.width_px, colour ? CV_8UC3 : CV_8UC1, frame.pixels.data());
    if (colour) cv::cvtColor(image, image, cv::COLOR_RGB2BGR);
    const std::filesystem::path name = folder.part() / fmt::format("frame_{:06}.png", k);
    bool written = false;
    try {
      written = cv::imwrite(name.string(), image, {cv::IMWRITE_PNG_COMPRESSION, 1});
    } catch (const cv::Exception&) {
      written = false;
    }
    if (!written) throw config::UserError(fmt::format("{}: cannot be written: is the disk full?", options.out.string()));
    for (int row = 0; row < options.grid.rows; ++row) {
      for (int column = 0; column < options.grid.columns; ++column) {
        const optics::MarkerTruth& m = renderer->truth()[options.grid.index(row, column)];
        truth << fmt::format("{},{},{},{},{},{},{},{},{}\n", k, t_s, row, column, m.pixel.u_px, m.pixel.v_px, m.at.x_m, m.at.y_m,
                             m.visible ? 1 : 0);
        hidden += m.visible ? 0 : 1;
      }
    }
  }
  if (show) fmt::print(stderr, "\r\x1b[K");
  std::ofstream pose_file(folder.part() / "pose.toml", std::ios::binary);
  optics::write_pose(pose_file, pose);
  constexpr const char* formats[] = {"mono", "bayer", "rgb"};
  std::ofstream(folder.part() / "render.toml") << fmt::format(
      "camera = {}\nsetting = \"{}\"\nmotion = \"{}\"\ndisplacement_m = {}\nspeed_m_s = {}\nframes = {}\nrate_hz = {}\nrows = {}\ncolumns "
      "= "
      "{}\nspacing_m = {}\ndiameter_m = {}\nm_per_px = {}\ntilt_rad = {}\nformat = \"{}\"\nexposure_s = {}\nseed = {}\n",
      config::quote(options.camera), options.setting, options.motion_name, options.motion.displacement_m, options.motion.speed_m_s,
      options.frames, options.rate_hz, options.grid.rows, options.grid.columns, options.grid.spacing_m, options.grid.diameter_m,
      options.m_per_px, options.tilt_rad, formats[static_cast<std::size_t>(options.appearance.format)], options.appearance.exposure_s,
      options.seed);
  if (!truth.flush() || !pose_file.flush())
    throw config::UserError(fmt::format("{}: cannot be written: is the disk full?", options.out.string()));
  folder.keep();
  if (hidden > 0)
    fmt::print(stderr, "trocar: {} of {} dots are not wholly within their frames\n", hidden,
               options.grid.markers() * static_cast<std::size_t>(options.frames));
  fmt::print("{} frames of {} markers into {}\n", options.frames, options.grid.markers(), options.out.string());
  return 0;
}

}  // namespace trocar::camera
