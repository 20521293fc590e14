// The embedded method in space: a block of 40 x 40 x 11 mm of bricks, held at y_max, graded towards a needle of 1 mm that goes in 15 mm
// along +y through its middle. The force is spread over the needle's cross-section (common/condense), so refining must converge.
#pragma once

#include <cstddef>

namespace trocar::bench {

struct SolidAnswer {
  double radius_per_element{};
  std::size_t unknowns{};
  std::size_t contacts{};
  double axial_n_per_m{}, lateral_n_per_m{};  // stuck
  double slip_force_n{};                      // in partial slip
  double tip_m{};                             // of the tissue, along the shaft, in partial slip
};

// Elements are radius / radius_per_element at the needle, and along it 4 times that; segments of the path are 1.5 of the latter.
[[nodiscard]] SolidAnswer solid_answer(double radius_per_element);

}  // namespace trocar::bench
