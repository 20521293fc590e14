// Small meshes and tissues that the tests of this folder share.
#pragma once

#include <cmath>
#include <string>

#include "common/fem/mesh.hpp"

namespace trocar::fem::testing {

inline constexpr double young = 25300.0;
inline constexpr double poisson = 0.4;

inline Grid graded_grid(Type type) {
  Grid grid{type, {{{-0.05, -0.03, -0.02, 0.01, 0.05}, {0.0, 0.02, 0.03, 0.07}, {}}}};
  if (element::dimension(type) == 3) grid.axis_m[2] = {0.0, 0.01, 0.03, 0.04};
  return grid;
}

// The inner nodes of a grid moved, so that no element keeps a right angle; the outer ones stay.
inline Mesh distorted(const Grid& grid) {
  Mesh mesh = structured_grid(grid);
  const Box bounds = bounding_box(mesh);
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    Point& x = mesh.node[n];
    bool inner = true;
    for (std::size_t a = 0; a < static_cast<std::size_t>(mesh.dimension()); ++a)
      inner = inner && x[a] > bounds.min_m[a] && x[a] < bounds.max_m[a];
    if (!inner) continue;
    for (std::size_t a = 0; a < static_cast<std::size_t>(mesh.dimension()); ++a)
      x[a] += 0.0015 * std::sin(3.0 * static_cast<double>(n) + 5.0 * static_cast<double>(a));
  }
  return mesh;
}

inline Model model_of(Type type) { return element::dimension(type) == 3 ? Model::Solid : Model::PlaneStress; }

// One material, the upper side (y) held.
inline Tissue block(const Grid& grid) {
  Tissue tissue;
  tissue.model = model_of(grid.element);
  tissue.thickness_m = 0.011;
  tissue.grid = grid;
  tissue.zones = {{{young, poisson}, {}, {}}};
  tissue.supports = {{Side::YMax, {true, true, element::dimension(grid.element) == 3}}};
  return tissue;
}

struct Kind {
  Type type;
  Model model;
  Integration integration;
};

// For the names of parametrised tests: "Quad4PlaneStrainBBar".
inline std::string name_of(const Kind& kind) {
  constexpr const char* type[] = {"Tri3", "Quad4", "Tet4", "Hex8"};
  constexpr const char* model[] = {"PlaneStress", "PlaneStrain", "Solid"};
  return std::string(type[static_cast<int>(kind.type)]) + model[static_cast<int>(kind.model)] +
         (kind.integration == Integration::BBar ? "BBar" : "");
}

// What an action that throws Error says, or nothing.
template <class Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

}  // namespace trocar::fem::testing
