// Needles as data: tubes by gauge, their materials, and what a beam needs of them.
#pragma once

#include <span>
#include <string_view>

namespace trocar::needle {

// Nominal diameters of regular-wall tube by Birmingham (Stubs) gauge, as dealers of hypodermic tube list them in thousandths of an inch and
// ISO 9626:2016 (stainless steel needle tubing, 10 to 34 gauge) designates them by 2.1, 1.8 … 0.3 mm. A maker's tolerance is some 0.013 mm
// on the outer and 0.019 mm on the inner diameter, which moves EI of a 22G tube by some 8 %: measure when it matters.
struct Gauge {
  std::string_view name{};
  double outer_m{};
  double inner_m{};
};
[[nodiscard]] std::span<const Gauge> gauges() noexcept;                 // 14G … 30G
[[nodiscard]] const Gauge* find_gauge(std::string_view name) noexcept;  // null for a name that is not there

// Young's modulus below the elastic limit.
//   steel    austenitic stainless steel (1.4301, AISI 304) at 20 degrees C: 200 GPa, EN 10088-1, table of physical properties
//   nitinol  superelastic NiTi, austenite, before its plateau (strain below 1 %): 75 GPa; makers print from 75 to 83 GPa, and 28 to 41 for
//            martensite (Shape Memory Applications Inc., Selected Properties of NiTi, 2003)
struct Material {
  std::string_view name{};
  double young_pa{};
};
[[nodiscard]] std::span<const Material> materials() noexcept;
[[nodiscard]] const Material* find_material(std::string_view name) noexcept;

// Of a round tube, 0 <= inner_m < outer_m.
struct Section {
  double bending_nm2{};  // EI, I = pi (D^4 - d^4) / 64
  double axial_n{};      // EA, A = pi (D^2 - d^2) / 4
};
[[nodiscard]] Section section_of(double outer_m, double inner_m, double young_pa) noexcept;

}  // namespace trocar::needle
