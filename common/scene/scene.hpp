// scene.toml -> plain data. SI units, scene frame: x, y is the needle's plane, y the axis of insertion. Keys in brackets may be left out.
//
//   [tissue]
//     model = "plane_stress" | "plane_strain" | "solid"
//     thickness_m                                    planar models only, and required there
//     exactly one of
//       grid = { size_m, origin_m, nodes, element, (spacing) }   lists of 2 (planar) or 3 (solid) entries
//       grid = { x_m, y_m, (z_m), element }          the node coordinates themselves, increasing
//       file = "block.msh"                           gmsh, relative to the scene file
//       element = "tri3" | "quad4" | "tet4" | "hex8"
//       spacing = one entry an axis: "uniform" or { towards_m, smallest_m } or { towards_m, ratio }: a node lies at towards_m, element
//         sizes grow away from it by one factor, from smallest_m (the factor follows) or by `ratio` (the smallest follows); `nodes` holds
//     (integration = "full" | "bbar"), (strain = "linear" | "green_lagrange")
//   [[tissue.material]] young_pa, poisson, (box = [[x0, y0(, z0)], [x1, y1(, z1)]]), (region = "name")
//     later entries override earlier ones
//   [[tissue.support]] where = "x_min" … "z_max" | "group", or box; fix = ["x", "y", "z"]
//   [needle] model = "rigid" | "beam" | "thesis", length_m, gauge = "22G" or outer_m, inner_m (a rigid one needs none),
//     (material = "steel" | "nitinol" or young_pa; steel with a gauge, required without), (elements), (curvature_per_m: of the unloaded
//     needle, counter-clockwise), (bevel = "symmetric", or bevel_deg: angle between face and shaft, positive with the point on the left;
//     with it bevel_friction), common/needle/tube.hpp and bevel.hpp say more
//     model = "thesis" (fem/thesis_needle.hpp; `trocar needle bend` alone): elements 15 unless stated, straight; young_pa is that of the
//     triangles, such as 980e6 as printed, and without it they get the compliance of the tube in its material
//   [contact] (method = "embedded" | "snap" | "adapt" | "subdivide"), shaft_n_per_m, tip_n_per_m, tip_zone_m,
//     (velocity_law = "none" or a name below),
//     (spacing_m: of embedded contacts; unless stated an edge, 0.88 of triangles' mean one, 1.5 in a solid),
//     (points_m = [[x, y], …] with slip_force_n = […]: explicit contacts, and the three densities may be left out),
//     (corridor = { from_m, to_m, half_width_m }), (plane_z_m), (visible = side, group or "all"), (storage = "float64" | "float32")
//   [[velocity_law]] name, speed_m_s, shaft_n_per_m, tip_n_per_m: three arrays of one length, speeds increasing. With a law its densities
//     hold at every speed, and shaft_n_per_m and tip_n_per_m may be left out.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "common/fem/thesis_needle.hpp"
#include "common/fem/tissue.hpp"
#include "common/model/law.hpp"
#include "common/needle/beam.hpp"
#include "common/needle/bevel.hpp"

namespace trocar::scene {

enum class NeedleModel : std::uint8_t { Rigid, Beam, Thesis };

struct Needle {
  NeedleModel model{};
  double length_m{};                                       // from base to tip
  std::optional<double> outer_m{}, inner_m{}, young_pa{};  // diameters of the tube; a rigid needle may have none
  bool young_stated{};                                     // rather than a material's
  int elements{24};
  double curvature_per_m{};
  needle::Bevel bevel{};
  std::string where{};  // FILE:LINE of the model, for those who cannot compute it
};

// Candidates are the nodes of the needle's plane up to half_width_m away from the segment from_m … to_m.
struct Corridor {
  std::array<double, 2> from_m{};
  std::array<double, 2> to_m{};
  double half_width_m{};
};

struct Scene {
  std::filesystem::path file{};
  fem::Tissue tissue{};
  std::optional<Needle> needle{};
  std::optional<contact::Law> contact{};  // spacing_m is 0 when the scene leaves it to the mesh
  std::string velocity_law{};             // its name, empty without one
  std::optional<Corridor> corridor{};     // none: the whole plane
  std::optional<double> plane_z_m{};      // of the needle's plane in a solid; none: the middle of the tissue
  fem::Where visible{};                   // unless stated: every node of a planar mesh, the side z_max of a solid
  bool single_precision{};                // how the image stores compliance
};

// Throws config::UserError: "FILE:LINE: key = value: what is wrong; what to do". No mesh is made: groups, regions and supports that hold
// nothing are found by common/fem.
[[nodiscard]] Scene read_scene(const std::filesystem::path& file);

// The table [needle] of a scene file, or of a file that has no other. Throws config::UserError.
[[nodiscard]] Needle read_needle(const std::filesystem::path& file);

// Throws config::UserError unless the needle's model is "beam".
[[nodiscard]] needle::Properties beam_of(const Needle& needle);

// The triangles of the model "thesis", as deep and thick as the tube; their modulus as stated, or fitted to the tube.
[[nodiscard]] fem::ThesisNeedleProperties triangles_of(const Needle& needle);

// For commands that insert: throws config::UserError for a scene without needle or contact, or with the offline model of the thesis.
void require_insertion(const Scene& scene);

// Where a needle enters a grid: the middle of its side y_min, {x_m, y_m}. Throws config::UserError for a tissue that comes from a file.
[[nodiscard]] std::array<double, 2> entry_m(const Scene& scene);

}  // namespace trocar::scene
