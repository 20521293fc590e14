// A force on a solid, spread over the needle's cross-section: the mean over a ball about a point, of the tissue's shape functions.
//   w_k = (1 / V) integral over the ball of N_k dV,  points outside of the tissue dropped, sum of w = 1
// The same weights carry the force in and the displacement out, so compliance stays symmetric.
//
// Radius. A line load in an elastic solid moves its own line by an amount that depends on its cross-section through a mean of ln(distance)
// alone. Balls of radius a along a line make the areal density k(rho) = 3 sqrt(a^2 - rho^2) / (2 pi a^3); with m(rho) = 1 - (1 -
// rho^2/a^2)^(3/2) the part inside of rho, the mean of ln |rho_1 - rho_2| over k k is that of ln max(rho_1, rho_2):
//   ln a - 1/2 integral over s from 0 to 1 of (1 - (1 - s)^(3/2))^2 / s ds = ln a - (7/4 - 2 ln 2)
// The surface of a cylinder of radius R has the mean ln R. Equal for a = c R, c = e^(7/4) / 4 = 1.4387.
#pragma once

#include <array>
#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::condense {

inline constexpr double ball_per_needle_radius = 1.4386506690014327;  // e^(7/4) / 4

struct NodeWeight {
  int node{};
  double weight{};
};

// Quadrature points and weights in a ball of radius 1: Gauss points in radius, polar angle and azimuth, the two
// angles by hemispheres and quadrants, so that the rule has the symmetry of a brick mesh. 8 n^3 points; weights sum to 1.
struct BallRule {
  std::vector<std::array<double, 3>> point{};
  std::vector<double> weight{};
};
[[nodiscard]] BallRule ball_rule(int n);

// Points in one direction that resolve elements of edge_m under a ball of radius_m: 4 for a ball that is smaller than an element, 2.5 for
// each element along its radius beyond that, at most 24 (by then the mean is over tens of thousands of elements).
[[nodiscard]] int ball_order(double radius_m, double edge_m);

// Increasing nodes. Empty when no quadrature point lies in the tissue.
[[nodiscard]] std::vector<NodeWeight> ball_weights(const fem::Locator& locator, const fem::Point& centre_m, double radius_m,
                                                   const BallRule& rule);

}  // namespace trocar::condense
