#include "host/camera/program/commands.hpp"

#include <fmt/format.h>

#include "common/config/share.hpp"

namespace trocar::camera {

void add_source(CLI::App& command, std::vector<std::string>& names, camera::SourceOptions& options) {
  command
      .add_option("source", names,
                  "image files or a folder of them, a video, \"aravis\" or \"aravis:ID\" for a camera (trocar camera list), or "
                  "\"stream:SOCKET\" for the "
                  "simulated one")
      ->required();
  command.add_option("--rate-hz", options.rate_hz, "frames a second: of image files; asked of a camera")
      ->check(CLI::Range(0.01, 10000.0))
      ->capture_default_str();
  command.add_option("--exposure-s", options.exposure_s, "asked of a camera; without it as it is set")->check(CLI::Range(1e-6, 10.0));
  command
      .add_option("--domain", options.domain,
                  "DDS domain of a rig: the frames of a camera get its time; trocar track publishes camera/markers there")
      ->check(CLI::Range(0, 230));
  command.add_flag("--bayer", options.bayer, "grey image files hold a Bayer pattern (RGGB)");
}

void add_grid(CLI::App& command, optics::MarkerGrid& grid) {
  command.add_option("--rows", grid.rows, "markers along y")->check(CLI::Range(1, 200))->capture_default_str();
  command.add_option("--columns", grid.columns, "markers along x")->check(CLI::Range(1, 200))->capture_default_str();
  command.add_option("--spacing-m", grid.spacing_m, "from marker to marker")->check(CLI::Range(1e-5, 10.0))->capture_default_str();
}

List::List(CLI::App& app, int& code) {
  auto* l = app.add_subcommand("list", "cameras on this machine and its networks (GigE Vision, USB3 Vision)\nExample: trocar camera list");
  l->add_flag("--json", list_json, "as JSON on stdout");
  l->callback([this, &code] { code = camera::run_list(list_json); });
}

Grab::Grab(CLI::App& app, int& code, const std::atomic<bool>& stop) {
  auto* b = app.add_subcommand("grab",
                               "frames of a camera into a folder\n"
                               "Example: trocar camera grab aravis --frames 100 --out frames");
  add_source(*b, grab.source, grab.source_options);
  b->add_option("--frames", grab.frames, "how many; without it until Ctrl-C");
  b->add_option("--out", grab.out, "folder to make; holds what came, whatever happens")->required();
  b->callback([this, &code, &stop] { code = camera::run_grab(grab, stop); });
}

Render::Render(CLI::App& app, int& code, const std::atomic<bool>& stop) {
  auto* y = app.add_subcommand("render",
                               "synthetic frames of a marked phantom, with the truth beside them\n"
                               "Example: trocar camera render --setting hard --motion insertion --frames 200 --out frames");
  add_grid(*y, render.grid);
  y->add_option("--diameter-m", render.grid.diameter_m, "of a marker")->check(CLI::Range(1e-6, 1.0))->capture_default_str();
  y->add_option("--camera", render.camera, "camera name, or path of its TOML file")->capture_default_str();
  y->add_option("--setting", render.setting,
                "hard: uneven light, shadow, holes, blur, rolling shutter, noise, dots of differing size and darkness")
      ->check(CLI::IsMember({"clean", "hard"}))
      ->capture_default_str();
  y->add_option("--motion", render.motion_name, "of the phantom")
      ->check(CLI::IsMember({"still", "shear", "insertion"}))
      ->capture_default_str();
  y->add_option("--displacement-m", render.motion.displacement_m, "greatest one")->check(CLI::Range(1e-6, 1.0))->capture_default_str();
  y->add_option("--speed-m-s", render.motion.speed_m_s, "greatest one")->check(CLI::Range(1e-6, 10.0))->capture_default_str();
  y->add_option("--frames", render.frames, "how many")->check(CLI::Range(1, 1000000))->capture_default_str();
  y->add_option("--rate-hz", render.rate_hz, "frames a second")->check(CLI::Range(0.01, 10000.0))->capture_default_str();
  y->add_option("--m-per-px", render.m_per_px, "of the phantom a pixel, which sets the camera's height")
      ->check(CLI::Range(1e-7, 0.1))
      ->capture_default_str();
  y->add_option("--tilt-rad", render.tilt_rad, "of the camera from straight down")->check(CLI::Range(-1.0, 1.0))->capture_default_str();
  y->add_option("--format", format, "of the pixels")->check(CLI::IsMember({"mono", "bayer", "rgb"}))->capture_default_str();
  y->add_option("--exposure-s", exposure_s, "instead of the setting's")->check(CLI::Range(0.0, 1.0));
  y->add_option("--noise", noise, "read noise instead of the setting's, grey levels")->check(CLI::Range(0.0, 50.0));
  y->add_option("--seed", render.seed, "of dots and noise")->capture_default_str();
  y->add_option("--out", render.out, "folder to make")->required();
  y->callback([this, &code, &stop] {
    render.appearance = render.setting == "hard" ? optics::hard_appearance() : optics::clean_appearance();
    if (exposure_s) render.appearance.exposure_s = *exposure_s;
    if (noise) render.appearance.read_noise = *noise;
    render.appearance.format = format == "bayer" ? optics::PixelFormat::BayerRG8
                               : format == "rgb" ? optics::PixelFormat::Rgb8
                                                 : optics::PixelFormat::Mono8;
    render.motion.kind = render.motion_name == "shear"       ? optics::MotionKind::Shear
                         : render.motion_name == "insertion" ? optics::MotionKind::Insertion
                                                             : optics::MotionKind::Still;
    code = camera::run_render(render, stop);
  });
}

}  // namespace trocar::camera
