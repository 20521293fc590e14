#include "host/camera/program/commands.hpp"

#include <fmt/format.h>

#include "common/config/share.hpp"

namespace trocar::camera {

Calibrate::Calibrate(CLI::App& app, int& code, const std::atomic<bool>& stop) {
  auto* c = app.add_subcommand("calibrate",
                               "lens, distortion and poses from images of a chessboard\n"
                               "Example: trocar camera calibrate left*.jpg --board 9x6 --square-m 0.025 --out camera.toml");
  c->add_option("images", calibrate.images, "images of the board, all of one size")->required();
  c->add_option("--board", "inner corners, those between four squares, as COLUMNSxROWS")->required()->each([this](const std::string& text) {
    if (const std::string wrong = camera::parse_board(text, calibrate.board); !wrong.empty()) throw CLI::ValidationError(wrong);
  });
  c->add_option("--square-m", calibrate.board.square_m, "side of a square, m")->required()->check(CLI::Range(1e-5, 10.0));
  c->add_option("--out", calibrate.out, "camera file (TOML), written anew")->required();
  c->add_option("--picture", calibrate.picture, "residuals as SVG (default: the camera file's name and .svg)");
  c->add_flag("--fixed-aspect", calibrate.fit.fixed_aspect, "pixels are square: fx = fy");
  c->add_option("--radial", calibrate.fit.radial_terms, "radial terms, k1 to k3")->check(CLI::Range(0, 3))->capture_default_str();
  c->add_flag_callback(
      "--no-tangential", [this] { calibrate.fit.tangential = false; }, "without p1, p2");
  c->add_flag("--without-outliers", calibrate.fit.without_outliers,
              fmt::format("leave out views whose RMS is above {:g} times the median of the views; otherwise they are named and kept",
                          camera::outlier_factor));
  c->add_option(
       "--window", window,
       "half side of the square in which a corner is refined, px, or \"spacing\": three tenths of the way to its nearest neighbour; "
       "better where squares are small or oblique")
      ->capture_default_str()
      ->each([this](const std::string& text) {
        calibrate.window.by_spacing = text == "spacing";
        if (calibrate.window.by_spacing) return;
        if (text.find_first_not_of("0123456789") != std::string::npos || text.size() > 2 || text.empty() || std::stoi(text) < 2)
          throw CLI::ValidationError("--window", text + ": write 2 to 99, or spacing");
        calibrate.window.half_px = std::stoi(text);
      });
  c->add_flag("--json", calibrate.json, "the result as JSON on stdout");
  c->callback([this, &code, &stop] { code = camera::run_calibrate(calibrate, stop); });
}

Rectify::Rectify(CLI::App& app, int& code, const std::atomic<bool>& stop) {
  auto* r = app.add_subcommand("rectify",
                               "images or points without the lens's distortion\n"
                               "Example: trocar camera rectify left*.jpg --camera camera.toml --out rectified\n"
                               "Points: trocar camera rectify --points in.csv --camera camera.toml --out out.csv\n"
                               "in.csv: u_px,v_px; out.csv: u_px,v_px,iterations,status; the first pixel's centre is 0,0");
  auto* images = r->add_option("images", rectify.images, "images of that camera");
  auto* points = r->add_option("--points", rectify.points, "CSV u_px,v_px instead of images")->excludes(images);
  r->add_option("--camera", camera_name, "camera name, or path of its TOML file")->required();
  r->add_option("--out", rectify.out, "a folder to make, or with --points a CSV")->required();
  r->add_option("--method", method, "inverse of the distortion, for points; both to 1e-8 px")
      ->check(CLI::IsMember({"newton", "fixed-point"}))
      ->capture_default_str()
      ->needs(points);
  r->add_flag("--distort", rectify.distort, "points the other way: from the rectified image to the camera's")->needs(points);
  r->add_flag("--json", rectify.json, "the summary as JSON on stdout");
  r->callback([this, &code, &stop] {
    if (rectify.images.empty() && rectify.points.empty()) throw CLI::RequiredError("images or --points");
    rectify.fixed_point = method == "fixed-point";
    rectify.camera = config::find_share("cameras", camera_name);
    code = camera::run_rectify(rectify, stop);
  });
}

Register::Register(CLI::App& app, int& code) {
  auto* g = app.add_subcommand("register",
                               "where the camera stands over the rig, from marks on the tool while the rig moves\n"
                               "Example: trocar camera register --marks marks.csv --capture capture.mcap --camera camera.toml --out "
                               "registration.toml\n"
                               "marks.csv: from trocar track, or t_s,u_px,v_px of one mark, on the rig's clock");
  g->add_option("--marks", registration.marks, "where the marks were seen, CSV")->required();
  g->add_option("--capture", registration.capture, "the rig's recording of the same motion, MCAP")->required();
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
  g->callback([this, &code] {
    registration.camera = config::find_share("cameras", registered_camera);
    code = camera::run_register(registration);
  });
}

}  // namespace trocar::camera
