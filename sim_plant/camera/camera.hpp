// The camera over the simulated phantom: what its markers do under the needle's contact forces, as images.
//   surface   takes the markers' displacements u = A f out of a planar phantom: f the contacts' forces on the candidate nodes, A the
//             compliance of the model image. Nothing of it is computed in a step of the plant, only when a frame is due.
//   camera    renders them with the needle's shadow (common/optics/render.hpp)
// Markers lie on a grid in the tissue's plane, the first at the corner of least x and y of a grid scene, phantom frame parallel to the rig
// frame: a marker's place in the rig is origin_m + (x, y).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/contact/geometry.hpp"
#include "common/optics/render.hpp"
#include "common/optics/simulated_camera.hpp"
#include "common/scene/scene.hpp"
#include "sim_plant/phantom/phantom.hpp"

namespace trocar::sim_plant {

struct SurfaceState {  // of one instant
  std::int64_t time_ns{};
  std::vector<optics::PlanePoint> marker{};  // phantom frame
  std::array<double, 3> base_pose{};         // of the needle, rig frame
};

class Surface {
 public:
  // Throws config::UserError: a scene that is no planar grid, markers outside of its candidates.
  Surface(const Phantom& phantom, const scene::Scene& scene, const optics::MarkerGrid& grid);
  // O(markers x loaded nodes): some tenths of a millisecond for 441. The phantom stands still meanwhile.
  void take(const Phantom& phantom, std::int64_t time_ns, const std::array<double, 3>& base_pose, SurfaceState& state);
  [[nodiscard]] std::array<double, 2> origin_m() const noexcept { return origin_; }

 private:
  optics::MarkerGrid grid_;
  std::array<double, 2> origin_{};
  std::vector<contact::Embedding> at_{};
  std::vector<std::uint32_t> loaded_{};
  std::vector<double> force_{};  // of each candidate degree of freedom
  std::vector<bool> seen_{};
};

class Camera {
 public:
  // Throws config::UserError: no such camera, one that does not see the phantom.
  Camera(const optics::SimulatedCamera& config, const std::array<double, 2>& origin_m, double needle_length_m, std::uint64_t seed);
  // Velocities, for blur and rolling shutter, are those since the last frame.
  void render(const SurfaceState& state, std::uint64_t number, optics::Frame& frame);
  [[nodiscard]] std::span<const optics::MarkerTruth> truth() const noexcept { return renderer_.truth(); }
  [[nodiscard]] const optics::Pose& pose() const noexcept { return renderer_.view().pose(); }

 private:
  optics::MarkerGrid grid_;
  std::array<double, 2> origin_{};
  double length_m_{};
  optics::Renderer renderer_;
  std::vector<optics::MarkerState> states_{};
  std::vector<optics::PlanePoint> before_{};
  std::int64_t before_ns_{};
};

}  // namespace trocar::sim_plant
