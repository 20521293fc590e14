// scene.toml -> what the phantom needs: a planar grid of soft tissue, a rigid needle, stick-slip contact. SI units, rig frame.
//
//   [tissue] model = "plane_stress" | "plane_strain", thickness_m, grid = { size_m, origin_m, nodes, element = "tri3" | "quad4" }
//   [[tissue.material]] young_pa, poisson, (box = [[x0, y0], [x1, y1]])      later entries override earlier ones
//   [[tissue.support]] where = "x_min" | "x_max" | "y_min" | "y_max", or box; fix = ["x", "y"]
//   [needle] model = "rigid", length_m
//   [contact] (method = "embedded"), shaft_n_per_m, tip_n_per_m, tip_zone_m, (velocity_law = "none" or the name of one below)
//   [[velocity_law]] name, speed_m_s, shaft_n_per_m, tip_n_per_m: three arrays of one length, speeds increasing
// Keys in brackets may be left out. With a velocity law its densities hold at every speed, and shaft_n_per_m and tip_n_per_m may be
// left out. Keys of the scene format that this version cannot compute yet are refused as "not available yet".
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace trocar::config {

enum class TissueModel : std::uint8_t { PlaneStress, PlaneStrain };
enum class GridElement : std::uint8_t { Tri3, Quad4 };
enum class GridEdge : std::uint8_t { XMin, XMax, YMin, YMax };

struct SceneBox {
  std::array<double, 2> min_m{};
  std::array<double, 2> max_m{};
};

struct SceneGrid {
  std::array<double, 2> size_m{};
  std::array<double, 2> origin_m{};  // lower left corner
  std::array<int, 2> nodes{};        // along x and y
  GridElement element{};
};

struct SceneMaterial {
  double young_pa{};
  double poisson{};
  std::optional<SceneBox> box{};
};

struct SceneSupport {
  GridEdge edge{};                // when there is no box
  std::optional<SceneBox> box{};  // nodes inside
  bool fix_x{};
  bool fix_y{};
};

struct SceneTissue {
  TissueModel model{};
  double thickness_m{};
  SceneGrid grid{};
  std::vector<SceneMaterial> materials{};  // at least one
  std::vector<SceneSupport> supports{};    // at least one; x and y are both fixed somewhere
};

struct SceneNeedle {
  double length_m{};  // rigid and straight, from base to tip
};

struct SceneVelocityLaw {
  std::string name{};
  std::vector<double> speed_m_s{};
  std::vector<double> shaft_n_per_m{};
  std::vector<double> tip_n_per_m{};
};

struct SceneContact {
  double shaft_n_per_m{};
  double tip_n_per_m{};
  double tip_zone_m{};
  std::optional<SceneVelocityLaw> velocity_law{};
};

struct SceneFile {
  SceneTissue tissue{};
  SceneNeedle needle{};
  SceneContact contact{};
};

[[nodiscard]] SceneFile read_scene(const std::filesystem::path& file);

}  // namespace trocar::config
