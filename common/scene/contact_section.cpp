#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>
#include <vector>

#include "common/scene/sections.hpp"

namespace trocar::scene {
namespace {

using config::Range;
using config::Table;

constexpr Range density{0.0, 1e5};

struct NamedLaw {
  std::string name;
  contact::VelocityLaw law;
};

std::vector<NamedLaw> velocity_laws(const Table& root) {
  std::vector<NamedLaw> laws;
  for (const Table& entry : root.tables("velocity_law")) {
    NamedLaw named;
    named.name = entry.text("name", "the name that contact.velocity_law gives");
    if (named.name == "none") entry.fail("name", "this word stands for no law; choose another name");
    if (std::any_of(laws.begin(), laws.end(), [&](const auto& other) { return other.name == named.name; }))
      entry.fail("name", "another [[velocity_law]] has this name; give each its own");
    const auto speed = entry.list("speed_m_s", {0.0, 10.0}, "increasing, such as [0.001, 0.003, 0.009]");
    const auto shaft = entry.list("shaft_n_per_m", density, "one for each speed");
    const auto tip = entry.list("tip_n_per_m", density, "one for each speed");
    if (std::adjacent_find(speed.begin(), speed.end(), std::greater_equal<>()) != speed.end())
      entry.fail("speed_m_s", "must increase from each entry to the next; sort the three arrays together");
    for (const auto& [key, size] : {std::pair{"shaft_n_per_m", shaft.size()}, std::pair{"tip_n_per_m", tip.size()}})
      if (size != speed.size()) entry.fail(key, fmt::format("{} entries for {} speeds; write one for each speed", size, speed.size()));
    if (speed.size() > capacity::velocity_law_rows)
      entry.fail("speed_m_s", fmt::format("{} speeds; a velocity law carries at most {} (capacity velocity_law_rows): leave some out",
                                          speed.size(), capacity::velocity_law_rows));
    named.law.rows = static_cast<std::uint32_t>(speed.size());
    std::copy(speed.begin(), speed.end(), named.law.speed_m_s.begin());
    std::copy(shaft.begin(), shaft.end(), named.law.shaft_n_per_m.begin());
    std::copy(tip.begin(), tip.end(), named.law.tip_n_per_m.begin());
    laws.push_back(std::move(named));
  }
  return laws;
}

void read_velocity_law(const Table& root, const Table& table, Scene& scene) {
  const std::vector<NamedLaw> laws = velocity_laws(root);
  const std::string name = table.text_or("velocity_law", "none", "\"none\", or the name of a [[velocity_law]]");
  if (name == "none") return;
  const auto found = std::find_if(laws.begin(), laws.end(), [&](const auto& candidate) { return candidate.name == name; });
  if (found == laws.end()) {
    std::string names;
    for (const NamedLaw& known : laws) names += fmt::format(", \"{}\"", known.name);
    table.fail("velocity_law", fmt::format("no [[velocity_law]] of this file has that name; write one of \"none\"{}", names));
  }
  scene.velocity_law = name;
  scene.contact->velocity = found->law;
}

// Contacts that are given: points and thresholds, one for each.
void read_explicit_contacts(const Table& table, contact::Law& law) {
  if (!table.has("points_m")) {
    if (table.has("slip_force_n"))
      table.fail("slip_force_n", "thresholds without contacts; add points_m = [[x, y], …] with as many entries");
    return;
  }
  const auto points = table.rows("points_m", 2, coordinate, "the contacts, such as [[0.0, -0.05], [0.0, -0.045]]");
  const auto forces = table.list("slip_force_n", {0.0, 1e9}, "one for each point, such as 0.085");
  if (forces.size() != points.size())
    table.fail("slip_force_n", fmt::format("{} entries for {} points; write one for each point", forces.size(), points.size()));
  if (points.size() > capacity::contacts)
    table.fail("points_m", fmt::format("{} contacts; the tick carries at most {} (capacity contacts): leave some out", points.size(),
                                       capacity::contacts));
  law.explicit_count = static_cast<std::uint32_t>(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    law.explicit_point_m[i] = {points[i][0], points[i][1]};
    law.explicit_slip_force_n[i] = forces[i];
  }
}

void read_densities(const Table& table, const Scene& scene, contact::Law& law) {
  const auto read = [&](std::string_view key, double lowest_speed, std::string_view remedy) {
    if (law.velocity.rows > 0) return table.number_or(key, lowest_speed, density, remedy);
    return law.explicit_count > 0 ? table.number_or(key, 0.0, density, remedy) : table.number(key, density, remedy);
  };
  law.shaft_n_per_m = read("shaft_n_per_m", law.velocity.shaft_n_per_m[0], "friction along the shaft, such as 34");
  law.tip_n_per_m = read("tip_n_per_m", law.velocity.tip_n_per_m[0], "in the tip zone while it cuts, such as 68");
  constexpr Range zone{0.0, 0.1};
  constexpr std::string_view remedy = "over which tip_n_per_m replaces shaft_n_per_m, such as 0.0025";
  law.tip_zone_m = law.explicit_count > 0 ? table.number_or("tip_zone_m", 0.0, zone, remedy) : table.number("tip_zone_m", zone, remedy);
  if (scene.needle && law.tip_zone_m >= scene.needle->length_m)
    table.fail("tip_zone_m", fmt::format("not shorter than the needle ({} m); shorten the zone", scene.needle->length_m));
}

}  // namespace

void read_contact(const Table& root, const Table& table, Scene& scene) {
  const bool solid = scene.tissue.model == fem::Model::Solid;
  contact::Law& law = scene.contact.emplace();
  const std::string method = table.one_of_or("method", "embedded", {"embedded", "snap", "adapt", "subdivide"});
  law.method = method == "embedded" ? contact::Method::Embedded
               : method == "snap"   ? contact::Method::Snap
               : method == "adapt"  ? contact::Method::Adapt
                                    : contact::Method::Subdivide;
  read_velocity_law(root, table, scene);
  read_explicit_contacts(table, law);
  read_densities(table, scene, law);
  if (table.has("spacing_m")) law.spacing_m = table.number("spacing_m", {1e-5, 0.1}, "between contacts along the path, such as 0.005");

  if (const auto corridor = table.optional_table("corridor")) {
    scene.corridor = Corridor{corridor->numbers<2>("from_m", coordinate, "one end of the axis of the path, such as [0.0, -0.05]"),
                              corridor->numbers<2>("to_m", coordinate, "the other end, such as [0.0, 0.05]"),
                              corridor->number("half_width_m", {1e-4, 10.0}, "around that axis, such as 0.015")};
    if (scene.corridor->from_m == scene.corridor->to_m) corridor->fail("to_m", "the same point as from_m; a corridor needs a length");
  }
  if (table.has("plane_z_m")) {
    if (!solid) table.fail("plane_z_m", "a planar model is the needle's plane itself; remove the key");
    scene.plane_z_m = table.number("plane_z_m", coordinate, "height of the needle's plane, such as 0.0055");
  }
  if (table.has("visible")) {
    const std::string word = table.text("visible", "\"all\", a side such as \"z_max\", or a group of the mesh file");
    const auto side = side_of(word);
    if (side && !solid && *side >= fem::Side::ZMin) table.fail("visible", "a planar model has no such side; write \"all\"");
    if (!side && word != "all" && scene.tissue.grid)
      table.fail("visible", "a grid has no groups; write \"all\" or a side such as \"z_max\"");
    scene.visible = word == "all" ? fem::Where(fem::Box{}) : side ? fem::Where(*side) : fem::Where(word);
  }
  scene.single_precision = table.one_of_or("storage", "float64", {"float64", "float32"}) == "float32";
}

}  // namespace trocar::scene
