// Finite element kernels: shape functions, stiffness, Green-Lagrange response of one element. Fixed sizes, real-time safe:
// the tick uses the planar ones for mesh adaptation, common/fem all of them.
//   linear          sigma = C eps, eps = B u,  K_e = integral of B^T C B dV      (Voigt: xx, yy, [zz,] xy [, yz, zx], shear as gamma)
//   Green-Lagrange  E = (F^T F - 1) / 2, S = C E (St. Venant-Kirchhoff), f_e = integral of (F^T-weighted B)^T S dV, tangent = d f_e / d u
//   plane stress    C = E/(1-nu^2) [[1, nu, 0], [nu, 1, 0], [0, 0, (1-nu)/2]]                         dV = thickness dA
//   plane strain    C = E/((1+nu)(1-2nu)) [[1-nu, nu, 0], [nu, 1-nu, 0], [0, 0, (1-2nu)/2]]
//   solid           Lame: C_ii = lambda + 2 mu, C_ij = lambda, shear mu
// Degrees of freedom: node by node, x, y[, z]. Local node order: Tri3 and Quad4 counter-clockwise; Tet4 with positive
// volume (x1-x0, x2-x0, x3-x0 right-handed); Hex8 bottom face (zeta = -1) counter-clockwise seen from above, then the top face.
// Full integration: 1 point (Tri3, Tet4), 2 x 2 (Quad4), 2 x 2 x 2 (Hex8). BBar (Quad4, Hex8): the volumetric part of B is replaced by its
// element mean (Hughes 1980), which removes locking near nu = 0.5 in plane strain and in solids; for Tri3 and Tet4 it changes nothing.
// In plane stress BBar equals Full: there is no volumetric constraint to relax. Green-Lagrange BBar averages the trace of E alike; force
// and tangent stay the derivatives of one energy, integral of E_bar:C:E_bar / 2, and u = 0 gives back the linear stiffness. BBar wants an
// isotropic C.
#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace trocar::element {

enum class Type : std::uint8_t { Tri3, Quad4, Tet4, Hex8 };
enum class Model : std::uint8_t { PlaneStress, PlaneStrain, Solid };
enum class Integration : std::uint8_t { Full, BBar };
enum class Status : std::uint8_t { Ok, Inverted };  // Inverted: no positive Jacobian at some integration point

struct Material {
  double young_pa{};
  double poisson{};  // 0 <= nu < 0.5
};

[[nodiscard]] constexpr int node_count(Type type) noexcept { return type == Type::Tri3 ? 3 : type == Type::Hex8 ? 8 : 4; }
[[nodiscard]] constexpr int dimension(Type type) noexcept { return type == Type::Tri3 || type == Type::Quad4 ? 2 : 3; }

using Corners = Eigen::Matrix<double, 3, 8>;      // m, one column a node; planar elements leave z at 0
using Elasticity = Eigen::Matrix<double, 6, 6>;   // Pa; planar models: xx, yy, xy in the leading 3 x 3, then zz (zero in plane stress)
using Stiffness = Eigen::Matrix<double, 24, 24>;  // N/m; the leading (node_count * dimension) rows and columns are used
using Values = Eigen::Matrix<double, 24, 1>;      // displacements [m] or forces [N], same order
using Shape = Eigen::Matrix<double, 8, 1>;        // shape functions at a point
using ShapeGradient = Eigen::Matrix<double, 3, 8>;

// No check: callers at the door refuse young_pa <= 0 and poisson outside of [0, 0.5).
[[nodiscard]] Elasticity elasticity(Model model, const Material& material) noexcept;

// Shape functions and their derivatives with respect to the natural coordinates (unit triangle and tetrahedron, [-1, 1] otherwise).
void shape(Type type, const Eigen::Vector3d& natural, Shape& value, ShapeGradient& gradient) noexcept;

// Natural coordinates of a point; false when Newton does not converge. Points outside of the element are answered too
// (inside() says which): Newton continues the map.
// Planar elements ignore x_m's z and answer 0 for the third coordinate.
[[nodiscard]] bool natural_coordinates(Type type, const Corners& corner, const Eigen::Vector3d& x_m, Eigen::Vector3d& natural) noexcept;
[[nodiscard]] bool inside(Type type, const Eigen::Vector3d& natural, double tolerance) noexcept;

// k is exactly symmetric; its unused rows and columns are zero, and so is all of it when Inverted.
[[nodiscard]] Status stiffness(Type type, Integration integration, const Corners& corner, const Elasticity& c, double thickness_m,
                               Stiffness& k) noexcept;

// Green-Lagrange internal force and consistent tangent (exactly symmetric) at displacement u; zero when Inverted, which looks at the
// undeformed element.
[[nodiscard]] Status response(Type type, Integration integration, const Corners& corner, const Elasticity& c, double thickness_m,
                              const Values& u, Values& force, Stiffness& tangent) noexcept;

}  // namespace trocar::element
