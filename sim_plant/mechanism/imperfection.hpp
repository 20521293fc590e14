// How the true mechanism differs from the one that the controller believes in.
#pragma once

#include <array>

#include "common/mechanism/model.hpp"

namespace trocar::sim_plant {

struct Imperfection {
  double mass_factor{1.0};  // of every mass, inertia and rotor
  // Added to the lengths: [linkage][proximal left, proximal right, distal left, distal right].
  std::array<std::array<double, 4>, 2> link_error_m{};
  double coupling_error_m{};
};

[[nodiscard]] mechanism::TwinModel imperfect(const mechanism::TwinModel& nominal, const Imperfection& imperfection) noexcept;

}  // namespace trocar::sim_plant
