#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/scene/sections.hpp"

namespace trocar::scene {
namespace {

using config::Table;

constexpr std::array<std::string_view, 6> side_words{"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"};

fem::Where where_of(const Table& entry, bool solid, bool from_file) {
  const auto box = box_of(entry, solid ? 3 : 2);
  if (box && entry.has("where")) entry.fail("where", "a support has either where or box; remove one of the two");
  if (box) return *box;
  if (!from_file) {
    const std::string word = solid ? entry.one_of("where", {"x_min", "x_max", "y_min", "y_max", "z_min", "z_max"})
                                   : entry.one_of("where", {"x_min", "x_max", "y_min", "y_max"});
    return *side_of(word);
  }
  const std::string word = entry.text("where", "a side such as \"y_max\", or a physical group of the mesh file");
  if (const auto side = side_of(word)) return *side;
  return word;
}

}  // namespace

std::optional<fem::Side> side_of(std::string_view word) {
  const auto found = std::find(side_words.begin(), side_words.end(), word);
  if (found == side_words.end()) return std::nullopt;
  return static_cast<fem::Side>(found - side_words.begin());
}

std::optional<fem::Box> box_of(const Table& table, int dimension) {
  if (!table.has("box")) return std::nullopt;
  const auto corners = table.rows("box", static_cast<std::size_t>(dimension), coordinate,
                                  dimension == 2 ? "two opposite corners, such as [[-0.05, 0.0], [0.05, 0.1]]"
                                                 : "two opposite corners, such as [[-0.05, 0.0, 0.0], [0.05, 0.1, 0.01]]");
  if (corners.size() != 2) table.fail("box", fmt::format("a box has 2 corners, this has {}; write [[x0, y0], [x1, y1]]", corners.size()));
  fem::Box box;
  for (std::size_t a = 0; a < static_cast<std::size_t>(dimension); ++a) {
    box.min_m[a] = std::min(corners[0][a], corners[1][a]);
    box.max_m[a] = std::max(corners[0][a], corners[1][a]);
  }
  return box;
}

fem::Tissue tissue_of(const Table& table, const std::filesystem::path& scene_file) {
  if (table.has("image")) table.fail("image", "not available yet; describe the tissue with grid or file");
  fem::Tissue tissue;
  const std::string model = table.one_of("model", {"plane_stress", "plane_strain", "solid"});
  tissue.model = model == "solid" ? fem::Model::Solid : model == "plane_strain" ? fem::Model::PlaneStrain : fem::Model::PlaneStress;
  const bool solid = tissue.model == fem::Model::Solid;
  const bool from_file = table.has("file");
  if (solid && table.has("thickness_m")) table.fail("thickness_m", "a solid's thickness is in its mesh; remove the key");
  if (!solid) tissue.thickness_m = table.number("thickness_m", {1e-4, 1.0}, "of the tissue block, such as 0.011");

  if (from_file && table.has("grid")) table.fail("file", "the tissue has a grid already; remove either grid or file");
  std::optional<Table> grid;
  if (from_file) {
    tissue.mesh_file = scene_file.parent_path() / table.text("file", "a gmsh mesh, such as \"block.msh\"");
  } else {
    grid = table.table("grid");
    tissue.grid = grid_of(*grid, tissue.model);
  }
  if (grid && grid->has("integration") && table.has("integration"))
    table.fail("integration", "the grid has this key as well; remove one of the two");
  const Table& holder = grid && grid->has("integration") ? *grid : table;
  tissue.integration =
      holder.one_of_or("integration", "full", {"full", "bbar"}) == "bbar" ? fem::Integration::BBar : fem::Integration::Full;
  tissue.strain =
      table.one_of_or("strain", "linear", {"linear", "green_lagrange"}) == "linear" ? fem::Strain::Linear : fem::Strain::GreenLagrange;

  for (const Table& entry : table.tables("material")) {
    fem::Zone zone;
    zone.material.young_pa = entry.number("young_pa", {1.0, 1e12}, "soft tissue has 1e3 to 1e5");
    zone.material.poisson = entry.number("poisson", {0.0, 0.4999}, "soft tissue has 0.45 to 0.49; 0.5 cannot be computed");
    zone.box = box_of(entry, solid ? 3 : 2);
    if (entry.has("region")) {
      if (!from_file) entry.fail("region", "a grid has no regions, a mesh file has; use box = [[x0, y0], [x1, y1]]");
      zone.region = entry.text("region", "a physical group of the mesh file");
    }
    tissue.zones.push_back(std::move(zone));
  }
  if (tissue.zones.empty()) table.fail("material", "missing; add one [[tissue.material]] with young_pa and poisson");

  std::array<bool, 3> held{};
  for (const Table& entry : table.tables("support")) {
    fem::Support support;
    support.where = where_of(entry, solid, from_file);
    for (const std::string& axis : solid ? entry.texts("fix", {"x", "y", "z"}) : entry.texts("fix", {"x", "y"}))
      support.fix[axis == "x" ? 0 : axis == "y" ? 1 : 2] = true;
    for (std::size_t a = 0; a < 3; ++a) held[a] = held[a] || support.fix[a];
    tissue.supports.push_back(std::move(support));
  }
  for (std::size_t a = 0; a < (solid ? 3u : 2u); ++a)
    if (!held[a])
      table.fail(
          "support",
          fmt::format("nothing holds the tissue along {}; add a [[tissue.support]] such as where = \"y_max\", fix = [\"x\", \"y\"{}]",
                      "xyz"[a], solid ? ", \"z\"" : ""));
  return tissue;
}

}  // namespace trocar::scene
