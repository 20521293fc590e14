#include "host/camera/register_command.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <map>
#include <utility>

#include "common/capture/rig_capture.hpp"
#include "common/config/csv.hpp"
#include "common/config/new_file.hpp"
#include "common/config/quote.hpp"
#include "common/config/user_error.hpp"
#include "common/optics/camera_file.hpp"
#include "common/optics/pose_file.hpp"
#include "host/camera/registration.hpp"

namespace trocar::camera {
namespace {

struct Marks {
  std::vector<std::pair<int, int>> place{};  // row, col of each
  std::vector<Sighting> sightings{};
};

Marks read_marks(const std::filesystem::path& file) {
  const config::Csv csv =
      config::Csv::load(file, {"t_s,u_px,v_px", "frame,t_s,row,col,u_px,v_px,x_m,y_m,score,valid"}, config::NotANumber::Allowed);
  const bool tracked = csv.header() == 1;
  std::map<std::pair<int, int>, std::size_t> index;
  Marks marks;
  for (const bool counting : {true, false}) {
    for (std::size_t i = 0; i < csv.rows(); ++i) {
      if (tracked && !(csv(i, 9) > 0.0)) continue;  // lost there
      const std::pair<int, int> place = tracked ? std::pair{static_cast<int>(csv(i, 2)), static_cast<int>(csv(i, 3))} : std::pair{0, 0};
      if (counting) {
        index.emplace(place, 0);
        continue;
      }
      const std::size_t t = tracked ? 1 : 0, u = tracked ? 4 : 1;
      if (!std::isfinite(csv(i, t) + csv(i, u) + csv(i, u + 1))) csv.fail(i, "nan where a mark was seen; leave the row out");
      marks.sightings.push_back({csv(i, t), index.at(place), {csv(i, u), csv(i, u + 1)}});
    }
    for (auto& [place, k] : index) {
      if (!counting) break;
      k = marks.place.size();
      marks.place.push_back(place);
    }
  }
  return marks;
}

std::vector<ToolPose> read_poses(const std::filesystem::path& file) {
  const capture::RigLog log = capture::read_capture(file);
  std::vector<ToolPose> poses;
  for (const Sample& s : log.samples) {
    const double t = 1e-9 * static_cast<double>(s.time_ns);
    // The controller started anew: its clock did too. What came last counts.
    if (!poses.empty() && t <= poses.back().t_s) poses.clear();
    bool finite = true;
    for (std::size_t k = 0; k < 3; ++k) finite = finite && std::isfinite(s.pose[k]) && std::isfinite(s.velocity[k]);
    if (finite) poses.push_back({t, s.pose, s.velocity});
  }
  if (poses.empty())
    throw config::UserError(fmt::format("{}: holds no poses of the rig; record while it moves (trocar record)", file.string()));
  return poses;
}

std::string vector_of(const std::array<double, 3>& v) { return fmt::format("[{}]", fmt::join(v, ", ")); }

}  // namespace

int run_register(const RegisterOptions& options) {
  const optics::Camera camera = optics::read_camera(options.camera);
  const Marks marks = read_marks(options.marks);
  const std::vector<ToolPose> poses = read_poses(options.capture);
  std::optional<optics::Pose> phantom;
  if (!options.phantom.empty()) phantom = optics::read_pose(options.phantom);
  RegistrationOptions how{{}, options.delay_s, options.known_delay};
  if (!options.mark_m.empty() && options.mark_m.size() != 2 * marks.place.size())
    throw config::UserError(
        fmt::format("--mark-m: {} numbers for {} marks; give x and y of each", options.mark_m.size(), marks.place.size()));
  for (std::size_t k = 0; k + 1 < options.mark_m.size(); k += 2) how.offset_m.push_back({options.mark_m[k], options.mark_m[k + 1]});

  config::NewFile file(options.out);
  Registration r;
  try {
    r = register_camera(camera.lens, marks.sightings, poses, how);
  } catch (const Undetermined& e) {
    throw config::UserError(fmt::format("{}: {}", options.marks.string(), e.what()));
  }
  auto& out = file.stream();
  out << fmt::format(
      "# The camera over the rig, by trocar camera register.\n[registration]\ndate = \"{:%Y-%m-%dT%H:%M:%SZ}\"\ncamera = {}\nrms_px = {}\n"
      "used = {}\noutliers = {}\noutside = {}\ndelay_s = {}\ndelay_deviation_s = {}\n",
      fmt::gmtime(std::time(nullptr)), config::quote(options.camera.string()), r.rms_px, r.used, r.outliers, r.outside, r.delay_s,
      r.delay_deviation_s);
  out << fmt::format(
      "\n[rig_plane]  # of the marks, in the camera's frame\nrotation_rad = {}\ntranslation_m = {}\nrotation_deviation_rad = {}\n"
      "translation_deviation_m = {}\n",
      vector_of(r.pose.rotation_rad), vector_of(r.pose.translation_m), vector_of(r.pose_deviation.rotation_rad),
      vector_of(r.pose_deviation.translation_m));
  for (std::size_t k = 0; k < marks.place.size(); ++k)
    out << fmt::format("\n[[mark]]\nrow = {}\ncol = {}\nx_m = {}\ny_m = {}\nx_deviation_m = {}\ny_deviation_m = {}\n", marks.place[k].first,
                       marks.place[k].second, r.offset_m[k][0], r.offset_m[k][1], r.offset_deviation_m[k][0], r.offset_deviation_m[k][1]);
  std::string placed;
  if (phantom) {
    const Placement p = place(r.pose, *phantom);
    out << fmt::format("\n[phantom]  # its frame in the rig's\nx_m = {}\ny_m = {}\nheight_m = {}\nangle_rad = {}\ntilt_rad = {}\n", p.x_m,
                       p.y_m, p.height_m, p.angle_rad, p.tilt_rad);
    placed = fmt::format("phantom at ({:.2f}, {:.2f}) mm, {:.2f} mm above the marks, turned by {:.4f} rad, tilted by {:.4f} rad\n",
                         1e3 * p.x_m, 1e3 * p.y_m, 1e3 * p.height_m, p.angle_rad, p.tilt_rad);
  }
  file.keep();

  constexpr double close = 1.5;
  if (r.mirrored_rms_px < close * r.rms_px)
    fmt::print(
        stderr,
        "trocar: {}: the pose mirrored in the line of sight fits nearly as well (RMS {:.3f} px, this one {:.3f} px): its tilt may have "
        "the wrong sign; move over a larger part of the image\n",
        options.marks.string(), r.mirrored_rms_px, r.rms_px);
  if (r.outliers > 0) fmt::print(stderr, "trocar: {}: {} sightings fit nothing and are left out\n", options.marks.string(), r.outliers);
  if (r.outside > 0)
    fmt::print(stderr, "trocar: {}: {} sightings lie outside of the samples in {}, or in a gap of theirs\n", options.marks.string(),
               r.outside, options.capture.string());
  if (options.json) {
    fmt::print(
        "{{\"rms_px\": {}, \"used\": {}, \"outliers\": {}, \"outside\": {}, \"delay_s\": {}, \"rotation_rad\": {}, \"translation_m\": "
        "{}}}\n",
        r.rms_px, r.used, r.outliers, r.outside, r.delay_s, vector_of(r.pose.rotation_rad), vector_of(r.pose.translation_m));
    return 0;
  }
  const auto mm = [](double m) { return 1e3 * m; };
  fmt::print("RMS {:.3f} px over {} sightings\n", r.rms_px, r.used);
  for (std::size_t k = 0; k < 3; ++k)
    fmt::print("{} {:.3f} ± {:.3f} mm, rotation {:.5f} ± {:.5f} rad\n", "xyz"[k], mm(r.pose.translation_m[k]),
               mm(r.pose_deviation.translation_m[k]), r.pose.rotation_rad[k], r.pose_deviation.rotation_rad[k]);
  fmt::print("delay {:.3f} ± {:.3f} ms\n", mm(r.delay_s), mm(r.delay_deviation_s));
  for (std::size_t k = 0; k < marks.place.size(); ++k)
    fmt::print("mark ({}, {}) at ({:.3f} ± {:.3f}, {:.3f} ± {:.3f}) mm in the tool\n", marks.place[k].first, marks.place[k].second,
               mm(r.offset_m[k][0]), mm(r.offset_deviation_m[k][0]), mm(r.offset_m[k][1]), mm(r.offset_deviation_m[k][1]));
  fmt::print("{}{} written\n", placed, options.out.string());
  return 0;
}

}  // namespace trocar::camera
