// B-bar: the volumetric part of the strain is one number an element, so that near nu = 0.5 an element has one constraint, not one a point.
#include "cases.hpp"

namespace trocar::element {
namespace {

constexpr Case quad_full{Type::Quad4, Model::PlaneStrain, Integration::Full};
constexpr Case quad_bbar{Type::Quad4, Model::PlaneStrain, Integration::BBar};
constexpr Case brick_full{Type::Hex8, Model::Solid, Integration::Full};
constexpr Case brick_bbar{Type::Hex8, Model::Solid, Integration::BBar};

// Modes whose stiffness follows the bulk modulus rather than the shear modulus.
int volumetric_modes(const Case& c, const Corners& corner) {
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, {1.0, 0.5 - 1e-7}, 1.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k / corner.topLeftCorner(3, node_count(c.type)).cwiseAbs().maxCoeff());
  return static_cast<int>((eigen.eigenvalues().array() > 1e3).count());
}

// The divergence of a bilinear field on a rectangle spans 1, x, y; of a trilinear one on a box 1, x, y, z, xy, yz, zx.
TEST(BBar, LeavesOneVolumetricModeInPlaceOfThreeAndSeven) {
  const Corners square = reference(Type::Quad4);
  const Corners cube = reference(Type::Hex8);
  EXPECT_EQ(volumetric_modes(quad_full, square), 3);
  EXPECT_EQ(volumetric_modes(quad_bbar, square), 1);
  EXPECT_EQ(volumetric_modes(brick_full, cube), 7);
  EXPECT_EQ(volumetric_modes(brick_bbar, cube), 1);
  Random random(1);
  for (int trial = 0; trial < 5; ++trial) {
    EXPECT_EQ(volumetric_modes(quad_bbar, distorted(Type::Quad4, random, 0.2, 1.0)), 1);
    EXPECT_EQ(volumetric_modes(brick_bbar, distorted(Type::Hex8, random, 0.2, 1.0)), 1);
  }
}

// Another way to the same matrix: K = integral of the deviatoric part at the points + bulk modulus x volume x mean divergence squared.
TEST(BBar, EqualsDeviatoricPartPlusMeanVolumetricPart) {
  Random random(2);
  for (const Case& c : {quad_bbar, brick_bbar}) {
    const int d = dimension(c.type);
    const int n = node_count(c.type);
    for (const double poisson : {0.0, 0.3, 0.48, 0.4999}) {
      const Corners corner = distorted(c.type, random, 0.25);
      const Material material{25300.0, poisson};
      const Lame lame(c.model, material);
      Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(n * d, n * d);
      Eigen::VectorXd divergence = Eigen::VectorXd::Zero(n * d);
      double volume = 0.0;
      for (const GaussPoint& p : gauss(c.type, 2)) {
        double determinant = 0.0;
        const Eigen::MatrixXd g = gradients(c.type, corner, p.natural, determinant);
        const double dv = p.weight * determinant * (d == 2 ? thickness : 1.0);
        volume += dv;
        for (int a = 0; a < n; ++a)
          for (int i = 0; i < d; ++i) {
            divergence(a * d + i) += g(i, a) * dv;
            for (int b = 0; b < n; ++b)
              for (int j = 0; j < d; ++j)  // 2 mu dev(eps):eps with the deviator of three dimensions
                expected(a * d + i, b * d + j) +=
                    lame.mu * dv * ((i == j) * g.col(a).dot(g.col(b)) + g(j, a) * g(i, b) - 2.0 / 3.0 * g(i, a) * g(j, b));
          }
      }
      expected += lame.bulk / volume * divergence * divergence.transpose();
      EXPECT_LT(relative(kernel_stiffness(c, corner, material, thickness), expected), 1e-12);
    }
  }
}

TEST(BBar, ChangesNothingInPlaneStressOrInSimplices) {
  Random random(3);
  for (const Case& c : all_cases()) {
    if (c.integration == Integration::Full) continue;
    const Corners corner = distorted(c.type, random, 0.2);
    Case full = c;
    full.integration = Integration::Full;
    const bool same = simplex(c.type) || c.model == Model::PlaneStress;
    const Eigen::MatrixXd a = kernel_stiffness(c, corner, tissue, thickness);
    const Eigen::MatrixXd b = kernel_stiffness(full, corner, tissue, thickness);
    if (same)
      EXPECT_EQ(a, b);
    else
      EXPECT_GT(relative(a, b), 0.01);
  }
}

// Bending of a square at a constant moment: u = (x y, -x^2/2). Full integration resists with the bulk modulus; B-bar with the shear
// modulus.
TEST(BBar, BendsWithoutChangingItsVolume) {
  const Corners corner = reference(Type::Quad4);
  Eigen::VectorXd u(8);
  for (int k = 0; k < 4; ++k) u.segment<2>(2 * k) << corner(0, k) * corner(1, k), 0.0;
  double full[2], bbar[2];
  int i = 0;
  for (const double poisson : {0.4, 0.49999}) {
    full[i] = u.dot(kernel_stiffness(quad_full, corner, {1.0, poisson}, 1.0) * u);
    bbar[i] = u.dot(kernel_stiffness(quad_bbar, corner, {1.0, poisson}, 1.0) * u);
    ++i;
  }
  EXPECT_GT(full[1] / full[0], 1000.0);
  EXPECT_LT(bbar[1] / bbar[0], 1.0);  // the shear modulus falls a little
}

}  // namespace
}  // namespace trocar::element
