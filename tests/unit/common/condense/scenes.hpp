// Small scenes as plain data.
#pragma once

#include "common/fem/mesh.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense::testing {

// 100 x 100 x 11 mm in the plane, held at y_max, two materials.
inline scene::Scene planar_scene(fem::Type element = fem::Type::Quad4, int nodes = 11) {
  scene::Scene s;
  s.tissue.model = fem::Model::PlaneStress;
  s.tissue.thickness_m = 0.011;
  s.tissue.grid = fem::uniform_grid(element, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {nodes, nodes, 1});
  fem::Zone all{.material = {25.3e3, 0.48}};
  fem::Zone stiff{.material = {63e3, 0.3}};
  stiff.box = fem::Box{{-1.0, 0.06, -1.0}, {1.0, 1.0, 1.0}};
  s.tissue.zones = {all, stiff};
  s.tissue.supports = {{fem::Side::YMax, {true, true, false}}};
  s.needle = scene::Needle{.length_m = 0.1};
  s.contact = contact::Law{.shaft_n_per_m = 34.0, .tip_n_per_m = 68.0, .tip_zone_m = 0.0025};
  s.visible = fem::Box{};
  return s;
}

// 60 x 60 x 16 mm of bricks, held at y_max; the plane z = 0 holds nodes.
inline scene::Scene solid_scene(double needle_diameter_m = 1e-3, fem::Type element = fem::Type::Hex8) {
  scene::Scene s;
  s.tissue.model = fem::Model::Solid;
  s.tissue.grid = fem::uniform_grid(element, {-0.03, 0.0, -0.008}, {0.06, 0.06, 0.016}, {7, 7, 5});
  s.tissue.zones = {{.material = {25.3e3, 0.45}}};
  s.tissue.supports = {{fem::Side::YMax, {true, true, true}}};
  s.needle = scene::Needle{.length_m = 0.1, .outer_m = needle_diameter_m};
  s.contact = contact::Law{.shaft_n_per_m = 34.0, .tip_n_per_m = 68.0, .tip_zone_m = 0.0025};
  s.visible = fem::Side::ZMax;
  return s;
}

}  // namespace trocar::condense::testing
