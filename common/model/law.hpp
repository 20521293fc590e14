// What a scene says about contact, as plain data of fixed size: it is stored in the model image as it stands.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/capacities.hpp"

namespace trocar::contact {

// Snap: the node nearest to where the tip crosses an edge is pulled onto the shaft. Adapt: it is moved, in the reference mesh, along
// that edge onto the needle. Embedded: segments of the path, tied by shape functions. Subdivide: offline (common/fem), never in an image.
enum class Method : std::uint8_t { Embedded, Snap, Adapt, Subdivide };

// Force density over the base's speed along the shaft: a monotone cubic through the rows, constant beyond their ends.
struct VelocityLaw {
  std::uint32_t rows{};  // 0: none
  std::array<double, capacity::velocity_law_rows> speed_m_s{};
  std::array<double, capacity::velocity_law_rows> shaft_n_per_m{};
  std::array<double, capacity::velocity_law_rows> tip_n_per_m{};
};

struct Law {
  Method method{};
  double shaft_n_per_m{};
  double tip_n_per_m{};  // replaces the shaft density over the last tip_zone_m, and only where new tissue is cut
  double tip_zone_m{};
  double spacing_m{};  // of embedded contacts along the path
  VelocityLaw velocity{};
  // Explicit contacts: present from the first step, none added or removed; thresholds symmetric and literal.
  std::uint32_t explicit_count{};
  std::array<std::array<double, 2>, capacity::contacts> explicit_point_m{};
  std::array<double, capacity::contacts> explicit_slip_force_n{};
};

}  // namespace trocar::contact
