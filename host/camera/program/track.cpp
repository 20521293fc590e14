#include "host/camera/program/commands.hpp"

#include <fmt/format.h>

#include "common/config/share.hpp"

namespace trocar::camera {

Track::Track(CLI::App& app, int& code, const std::atomic<bool>& stop) {
  auto* k =
      app.add_subcommand("track",
                         "follow the markers of a phantom from frame to frame\n"
                         "Example: trocar track frames/ --camera camera.toml --out markers.csv --picture markers.png\n"
                         "markers.csv: frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid; column 0 is on the left, row 0 at the bottom");
  add_source(*k, track.source, track.source_options);
  add_grid(*k, track.tracker.grid);
  auto* diameter = k->add_option("--diameter-m", track.tracker.grid.diameter_m, "of a marker, for --corners; else it is measured")
                       ->check(CLI::Range(1e-6, 1.0));
  k->add_option("--camera", tracked_camera, "camera name, or path of its TOML file")->required();
  k->add_option("--method", tracked_by, "edge: a circle through edges on rays (more exact, and faster); correlation: the thesis's")
      ->check(CLI::IsMember({"edge", "correlation"}))
      ->capture_default_str();
  k->add_option("--corners", corners,
                "places u,v of the corner markers in the first frame, in pixels: row 0 column 0, row 0 last column, both last, "
                "last row column 0; without them the grid is found")
      ->expected(4);
  k->add_option("--pose", track.pose, "TOML with the pose of the phantom's plane; without it, that of the first frame's markers");
  k->add_option("--pose-out", track.pose_out, "where to write that pose");
  k->add_option("--out", track.out, "markers (CSV)")->required();
  k->add_option("--covariance", track.covariance, "covariances (CSV): frame,row,col,xx_m2,xy_m2,yy_m2");
  k->add_option("--summary", track.summary, "TOML: frames, losses, time needed, at the end");
  k->add_option("--picture", track.picture, "PNG: the frame in which the markers are furthest from the first, with their displacements");
  k->add_option("--picture-scale", track.picture_scale, "of the arrows")->check(CLI::Range(0.01, 1000.0))->capture_default_str();
  k->add_option("--threads", track.tracker.threads, "to search with")->check(CLI::Range(1, 64))->capture_default_str();
  k->add_flag("--live", track.live, "wait for the grid instead of ending when the first frame does not show it");
  k->add_flag("--json", track.json, "the summary as JSON on stdout");
  k->callback([=, this, &code, &stop] {
    if (!corners.empty())
      if (const std::string wrong = tracking::parse_corners(corners, track.corners_px); !wrong.empty())
        throw CLI::ValidationError("--corners", wrong);
    track.known_diameter = diameter->count() > 0;
    track.tracker.method = tracked_by == "edge" ? tracking::Method::Edge : tracking::Method::Correlation;
    track.camera = config::find_share("cameras", tracked_camera);
    code = tracking::run_track(track, stop);
  });
}

}  // namespace trocar::camera
