// Parameters of the five-bar linkage and of the twin. Constant after start-up; every number comes from a rig file.
//
//   Five-bar, in its own frame (origin midway between the motor axes, motor 0 at (-base_m/2, 0), motor 1 at (+base_m/2, 0)):
//     motor i --proximal[i]--> elbow i --distal[i]--> end point P, common to both sides; theta_i counter-clockwise from +x.
//     Assembly mode: cross(elbow1 - elbow0, P - elbow0) > 0.
//   Twin: linkages 0 and 1 in parallel planes on the same axes; a rigid coupling joins their end points:
//     theta = direction P0 -> P1;  handle (needle base) = P0 + handle_m * (cos theta, sin theta).
//   Drives are numbered 0..3 = linkage 0 left, linkage 0 right, linkage 1 left, linkage 1 right.
#pragma once

#include <array>

namespace trocar::mechanism {

struct Link {
  double length_m{};
  double mass_kg{};
  double com_m{};          // centre of mass from the motor-side joint, along the link
  double inertia_kg_m2{};  // about the centre of mass
};

struct FiveBarModel {
  std::array<Link, 2> proximal{};
  std::array<Link, 2> distal{};
  double base_m{};
  double end_point_mass_kg{};                       // joint hardware at P
  std::array<double, 2> reflected_inertia_kg_m2{};  // rotor inertia times gear ratio squared, at each active joint
};

struct TwinModel {
  std::array<FiveBarModel, 2> linkage{};
  double coupling_m{};            // |P1 - P0|
  double handle_m{};              // handle point from P0 along the coupling
  double handle_mass_kg{};        // coupling, handle, sensor and needle together
  double handle_com_m{};          // its centre of mass from P0 along the coupling
  double handle_inertia_kg_m2{};  // about that centre of mass
};

}  // namespace trocar::mechanism
