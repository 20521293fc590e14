#include "common/needle/tube.hpp"

#include <algorithm>
#include <array>
#include <numbers>

namespace trocar::needle {
namespace {

constexpr std::array table{Gauge{"14G", 2.108e-3, 1.600e-3}, Gauge{"15G", 1.829e-3, 1.372e-3}, Gauge{"16G", 1.651e-3, 1.194e-3},
                           Gauge{"17G", 1.473e-3, 1.067e-3}, Gauge{"18G", 1.270e-3, 0.838e-3}, Gauge{"19G", 1.067e-3, 0.686e-3},
                           Gauge{"20G", 0.908e-3, 0.603e-3}, Gauge{"21G", 0.819e-3, 0.514e-3}, Gauge{"22G", 0.718e-3, 0.413e-3},
                           Gauge{"23G", 0.641e-3, 0.337e-3}, Gauge{"24G", 0.565e-3, 0.311e-3}, Gauge{"25G", 0.514e-3, 0.260e-3},
                           Gauge{"26G", 0.464e-3, 0.260e-3}, Gauge{"27G", 0.413e-3, 0.210e-3}, Gauge{"28G", 0.362e-3, 0.184e-3},
                           Gauge{"29G", 0.337e-3, 0.184e-3}, Gauge{"30G", 0.312e-3, 0.159e-3}};
constexpr std::array metals{Material{"steel", 200e9}, Material{"nitinol", 75e9}};

template <class Table>
auto find(const Table& in, std::string_view name) noexcept -> decltype(in.data()) {
  const auto at = std::find_if(in.begin(), in.end(), [&](const auto& entry) { return entry.name == name; });
  return at == in.end() ? nullptr : &*at;
}

}  // namespace

std::span<const Gauge> gauges() noexcept { return table; }
const Gauge* find_gauge(std::string_view name) noexcept { return find(table, name); }
std::span<const Material> materials() noexcept { return metals; }
const Material* find_material(std::string_view name) noexcept { return find(metals, name); }

Section section_of(double outer_m, double inner_m, double young_pa) noexcept {
  const double outer2 = outer_m * outer_m;
  const double inner2 = inner_m * inner_m;
  const double area_m2 = std::numbers::pi / 4.0 * (outer2 - inner2);
  return {young_pa * area_m2 * (outer2 + inner2) / 16.0, young_pa * area_m2};
}

}  // namespace trocar::needle
