#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <string>

#include "common/config/user_error.hpp"
#include "common/core/capacities.hpp"
#include "common/needle/tube.hpp"
#include "common/scene/sections.hpp"

namespace trocar::scene {
namespace {

constexpr auto most_beam_elements = static_cast<std::int64_t>(capacity::needle_elements);
constexpr config::Range modulus{1e6, 1e12};
constexpr const char* modulus_remedy = "of the needle, or write material = \"steel\"";

double young_pa(const config::Table& table) {
  if (!table.has("material")) return table.number("young_pa", modulus, modulus_remedy);
  if (table.has("young_pa")) table.fail("young_pa", "the material says the modulus already; remove either material or young_pa");
  return needle::find_material(table.one_of("material", {"steel", "nitinol"}))->young_pa;
}

needle::Bevel bevel_of(const config::Table& table) {
  needle::Bevel bevel;
  const bool angled = table.has("bevel_deg");
  if (table.has("bevel")) {
    (void)table.one_of("bevel", {"symmetric"});
    if (angled) table.fail("bevel_deg", "a symmetric tip has no such angle; remove either bevel or bevel_deg");
  }
  if (!angled) {
    if (table.has("bevel_friction")) table.fail("bevel_friction", "only a face at bevel_deg has it; add bevel_deg or remove this");
    return bevel;
  }
  const double degrees =
      table.number("bevel_deg", {-90.0, 90.0}, "between face and shaft, such as 30; negative with the point on the right");
  if (std::abs(degrees) < 5.0) table.fail("bevel_deg", "flatter than 5 degrees either way; write bevel = \"symmetric\" for a tip without");
  bevel.angle_rad = degrees * std::numbers::pi / 180.0;
  bevel.friction = table.number_or("bevel_friction", 0.0, {0.0, 5.0}, "of tissue on the face, such as 0.3");
  return bevel;
}

}  // namespace

Needle needle_of(const config::Table& table) {
  Needle needle;
  const std::string model = table.one_of("model", {"rigid", "beam", "thesis"});
  needle.model = model == "rigid" ? NeedleModel::Rigid : model == "beam" ? NeedleModel::Beam : NeedleModel::Thesis;
  needle.where = table.where("model");
  needle.length_m = table.number("length_m", {0.005, 1.0}, "from base to tip, such as 0.1");
  const bool beam = needle.model == NeedleModel::Beam;
  const bool thesis = needle.model == NeedleModel::Thesis;
  if (thesis) needle.elements = fem::ThesisNeedleProperties{}.elements;
  needle.elements =
      static_cast<int>(table.integer_or("elements", needle.elements, 1, beam ? most_beam_elements : 1000,
                                        beam ? "along the needle, such as 24 (capacity needle_elements)" : "along the needle, such as 24"));
  // A needle bent to a whole turn would meet itself.
  const double most_curvature = 2.0 * std::numbers::pi / needle.length_m;
  needle.curvature_per_m = table.number_or("curvature_per_m", 0.0, {-most_curvature, most_curvature}, "1 over the radius, such as 5.0");
  if (thesis && needle.curvature_per_m != 0.0)
    table.fail("curvature_per_m", "the needle of the thesis is straight; remove it, or write model = \"beam\"");
  if (needle.model == NeedleModel::Rigid && needle.curvature_per_m != 0.0)
    table.fail("curvature_per_m", "a rigid needle is straight; remove it, or write model = \"beam\"");
  needle.young_stated = table.has("young_pa");
  needle.bevel = bevel_of(table);

  if (table.has("gauge")) {
    for (const char* other : {"outer_m", "inner_m"})
      if (table.has(other)) table.fail(other, "the gauge says the diameters already; remove either gauge or outer_m and inner_m");
    const std::string name = table.text("gauge", "such as \"22G\"");
    const needle::Gauge* const gauge = needle::find_gauge(name);
    if (gauge == nullptr)
      table.fail("gauge", fmt::format("not in the table; write one from \"{}\" to \"{}\", or outer_m, inner_m and young_pa",
                                      needle::gauges().front().name, needle::gauges().back().name));
    needle.outer_m = gauge->outer_m;
    needle.inner_m = gauge->inner_m;
    const bool stated = table.has("material") || table.has("young_pa");
    needle.young_pa = stated ? young_pa(table) : needle::find_material("steel")->young_pa;
    return needle;
  }
  const bool bends = needle.model != NeedleModel::Rigid;
  if (bends || table.has("outer_m"))
    needle.outer_m = table.number("outer_m", {1e-5, 0.02}, "outer diameter, such as 0.000718, or give gauge = \"22G\"");
  if (bends || table.has("inner_m")) {
    needle.inner_m = table.number("inner_m", {0.0, 0.02}, "inner diameter, such as 0.000413; 0 for a solid needle");
    if (!needle.outer_m) table.fail("inner_m", "an inner diameter without an outer one; add outer_m");
    if (*needle.inner_m >= *needle.outer_m)
      table.fail("inner_m", fmt::format("not smaller than outer_m = {}; exchange them", *needle.outer_m));
  }
  if (bends || table.has("young_pa") || table.has("material")) needle.young_pa = young_pa(table);
  return needle;
}

needle::Properties beam_of(const Needle& needle) {
  if (needle.model != NeedleModel::Beam)
    throw config::UserError(
        fmt::format("{}: needle.model = \"{}\": does not bend here; write \"beam\", with gauge or outer_m, inner_m and "
                    "young_pa",
                    needle.where, needle.model == NeedleModel::Rigid ? "rigid" : "thesis"));
  const needle::Section section = needle::section_of(*needle.outer_m, *needle.inner_m, *needle.young_pa);
  return {needle.length_m, section.bending_nm2, section.axial_n, needle.curvature_per_m, static_cast<std::size_t>(needle.elements)};
}

fem::ThesisNeedleProperties triangles_of(const Needle& needle) {
  fem::ThesisNeedleProperties triangles{needle.length_m, *needle.outer_m, *needle.outer_m, *needle.young_pa};
  triangles.elements = needle.elements;
  if (!needle.young_stated)
    triangles.young_pa =
        fem::fitted_young_pa(triangles, needle::section_of(*needle.outer_m, *needle.inner_m, *needle.young_pa).bending_nm2);
  return triangles;
}

}  // namespace trocar::scene
