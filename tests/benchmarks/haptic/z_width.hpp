// Which virtual walls K + B s a one-axis device may show: those with which no passive hand makes the loop unstable.
// A tick of the real firmware chain on the axis (no encoder steps, no Coulomb friction, guard off, nothing saturated) is a linear
// map of its state; its matrix is read off with unit states, exact for the sampled loop. Stable with every mass and spring of a
// grid of undamped hands is what "passive" means here: a necessary condition, and for a linear port, over all passive hands, also
// a sufficient one (Colgate and Schenkel 1997). The device's damping is in the plant: with none, no wall at all is passive.
#pragma once

#include <string>
#include <vector>

#include "firmware/control/haptic.hpp"
#include "tests/reference/haptic_axis/haptic_axis.hpp"

namespace trocar::bench {

struct Scheme {
  std::string name{};
  control::Display display{};
  double adaptive_damping_n_s_m{};  // B_a frozen at some |f_e|
};

struct WallRow {
  std::string scheme{};
  double tick_hz{};
  double damping_n_s_m{};  // B of the wall
  double stiffness_n_m{};  // the largest K that is passive, as is every smaller one down to the least; 0 for none
};

inline constexpr double least_wall_n_m = 10.0, most_wall_n_m = 3e4;

[[nodiscard]] double spectral_radius(const reference::AxisPlant& plant, const reference::Hand& hand, const Scheme& scheme,
                                     double stiffness_n_m, double damping_n_s_m);
[[nodiscard]] WallRow largest_wall(const reference::AxisPlant& plant, const Scheme& scheme, double damping_n_s_m);

}  // namespace trocar::bench
