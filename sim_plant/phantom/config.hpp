// What a scene file says about phantom, needle and contact, as plain data. SI units.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "common/fem/tissue.hpp"

namespace trocar::sim_plant {

// Force densities over the base's speed along the shaft: a monotone cubic through the rows, constant beyond their ends.
struct VelocityLaw {
  std::string name{};
  std::vector<double> speed_m_s{};  // increasing
  std::vector<double> shaft_n_per_m{};
  std::vector<double> tip_n_per_m{};
};

struct NeedleConfig {
  double length_m{};  // rigid and straight, from base to tip
};

struct ContactConfig {
  double shaft_n_per_m{};
  double tip_n_per_m{};  // replaces the shaft density over the last tip_zone_m while new tissue is cut
  double tip_zone_m{};
  std::optional<VelocityLaw> velocity_law{};  // when given, its densities replace the two above at every speed
};

struct PhantomConfig {
  fem::Tissue tissue{};
  NeedleConfig needle{};
  ContactConfig contact{};
};

}  // namespace trocar::sim_plant
