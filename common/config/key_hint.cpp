#include "common/config/key_hint.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace trocar::config {
namespace {

struct Unit {
  std::string_view suffix;    // as it ends a key, without the leading '_'
  std::string_view quantity;  // plural; two suffixes belong together when it is the same
  std::string_view name;      // plural, for a sentence
  std::string_view symbol;
  double si;  // one of it in SI
};

// Longer suffixes come before those that end them (kg_m2 before m2, nm_s_per_rad …): the first match wins.
constexpr std::array units{
    Unit{"n_per_mm", "force densities", "newtons per millimetre", "N/mm", 1e3},
    Unit{"n_per_m", "force densities", "newtons per metre", "N/m", 1.0},
    Unit{"nmm_per_a", "torque constants", "newton millimetres per ampere", "N mm/A", 1e-3},
    Unit{"nm_per_a", "torque constants", "newton metres per ampere", "N m/A", 1.0},
    Unit{"kg_mm2", "inertias", "kilogram square millimetres", "kg mm^2", 1e-6},
    Unit{"g_mm2", "inertias", "gram square millimetres", "g mm^2", 1e-9},
    Unit{"g_cm2", "inertias", "gram square centimetres", "g cm^2", 1e-7},
    Unit{"kg_m2", "inertias", "kilogram square metres", "kg m^2", 1.0},
    Unit{"mm_s2", "accelerations", "millimetres per second squared", "mm/s^2", 1e-3},
    Unit{"m_s2", "accelerations", "metres per second squared", "m/s^2", 1.0},
    Unit{"mm_s3", "jerks", "millimetres per second cubed", "mm/s^3", 1e-3},
    Unit{"m_s3", "jerks", "metres per second cubed", "m/s^3", 1.0},
    Unit{"deg_s2", "angular accelerations", "degrees per second squared", "deg/s^2", 0.017453292519943295},
    Unit{"rad_s2", "angular accelerations", "radians per second squared", "rad/s^2", 1.0},
    Unit{"deg_s", "angular speeds", "degrees per second", "deg/s", 0.017453292519943295},
    Unit{"rad_s", "angular speeds", "radians per second", "rad/s", 1.0},
    Unit{"nm_s", "viscous frictions", "newton metre seconds per radian", "N m s/rad", 1.0},
    Unit{"mm_s", "speeds", "millimetres per second", "mm/s", 1e-3},
    Unit{"m_s", "speeds", "metres per second", "m/s", 1.0},
    Unit{"nmm", "torques", "newton millimetres", "N mm", 1e-3},
    Unit{"nm", "torques", "newton metres", "N m", 1.0},
    Unit{"mn", "forces", "millinewtons", "mN", 1e-3},
    Unit{"kn", "forces", "kilonewtons", "kN", 1e3},
    Unit{"n", "forces", "newtons", "N", 1.0},
    Unit{"mm", "lengths", "millimetres", "mm", 1e-3},
    Unit{"cm", "lengths", "centimetres", "cm", 1e-2},
    Unit{"um", "lengths", "micrometres", "um", 1e-6},
    Unit{"m", "lengths", "metres", "m", 1.0},
    Unit{"deg", "angles", "degrees", "deg", 0.017453292519943295},
    Unit{"rad", "angles", "radians", "rad", 1.0},
    Unit{"kg", "masses", "kilograms", "kg", 1.0},
    Unit{"g", "masses", "grams", "g", 1e-3},
    Unit{"ma", "currents", "milliamperes", "mA", 1e-3},
    Unit{"a", "currents", "amperes", "A", 1.0},
    Unit{"gpa", "moduli", "gigapascals", "GPa", 1e9},
    Unit{"mpa", "moduli", "megapascals", "MPa", 1e6},
    Unit{"kpa", "moduli", "kilopascals", "kPa", 1e3},
    Unit{"pa", "moduli", "pascals", "Pa", 1.0},
    Unit{"us", "times", "microseconds", "us", 1e-6},
    Unit{"ms", "times", "milliseconds", "ms", 1e-3},
    Unit{"s", "times", "seconds", "s", 1.0},
    Unit{"khz", "rates", "kilohertz", "kHz", 1e3},
    Unit{"hz", "rates", "hertz", "Hz", 1.0},
    Unit{"mbps", "bit rates", "megabits per second", "Mbit/s", 1e6},
    Unit{"kbps", "bit rates", "kilobits per second", "kbit/s", 1e3},
    Unit{"bps", "bit rates", "bits per second", "bit/s", 1.0},
};

const Unit* unit_of(std::string_view key) {
  for (const Unit& unit : units) {
    if (!key.ends_with(unit.suffix)) continue;
    const std::string_view stem = key.substr(0, key.size() - unit.suffix.size());
    if (stem.size() < 2 || !stem.ends_with('_')) continue;
    return stem.ends_with("_per_") ? nullptr : &unit;  // counts_per_n is not a force
  }
  return nullptr;
}

std::string_view stem_of(std::string_view key) {
  const Unit* unit = unit_of(key);
  return unit != nullptr ? key.substr(0, key.size() - unit->suffix.size() - 1) : key;
}

// Levenshtein distance; keys are short (document.cpp bounds what it asks for).
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string join(std::span<const double> values, double factor) {
  std::string text;
  for (const double value : values) text += fmt::format("{}{:.10g}", text.empty() ? "" : ", ", value * factor);
  return values.size() == 1 ? text : fmt::format("[{}]", text);
}

constexpr std::size_t longest_compared = 64;

}  // namespace

