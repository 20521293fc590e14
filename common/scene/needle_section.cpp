#include <fmt/format.h>

#include <array>
#include <string>

#include "common/scene/sections.hpp"

namespace trocar::scene {
namespace {

struct Gauge {
  const char* name;
  double outer_m;
  double inner_m;
};

// Nominal diameters of steel tubes with a regular wall, as dealers of needles list them.
constexpr std::array gauges{Gauge{"14G", 2.108e-3, 1.600e-3}, Gauge{"15G", 1.829e-3, 1.372e-3}, Gauge{"16G", 1.651e-3, 1.194e-3},
                            Gauge{"17G", 1.473e-3, 1.067e-3}, Gauge{"18G", 1.270e-3, 0.838e-3}, Gauge{"19G", 1.067e-3, 0.686e-3},
                            Gauge{"20G", 0.908e-3, 0.603e-3}, Gauge{"21G", 0.819e-3, 0.514e-3}, Gauge{"22G", 0.718e-3, 0.413e-3},
                            Gauge{"23G", 0.641e-3, 0.337e-3}, Gauge{"24G", 0.565e-3, 0.311e-3}, Gauge{"25G", 0.514e-3, 0.260e-3},
                            Gauge{"26G", 0.464e-3, 0.260e-3}, Gauge{"27G", 0.413e-3, 0.210e-3}, Gauge{"28G", 0.362e-3, 0.184e-3},
                            Gauge{"29G", 0.337e-3, 0.184e-3}, Gauge{"30G", 0.312e-3, 0.159e-3}};
constexpr double steel_young_pa = 200e9;

}  // namespace

Needle needle_of(const config::Table& table) {
  Needle needle;
  const std::string model = table.one_of("model", {"rigid", "beam", "thesis"});
  needle.model = model == "rigid" ? NeedleModel::Rigid : model == "beam" ? NeedleModel::Beam : NeedleModel::Thesis;
  needle.where = table.where("model");
  needle.length_m = table.number("length_m", {0.005, 1.0}, "from base to tip, such as 0.1");
  needle.elements = static_cast<int>(table.integer_or("elements", needle.elements, 1, 1000, "along the needle, such as 24"));

  if (table.has("gauge")) {
    for (const char* other : {"outer_m", "inner_m"})
      if (table.has(other)) table.fail(other, "the gauge says the diameters already; remove either gauge or outer_m and inner_m");
    const std::string name = table.text("gauge", "such as \"22G\"");
    for (const Gauge& gauge : gauges)
      if (name == gauge.name) {
        needle.outer_m = gauge.outer_m;
        needle.inner_m = gauge.inner_m;
      }
    if (!needle.outer_m)
      table.fail("gauge", fmt::format("not in the table; write one from \"{}\" to \"{}\", or outer_m, inner_m and young_pa",
                                      gauges.front().name, gauges.back().name));
    needle.young_pa = table.number_or("young_pa", steel_young_pa, {1e6, 1e12}, "of the needle, steel has 200e9");
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
  if (bends || table.has("young_pa")) needle.young_pa = table.number("young_pa", {1e6, 1e12}, "of the needle, steel has 200e9");
  return needle;
}

}  // namespace trocar::scene
