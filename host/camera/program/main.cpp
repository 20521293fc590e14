// trocar-camera: the commands of `trocar camera`, and `trocar track`, which start it. A program of its own because of what OpenCV loads
// (README.md).
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <atomic>
#include <csignal>
#include <opencv2/core/utils/logger.hpp>
#include <optional>
#include <string_view>

#include "common/config/share.hpp"
#include "host/camera/calibrate_command.hpp"
#include "host/camera/grab_command.hpp"
#include "host/camera/rectify_command.hpp"
#include "host/camera/register_command.hpp"
#include "host/camera/render_command.hpp"
#include "host/tracking/track_command.hpp"

namespace {

using namespace trocar;

std::atomic<bool> stop_asked{false};
void on_signal(int) { stop_asked.store(true); }

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
  command.add_flag("--bayer", options.bayer, "grey image files hold a Bayer pattern (RGGB)");
}

void add_grid(CLI::App& command, optics::MarkerGrid& grid) {
  command.add_option("--rows", grid.rows, "markers along y")->check(CLI::Range(1, 200))->capture_default_str();
  command.add_option("--columns", grid.columns, "markers along x")->check(CLI::Range(1, 200))->capture_default_str();
  command.add_option("--spacing-m", grid.spacing_m, "from marker to marker")->check(CLI::Range(1e-5, 10.0))->capture_default_str();
}

}  // namespace

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

  camera::CalibrateOptions calibrate;
  auto* c = app.add_subcommand("calibrate",
                               "lens, distortion and poses from images of a chessboard\n"
                               "Example: trocar camera calibrate left*.jpg --board 9x6 --square-m 0.025 --out camera.toml");
  c->add_option("images", calibrate.images, "images of the board, all of one size")->required();
  c->add_option("--board", "inner corners, those between four squares, as COLUMNSxROWS")->required()->each([&](const std::string& text) {
    if (const std::string wrong = camera::parse_board(text, calibrate.board); !wrong.empty()) throw CLI::ValidationError(wrong);
  });
  c->add_option("--square-m", calibrate.board.square_m, "side of a square, m")->required()->check(CLI::Range(1e-5, 10.0));
  c->add_option("--out", calibrate.out, "camera file (TOML), written anew")->required();
  c->add_option("--picture", calibrate.picture, "residuals as SVG (default: the camera file's name and .svg)");
  c->add_flag("--fixed-aspect", calibrate.fit.fixed_aspect, "pixels are square: fx = fy");
  c->add_option("--radial", calibrate.fit.radial_terms, "radial terms, k1 to k3")->check(CLI::Range(0, 3))->capture_default_str();
  c->add_flag_callback(
      "--no-tangential", [&] { calibrate.fit.tangential = false; }, "without p1, p2");
  c->add_flag("--without-outliers", calibrate.fit.without_outliers,
              fmt::format("leave out views whose RMS is above {:g} times the median of the views; otherwise they are named and kept",
                          camera::outlier_factor));
  std::string window = "11";
  c->add_option(
       "--window", window,
       "half side of the square in which a corner is refined, px, or \"spacing\": three tenths of the way to its nearest neighbour; "
       "better where squares are small or oblique")
      ->capture_default_str()
      ->each([&](const std::string& text) {
        calibrate.window.by_spacing = text == "spacing";
        if (calibrate.window.by_spacing) return;
        if (text.find_first_not_of("0123456789") != std::string::npos || text.size() > 2 || text.empty() || std::stoi(text) < 2)
          throw CLI::ValidationError("--window", text + ": write 2 to 99, or spacing");
        calibrate.window.half_px = std::stoi(text);
      });
  c->add_flag("--json", calibrate.json, "the result as JSON on stdout");
  c->callback([&] { code = camera::run_calibrate(calibrate, stop_asked); });

  camera::RectifyOptions rectify;
  auto* r = app.add_subcommand("rectify",
                               "images or points without the lens's distortion\n"
                               "Example: trocar camera rectify left*.jpg --camera camera.toml --out rectified\n"
                               "Points: trocar camera rectify --points in.csv --camera camera.toml --out out.csv\n"
                               "in.csv: u_px,v_px; out.csv: u_px,v_px,iterations,status; the first pixel's centre is 0,0");
  auto* images = r->add_option("images", rectify.images, "images of that camera");
  auto* points = r->add_option("--points", rectify.points, "CSV u_px,v_px instead of images")->excludes(images);
  std::string camera_name;
  r->add_option("--camera", camera_name, "camera name, or path of its TOML file")->required();
  r->add_option("--out", rectify.out, "a folder to make, or with --points a CSV")->required();
  std::string method = "newton";
  r->add_option("--method", method, "inverse of the distortion, for points; both to 1e-8 px")
      ->check(CLI::IsMember({"newton", "fixed-point"}))
      ->capture_default_str()
      ->needs(points);
  r->add_flag("--distort", rectify.distort, "points the other way: from the rectified image to the camera's")->needs(points);
  r->add_flag("--json", rectify.json, "the summary as JSON on stdout");
  r->callback([&] {
    if (rectify.images.empty() && rectify.points.empty()) throw CLI::RequiredError("images or --points");
    rectify.fixed_point = method == "fixed-point";
    rectify.camera = config::find_share("cameras", camera_name);
    code = camera::run_rectify(rectify, stop_asked);
  });

  camera::RegisterOptions registration;
  auto* g = app.add_subcommand("register",
                               "where the camera stands over the rig, from marks on the tool while the rig moves\n"
                               "Example: trocar camera register --marks marks.csv --capture capture.mcap --camera camera.toml --out "
                               "registration.toml\n"
                               "marks.csv: from trocar track, or t_s,u_px,v_px of one mark, on the rig's clock");
  g->add_option("--marks", registration.marks, "where the marks were seen, CSV")->required();
  g->add_option("--capture", registration.capture, "the rig's recording of the same motion, MCAP")->required();
  std::string registered_camera;
  g->add_option("--camera", registered_camera, "camera name, or path of its TOML file")->required();
  g->add_option("--out", registration.out, "registration (TOML), written anew")->required();
  g->add_option("--mark-m", registration.mark_m,
                "x and y of each mark in the tool, x along the needle; without it they are found, and the tool has to turn")
      ->delimiter(',');
  g->add_option("--delay-s", registration.delay_s, "frames' times plus this are the rig's: where the search for it begins")
      ->check(CLI::Range(-1e9, 1e9));
  g->add_flag("--known-delay", registration.known_delay, "take --delay-s as it is (0 without it)");
  g->add_option(
      "--phantom", registration.phantom,
      "TOML with rotation_rad and translation_m of the phantom's plane in the camera's frame: adds where the phantom lies in the rig");
  g->add_flag("--json", registration.json, "the result as JSON on stdout");
  g->callback([&] {
    registration.camera = config::find_share("cameras", registered_camera);
    code = camera::run_register(registration);
  });

  auto* l = app.add_subcommand("list", "cameras on this machine and its networks (GigE Vision, USB3 Vision)\nExample: trocar camera list");
  bool list_json = false;
  l->add_flag("--json", list_json, "as JSON on stdout");
  l->callback([&] { code = camera::run_list(list_json); });

  camera::GrabOptions grab;
  auto* b = app.add_subcommand("grab",
                               "frames of a camera into a folder\n"
                               "Example: trocar camera grab aravis --frames 100 --out frames");
  add_source(*b, grab.source, grab.source_options);
  b->add_option("--frames", grab.frames, "how many; without it until Ctrl-C");
  b->add_option("--out", grab.out, "folder to make; holds what came, whatever happens")->required();
  b->callback([&] { code = camera::run_grab(grab, stop_asked); });

  camera::RenderOptions render;
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
  std::string format = "mono";
  y->add_option("--format", format, "of the pixels")->check(CLI::IsMember({"mono", "bayer", "rgb"}))->capture_default_str();
  std::optional<double> exposure_s, noise;
  y->add_option("--exposure-s", exposure_s, "instead of the setting's")->check(CLI::Range(0.0, 1.0));
  y->add_option("--noise", noise, "read noise instead of the setting's, grey levels")->check(CLI::Range(0.0, 50.0));
  y->add_option("--seed", render.seed, "of dots and noise")->capture_default_str();
  y->add_option("--out", render.out, "folder to make")->required();
  y->callback([&] {
    render.appearance = render.setting == "hard" ? optics::hard_appearance() : optics::clean_appearance();
    if (exposure_s) render.appearance.exposure_s = *exposure_s;
    if (noise) render.appearance.read_noise = *noise;
    render.appearance.format = format == "bayer" ? optics::PixelFormat::BayerRG8
                               : format == "rgb" ? optics::PixelFormat::Rgb8
                                                 : optics::PixelFormat::Mono8;
    render.motion.kind = render.motion_name == "shear"       ? optics::MotionKind::Shear
                         : render.motion_name == "insertion" ? optics::MotionKind::Insertion
                                                             : optics::MotionKind::Still;
    code = camera::run_render(render, stop_asked);
  });

  tracking::TrackOptions track;
  auto* k =
      app.add_subcommand("track",
                         "follow the markers of a phantom from frame to frame\n"
                         "Example: trocar track frames/ --camera camera.toml --out markers.csv --picture markers.png\n"
                         "markers.csv: frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid; column 0 is on the left, row 0 at the bottom");
  add_source(*k, track.source, track.source_options);
  add_grid(*k, track.tracker.grid);
  auto* diameter = k->add_option("--diameter-m", track.tracker.grid.diameter_m, "of a marker, for --corners; else it is measured")
                       ->check(CLI::Range(1e-6, 1.0));
  std::string tracked_camera, tracked_by = "edge";
  k->add_option("--camera", tracked_camera, "camera name, or path of its TOML file")->required();
  k->add_option("--method", tracked_by, "edge: a circle through edges on rays (more exact, and faster); correlation: the thesis's")
      ->check(CLI::IsMember({"edge", "correlation"}))
      ->capture_default_str();
  std::vector<std::string> corners;
  k->add_option("--corners", corners,
                "places u,v of the corner markers in the first frame, in pixels: row 0 column 0, row 0 last column, both last, "
                "last row column 0; without them the grid is found")
      ->expected(4);
  k->add_option("--pose", track.pose, "TOML with the pose of the phantom's plane; without it, that of the first frame's markers");
  k->add_option("--pose-out", track.pose_out, "where to write that pose");
  k->add_option("--out", track.out, "markers (CSV)")->required();
  k->add_option("--covariance", track.covariance, "covariances (CSV): frame,row,col,xx_m2,xy_m2,yy_m2");
  k->add_option("--picture", track.picture, "PNG: the frame in which the markers are furthest from the first, with their displacements");
  k->add_option("--picture-scale", track.picture_scale, "of the arrows")->check(CLI::Range(0.01, 1000.0))->capture_default_str();
  k->add_option("--threads", track.tracker.threads, "to search with")->check(CLI::Range(1, 64))->capture_default_str();
  k->add_flag("--live", track.live, "wait for the grid instead of ending when the first frame does not show it");
  k->add_flag("--json", track.json, "the summary as JSON on stdout");
  k->callback([&] {
    if (!corners.empty())
      if (const std::string wrong = tracking::parse_corners(corners, track.corners_px); !wrong.empty())
        throw CLI::ValidationError("--corners", wrong);
    track.known_diameter = diameter->count() > 0;
    track.tracker.method = tracked_by == "edge" ? tracking::Method::Edge : tracking::Method::Correlation;
    track.camera = config::find_share("cameras", tracked_camera);
    code = tracking::run_track(track, {}, stop_asked);
  });

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
