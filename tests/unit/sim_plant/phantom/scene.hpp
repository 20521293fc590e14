// The demo's phantom as plain data, and a hand that moves a needle through it.
#pragma once

#include <cmath>
#include <numbers>

#include "common/fem/mesh.hpp"
#include "sim_plant/phantom/phantom.hpp"

namespace trocar::sim_plant {

inline constexpr double face_m = 0.215;
inline constexpr double needle_m = 0.1;
inline constexpr double shaft_n_per_m = 34.0;
inline constexpr double tip_excess_n = (68.0 - 34.0) * 0.0025;

inline fem::Grid square(int nodes, fem::Type element = fem::Type::Quad4) {
  return fem::uniform_grid(element, {-0.05, face_m, 0.0}, {0.1, 0.1, 0.0}, {nodes, nodes, 1});
}

inline scene::Scene demo_scene() {
  scene::Scene scene;
  scene.tissue.thickness_m = 0.011;
  scene.tissue.grid = square(21);
  scene.tissue.zones = {{{25300.0, 0.48}, {}, {}}};
  scene.tissue.supports = {{fem::Side::YMax, {true, true, false}}};
  scene.needle.emplace().length_m = needle_m;
  scene.contact.emplace();
  scene.contact->shaft_n_per_m = shaft_n_per_m;
  scene.contact->tip_n_per_m = 68.0;
  scene.contact->tip_zone_m = 0.0025;
  return scene;
}

inline contact::VelocityLaw pvc() {
  return {5, {0.001, 0.003, 0.005, 0.007, 0.009}, {34.0, 44.8, 51.9, 56.5, 60.0}, {68.0, 67.5, 66.5, 64.5, 61.0}};
}

// Starts with the tip 5 mm in front of the tissue.
struct Hand {
  explicit Hand(const scene::Scene& scene = demo_scene()) : phantom(scene) { phantom.advance(pose, 1e-3); }

  // Straight in all three coordinates; after_step(previous wrench, wrench) after each.
  template <class AfterStep>
  void move(double dx_m, double dy_m, double dtheta_rad, double speed_m_s, const AfterStep& after_step, double step_m = 1e-5) {
    const double length = std::max(std::hypot(dx_m, dy_m), 0.1 * std::abs(dtheta_rad));
    const int steps = static_cast<int>(std::ceil(length / step_m));
    const std::array<double, 3> from = pose;
    for (int i = 1; i <= steps; ++i) {
      const double s = static_cast<double>(i) / steps;
      pose = {from[0] + s * dx_m, from[1] + s * dy_m, from[2] + s * dtheta_rad};
      const std::array<double, 3> before = phantom.base_wrench();
      after_step(before, phantom.advance(pose, length / steps / speed_m_s));
    }
  }
  void move(double dx_m, double dy_m, double dtheta_rad = 0.0, double speed_m_s = 1e-3) {
    move(dx_m, dy_m, dtheta_rad, speed_m_s, [](const auto&, const auto&) {});
  }

  [[nodiscard]] double path_m() const { return phantom.insertion().working_set().path_m(); }

  std::array<double, 3> pose{0.0, face_m - needle_m - 0.005, std::numbers::pi / 2};
  Phantom phantom;
};

}  // namespace trocar::sim_plant
