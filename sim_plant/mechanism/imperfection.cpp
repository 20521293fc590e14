#include "sim_plant/mechanism/imperfection.hpp"

#include <cstddef>

namespace trocar::sim_plant {

mechanism::TwinModel imperfect(const mechanism::TwinModel& nominal, const Imperfection& imperfection) noexcept {
  mechanism::TwinModel real = nominal;
  const double factor = imperfection.mass_factor;
  const auto heavier = [factor](mechanism::Link& link) {
    link.mass_kg *= factor;
    link.inertia_kg_m2 *= factor;
  };
  for (std::size_t k = 0; k < 2; ++k) {
    mechanism::FiveBarModel& linkage = real.linkage[k];
    for (std::size_t i = 0; i < 2; ++i) {
      linkage.proximal[i].length_m += imperfection.link_error_m[k][i];
      linkage.distal[i].length_m += imperfection.link_error_m[k][2 + i];
      heavier(linkage.proximal[i]);
      heavier(linkage.distal[i]);
      linkage.reflected_inertia_kg_m2[i] *= factor;
    }
    linkage.end_point_mass_kg *= factor;
  }
  real.coupling_m += imperfection.coupling_error_m;
  real.handle_mass_kg *= factor;
  real.handle_inertia_kg_m2 *= factor;
  return real;
}

}  // namespace trocar::sim_plant
