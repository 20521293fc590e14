// What a hand feels of a display on the haptic rig's axis, whole chain with guard, encoder, friction and delay: stiffness of a
// rendered spring pressed slowly, and mass and damping of free space.
#pragma once

#include <string>
#include <vector>

#include "tests/benchmarks/haptic/z_width.hpp"

namespace trocar::bench {

struct FeltRow {
  std::string scheme{};
  double rendered_n_m{};
  double felt_n_m{};  // slope of the hand's force against the true position
  double ripple_n{};  // rms of the force about that line: friction, damping, limit cycles
  double least_energy_j{};
};

struct FreeRow {
  std::string scheme{};
  double frequency_hz{};
  double mass_kg{}, damping_n_s_m{};  // of f_h = (m s + b) v at that frequency; Coulomb friction shows as damping
};

[[nodiscard]] FeltRow felt_stiffness(const Scheme& scheme, double rendered_n_m);
[[nodiscard]] FreeRow free_space(const Scheme& scheme, double frequency_hz);

}  // namespace trocar::bench
