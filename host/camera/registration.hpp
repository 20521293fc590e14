// Where the camera stands over the rig, from a probing motion: the rig moves its needle, and the camera follows one mark or more that go
// with it.
//   at time t of the rig's clock the tool is at (x, y, theta), theta from base to tip                              (samples of the rig)
//   mark k in the rig frame   p = (x, y) + Rot(theta) o_k                      o_k: its place in the tool, first number along the needle
//   seen at                   PlaneView(lens, pose).project(p(t + delay))      pose: the rig's plane at the marks' height, in the camera's
//   frame
// Unknown: pose (6), delay, and o_k of each mark when the tool turned. Start: direct linear transformation of the rectified rays on
// (x, y, 1, cos theta, sin theta); then least squares of the pixels by Levenberg-Marquardt, from that pose and from its mirror image in the
// line of sight, which a weak perspective hardly tells apart.
#pragma once

#include <array>
#include <optional>
#include <stdexcept>
#include <vector>

#include "common/optics/plane.hpp"

namespace trocar::camera {

struct Sighting {
  double t_s{};
  std::size_t mark{};
  optics::Pixel pixel{};
};

struct ToolPose {  // of the rig, in time
  double t_s{};
  std::array<double, 3> pose{};      // x_m, y_m, theta_rad
  std::array<double, 3> velocity{};  // m/s, m/s, rad/s
};

struct RegistrationOptions {
  std::vector<std::array<double, 2>> offset_m{};  // of each mark, when it is known; else it is found, and the tool has to turn
  double delay_s{};                               // the frames' times plus this are the rig's; where the search begins, or what it is
  bool known_delay{};
};

struct Registration {
  optics::Pose pose{};
  double delay_s{};
  std::vector<std::array<double, 2>> offset_m{};
  // Standard deviations by least squares; 0 for what was given. Rotation about the camera's axes.
  optics::Pose pose_deviation{};
  double delay_deviation_s{};
  std::vector<std::array<double, 2>> offset_deviation_m{};
  double rms_px{};  // of the distances, over the sightings used
  std::size_t used{};
  std::size_t outliers{};    // further off than five robust standard deviations: left out
  std::size_t outside{};     // sightings before the first pose or after the last, or in a gap of the poses: left out
  double mirrored_rms_px{};  // of the mirror image; close to rms_px: the pose's tilt may have the wrong sign
};

// The motion does not determine the registration: what() says what is missing and what to do.
struct Undetermined : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Poses further apart than this are a gap, over which nothing is interpolated.
inline constexpr double longest_gap_s = 0.05;

// `poses` with increasing times, finite. Throws Undetermined.
[[nodiscard]] Registration register_camera(const optics::Lens& lens, const std::vector<Sighting>& sightings,
                                           const std::vector<ToolPose>& poses, const RegistrationOptions& options);

// The phantom frame in the rig frame, from the poses of both planes in the camera's frame: a point (x, y) of the phantom's surface lies
// at T (x, y, 0), T = rig^-1 phantom.
struct Placement {
  double x_m{}, y_m{}, height_m{};  // of the phantom frame's origin; height above the plane of the marks, along the rig's z
  double angle_rad{};               // of the phantom's x axis in the rig's plane, from +x counter-clockwise
  double tilt_rad{};                // between the two planes' normals; pi when one looks down where the other looks up
};
[[nodiscard]] Placement place(const optics::Pose& rig, const optics::Pose& phantom);

}  // namespace trocar::camera
