// Mechanisms for the tests. No two parameters are alike, so that swapped sides, links or linkages cannot pass unseen.
#pragma once

#include <numbers>
#include <random>

#include "common/mechanism/twin.hpp"

namespace trocar::mechanism::testing {

inline constexpr double pi = std::numbers::pi;

// The linkage that an independent project publishes: 100/165/165/100 mm, base 85 mm.
inline FiveBarModel published_five_bar() {
  FiveBarModel model;
  model.base_m = 0.085;
  for (Link& link : model.proximal) link = {0.100, 0.03, 0.045, 5e-5};
  for (Link& link : model.distal) link = {0.165, 0.02, 0.080, 9e-5};
  model.end_point_mass_kg = 0.02;
  model.reflected_inertia_kg_m2 = {6e-6, 6e-6};
  return model;
}

inline TwinModel uneven_twin() {
  TwinModel twin;
  FiveBarModel& a = twin.linkage[0];
  a.base_m = 0.08;
  a.proximal = {Link{0.105, 0.024, 0.048, 5.4e-5}, Link{0.110, 0.031, 0.052, 6.1e-5}};
  a.distal = {Link{0.155, 0.019, 0.073, 8.3e-5}, Link{0.150, 0.023, 0.081, 7.7e-5}};
  a.end_point_mass_kg = 0.021;
  a.reflected_inertia_kg_m2 = {4.2e-4, 3.1e-4};
  FiveBarModel& b = twin.linkage[1];
  b.base_m = 0.076;
  b.proximal = {Link{0.100, 0.027, 0.041, 4.9e-5}, Link{0.104, 0.022, 0.057, 5.8e-5}};
  b.distal = {Link{0.160, 0.017, 0.069, 9.1e-5}, Link{0.158, 0.026, 0.077, 6.9e-5}};
  b.end_point_mass_kg = 0.017;
  b.reflected_inertia_kg_m2 = {2.6e-4, 3.7e-4};
  twin.coupling_m = 0.05;
  twin.handle_m = 0.020;
  twin.handle_mass_kg = 0.15;
  twin.handle_com_m = 0.031;
  twin.handle_inertia_kg_m2 = 1.1e-4;
  return twin;
}

// A symmetric machine: both linkages and both sides alike.
inline TwinModel even_twin() {
  TwinModel twin;
  for (FiveBarModel& linkage : twin.linkage) {
    linkage.base_m = 0.08;
    for (Link& link : linkage.proximal) link = {0.105, 0.024, 0.048, 5.4e-5};
    for (Link& link : linkage.distal) link = {0.155, 0.020, 0.074, 8.3e-5};
    linkage.end_point_mass_kg = 0.02;
    linkage.reflected_inertia_kg_m2 = {4e-4, 4e-4};
  }
  twin.coupling_m = 0.05;
  twin.handle_m = 0.025;
  twin.handle_mass_kg = 0.15;
  twin.handle_com_m = 0.025;
  twin.handle_inertia_kg_m2 = 1e-4;
  return twin;
}

// Handle poses over several turns, off the singularities by `least_distance`.
class RandomPoses {
 public:
  explicit RandomPoses(const TwinModel& model, double least_distance = 0.15, unsigned seed = 1)
      : model_(model), least_(least_distance), engine_(seed) {}

  TwinState next() {
    for (;;) {
      const Vec3 x(uniform(-0.08, 0.08), uniform(0.06, 0.24), uniform(-20.0, 20.0));
      TwinState state;
      if (at_pose(model_, x, Vec4::Constant(0.5 * pi), state) == Status::Ok && singularity_distance(model_, state) >= least_) return state;
    }
  }
  double uniform(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(engine_); }
  template <class Vector>
  Vector vector(double size) {
    Vector v;
    for (Eigen::Index i = 0; i < v.size(); ++i) v(i) = uniform(-size, size);
    return v;
  }

 private:
  const TwinModel& model_;
  double least_;
  std::mt19937 engine_;
};

}  // namespace trocar::mechanism::testing
