#include "common/config/scene_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <initializer_list>
#include <string_view>
#include <utility>

#include "common/config/document.hpp"

namespace trocar::config {
namespace {

constexpr Range coordinate{-10.0, 10.0};
constexpr Range density{0.0, 1e5};

// Keys that the scene format has and this version cannot compute.
void refuse_later_keys(const Table& table, std::initializer_list<std::string_view> keys, std::string_view instead) {
  for (const std::string_view key : keys) {
    if (table.has(key)) table.fail(key, fmt::format("not available yet; {}", instead));
  }
}

// One of `now`; values of the format that come later are told apart from mistakes.
std::string choice(const Table& table, std::string_view key, std::initializer_list<std::string_view> now,
                   std::initializer_list<std::string_view> later) {
  const std::string written = table.has(key) ? table.text(key, fmt::format("such as \"{}\"", *now.begin())) : std::string();
  if (std::find(later.begin(), later.end(), written) != later.end()) {
    table.fail(key, fmt::format("not available yet; write \"{}\"", fmt::join(now, "\" or \"")));
  }
  return table.one_of(key, now);
}

std::optional<SceneBox> box_of(const Table& table) {
  if (!table.has("box")) return std::nullopt;
  const auto corners = table.rows("box", 2, coordinate, "two opposite corners, such as [[-0.05, 0.0], [0.05, 0.1]]");
  if (corners.size() != 2) table.fail("box", fmt::format("a box has 2 corners, this has {}; write [[x0, y0], [x1, y1]]", corners.size()));
  SceneBox box{};
  for (std::size_t i = 0; i < 2; ++i) {
    box.min_m[i] = std::min(corners[0][i], corners[1][i]);
    box.max_m[i] = std::max(corners[0][i], corners[1][i]);
  }
  return box;
}

SceneGrid grid_of(const Table& table) {
  refuse_later_keys(table, {"spacing", "spacing_m"}, "the grid is uniform: remove the key");
  SceneGrid grid{};
  grid.size_m = table.numbers<2>("size_m", {1e-4, 10.0}, "[width, height], such as [0.1, 0.1]");
  grid.origin_m = table.numbers<2>("origin_m", coordinate, "the lower left corner in the rig frame, such as [-0.05, 0.15]");
  const auto nodes = table.integers<2>("nodes", 2, 401, "along x and y, such as [21, 21]");
  std::transform(nodes.begin(), nodes.end(), grid.nodes.begin(), [](std::int64_t n) { return static_cast<int>(n); });
  grid.element = choice(table, "element", {"tri3", "quad4"}, {"tet4", "hex8"}) == "tri3" ? GridElement::Tri3 : GridElement::Quad4;
  if (table.has("integration")) choice(table, "integration", {"full"}, {"bbar", "b_bar", "reduced", "selective"});
  return grid;
}

SceneTissue tissue_of(const Table& table) {
  refuse_later_keys(table, {"file", "image"}, "describe the tissue with grid = { size_m, origin_m, nodes, element }");
  SceneTissue tissue{};
  tissue.model = choice(table, "model", {"plane_stress", "plane_strain"}, {"solid"}) == "plane_stress" ? TissueModel::PlaneStress
                                                                                                       : TissueModel::PlaneStrain;
  tissue.thickness_m = table.number("thickness_m", {1e-4, 1.0}, "of the tissue block, such as 0.011");
  tissue.grid = grid_of(table.table("grid"));

  for (const Table& entry : table.tables("material")) {
    refuse_later_keys(entry, {"region"}, "use box = [[x0, y0], [x1, y1]]");
    SceneMaterial material{};
    material.young_pa = entry.number("young_pa", {1.0, 1e12}, "soft tissue has 1e3 to 1e5");
    material.poisson = entry.number("poisson", {0.0, 0.4999}, "soft tissue has 0.45 to 0.49; 0.5 cannot be computed");
    material.box = box_of(entry);
    tissue.materials.push_back(material);
  }
  if (tissue.materials.empty()) table.fail("material", "missing; add one [[tissue.material]] with young_pa and poisson");
  if (tissue.materials.front().box)
    table.fail("material", "the first one must hold everywhere; give it no box and put those with a box after it");

  bool x_fixed = false;
  bool y_fixed = false;
  for (const Table& entry : table.tables("support")) {
    SceneSupport support{};
    support.box = box_of(entry);
    if (support.box && entry.has("where")) entry.fail("where", "a support has either where or box; remove one of the two");
    if (!support.box) {
      const std::string where = choice(entry, "where", {"x_min", "x_max", "y_min", "y_max"}, {"z_min", "z_max"});
      support.edge = where == "x_min"   ? GridEdge::XMin
                     : where == "x_max" ? GridEdge::XMax
                     : where == "y_min" ? GridEdge::YMin
                                        : GridEdge::YMax;
    }
    for (const std::string& axis : entry.texts("fix", {"x", "y"})) (axis == "x" ? support.fix_x : support.fix_y) = true;
    x_fixed = x_fixed || support.fix_x;
    y_fixed = y_fixed || support.fix_y;
    tissue.supports.push_back(support);
  }
  if (!x_fixed || !y_fixed) {
    table.fail("support",
               fmt::format("nothing holds the tissue along {}; add a [[tissue.support]] such as where = \"y_max\", fix = [\"x\", \"y\"]",
                           x_fixed ? "y" : "x"));
  }
  return tissue;
}

std::vector<SceneVelocityLaw> velocity_laws(const Table& root) {
  std::vector<SceneVelocityLaw> laws;
  for (const Table& entry : root.tables("velocity_law")) {
    SceneVelocityLaw law{};
    law.name = entry.text("name", "the name that contact.velocity_law gives");
    if (law.name == "none") entry.fail("name", "this word stands for no law; choose another name");
    if (std::any_of(laws.begin(), laws.end(), [&](const auto& other) { return other.name == law.name; })) {
      entry.fail("name", "another [[velocity_law]] has this name; give each its own");
    }
    law.speed_m_s = entry.list("speed_m_s", {0.0, 10.0}, "increasing, such as [0.001, 0.003, 0.009]");
    law.shaft_n_per_m = entry.list("shaft_n_per_m", density, "one for each speed");
    law.tip_n_per_m = entry.list("tip_n_per_m", density, "one for each speed");
    if (std::adjacent_find(law.speed_m_s.begin(), law.speed_m_s.end(), std::greater_equal<>()) != law.speed_m_s.end()) {
      entry.fail("speed_m_s", "must increase from each entry to the next; sort the three arrays together");
    }
    for (const auto& [key, size] :
         {std::pair{"shaft_n_per_m", law.shaft_n_per_m.size()}, std::pair{"tip_n_per_m", law.tip_n_per_m.size()}}) {
      if (size != law.speed_m_s.size()) {
        entry.fail(key, fmt::format("{} entries for {} speeds; write one for each speed", size, law.speed_m_s.size()));
      }
    }
    laws.push_back(std::move(law));
  }
  return laws;
}

SceneContact contact_of(const Table& table, const std::vector<SceneVelocityLaw>& laws, double needle_length_m) {
  refuse_later_keys(table, {"points_m", "slip_force_n"}, "contacts are placed along the path that the tip cuts: remove the key");
  if (table.has("method")) choice(table, "method", {"embedded"}, {"snap", "adapt", "subdivide"});
  SceneContact contact{};
  const std::string law = table.text_or("velocity_law", "none", "\"none\", or the name of a [[velocity_law]]");
  if (law != "none") {
    const auto found = std::find_if(laws.begin(), laws.end(), [&](const auto& candidate) { return candidate.name == law; });
    if (found == laws.end()) {
      std::string names;
      for (const SceneVelocityLaw& known : laws) names += fmt::format(", \"{}\"", known.name);
      table.fail("velocity_law", fmt::format("no [[velocity_law]] of this file has that name; write one of \"none\"{}", names));
    }
    contact.velocity_law = *found;
  }
  constexpr std::string_view shaft = "friction along the shaft, such as 34";
  constexpr std::string_view tip = "in the tip zone while it cuts, such as 68";
  contact.shaft_n_per_m = contact.velocity_law
                              ? table.number_or("shaft_n_per_m", contact.velocity_law->shaft_n_per_m.front(), density, shaft)
                              : table.number("shaft_n_per_m", density, shaft);
  contact.tip_n_per_m = contact.velocity_law ? table.number_or("tip_n_per_m", contact.velocity_law->tip_n_per_m.front(), density, tip)
                                             : table.number("tip_n_per_m", density, tip);
  contact.tip_zone_m = table.number("tip_zone_m", {0.0, 0.1}, "over which tip_n_per_m replaces shaft_n_per_m, such as 0.0025");
  if (contact.tip_zone_m >= needle_length_m) {
    table.fail("tip_zone_m", fmt::format("not shorter than the needle ({} m); shorten the zone", needle_length_m));
  }
  return contact;
}

}  // namespace

SceneFile read_scene(const std::filesystem::path& file) {
  const Document document = Document::load(file);
  const Table root = document.root();
  SceneFile scene{};
  scene.tissue = tissue_of(root.table("tissue"));
  const Table needle = root.table("needle");
  choice(needle, "model", {"rigid"}, {"beam", "thesis"});
  refuse_later_keys(needle, {"gauge", "outer_m", "inner_m", "young_pa", "elements"},
                    "a rigid needle needs its length_m alone: remove the key");
  scene.needle.length_m = needle.number("length_m", {0.005, 1.0}, "from base to tip, such as 0.1");
  scene.contact = contact_of(root.table("contact"), velocity_laws(root), scene.needle.length_m);
  document.refuse_unknown_keys();
  return scene;
}

}  // namespace trocar::config