bool differ_by_unit(std::string_view written, std::string_view wanted) {
  const Unit* a = unit_of(written);
  const Unit* b = unit_of(wanted);
  return stem_of(written) == stem_of(wanted) && written != wanted && (a == nullptr || b == nullptr || a->quantity == b->quantity);
}

std::string unit_advice(std::string_view written, std::string_view wanted, std::span<const double> values) {
  const Unit* from = unit_of(written);
  const Unit* to = unit_of(wanted);
  if (to == nullptr) return fmt::format("write {}, without a unit", wanted);
  if (from == nullptr) return fmt::format("the unit belongs to the name, {} are in {}: write {}", to->quantity, to->name, wanted);
  const std::string rule = fmt::format("{} are in {}", to->quantity, to->name);
  if (values.empty()) return fmt::format("{}: write {}", rule, wanted);
  return fmt::format("{}: write {} = {} for {} {}", rule, wanted, join(values, from->si / to->si), join(values, 1.0), from->symbol);
}

std::string range_advice(std::string_view key, double value, Range range) {
  const Unit* to = unit_of(key);
  if (to == nullptr || (value >= range.min && value <= range.max)) return {};
  for (const Unit& from : units) {
    if (from.quantity != to->quantity || from.suffix == to->suffix) continue;
    const double converted = value * from.si / to->si;
    if (converted >= range.min && converted <= range.max && converted != 0.0) {
      return fmt::format("{} are in {}; if that is {:.10g} {}, write {:.10g}", to->quantity, to->name, value, from.symbol, converted);
    }
  }
  return {};
}

std::string_view nearest(std::string_view written, std::span<const std::string_view> candidates) {
  for (const std::string_view candidate : candidates) {
    if (differ_by_unit(written, candidate)) return candidate;
  }
  if (written.size() > longest_compared) return {};
  std::string_view best;
  std::size_t least = std::max<std::size_t>(2, written.size() / 3) + 1;  // two: neighbouring letters swapped
  for (const std::string_view candidate : candidates) {
    if (candidate.size() > longest_compared) continue;
    const std::size_t d = distance(written, candidate);
    if (d < least && d < std::min(written.size(), candidate.size())) {
      least = d;
      best = candidate;
    }
  }
  return best;
}

}  // namespace trocar::config
