#include "cases.hpp"

namespace trocar::element {
namespace {

class EachStiffness : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Element, EachStiffness, testing::ValuesIn(all_cases()), case_name);

int rigid_modes(Type type) { return dimension(type) == 2 ? 3 : 6; }

TEST_P(EachStiffness, IsSymmetricAndEmptyBeyondItsNodes) {
  Random random(1);
  const Case c = GetParam();
  Stiffness k = Stiffness::Constant(7.0);
  ASSERT_EQ(stiffness(c.type, c.integration, distorted(c.type, random, 0.2), elasticity(c.model, tissue), thickness, k), Status::Ok);
  EXPECT_EQ(k, k.transpose());
  const int size = node_count(c.type) * dimension(c.type);
  EXPECT_TRUE(k.rightCols(24 - size).isZero(0.0));
  EXPECT_TRUE(k.bottomRows(24 - size).isZero(0.0));
}

TEST_P(EachStiffness, LeavesExactlyTheRigidMotionsWithoutEnergy) {
  Random random(2);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, tissue, thickness);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k);
  const double largest = eigen.eigenvalues().maxCoeff();
  const int modes = rigid_modes(c.type);
  for (int i = 0; i < modes; ++i) EXPECT_LT(std::abs(eigen.eigenvalues()(i)), 1e-13 * largest);
  EXPECT_GT(eigen.eigenvalues()(modes), 1e-5 * largest);

  // Translations and infinitesimal rotations, one by one.
  const int d = dimension(c.type);
  for (int mode = 0; mode < modes; ++mode) {
    Eigen::VectorXd u = Eigen::VectorXd::Zero(k.rows());
    for (int n = 0; n < node_count(c.type); ++n) {
      if (mode < d) {
        u(n * d + mode) = 0.01;
      } else {
        const Eigen::Vector3d axis = d == 2 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::Unit(mode - d);
        u.segment(n * d, d) = leading(axis.cross(corner.col(n)), d);
      }
    }
    EXPECT_LT((k * u).norm(), 1e-13 * largest * u.norm());
  }
}

TEST_P(EachStiffness, TurnsWithTheElement) {
  Random random(3);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, tissue, thickness);
  for (const double angle : {0.3, 1.7, -2.9}) {
    const Eigen::Matrix3d r = rotation(c.type, angle);
    const Eigen::MatrixXd blocks = block_rotation(c.type, r);
    EXPECT_LT(relative(kernel_stiffness(c, r * corner, tissue, thickness), blocks * k * blocks.transpose()), 1e-12);
  }
}

TEST_P(EachStiffness, DoesNotDependOnWhichCornerIsFirst) {
  Random random(4);
  const Case c = GetParam();
  const int d = dimension(c.type);
  const int n = node_count(c.type);
  const std::vector<int> order = c.type == Type::Tri3    ? std::vector{1, 2, 0}
                                 : c.type == Type::Quad4 ? std::vector{1, 2, 3, 0}
                                 : c.type == Type::Tet4  ? std::vector{1, 2, 0, 3}
                                                         : std::vector{1, 5, 6, 2, 0, 4, 7, 3};  // the face xi = 1 becomes the bottom
  const Corners corner = distorted(c.type, random, 0.2);
  Corners turned = Corners::Zero();
  Eigen::MatrixXd permutation = Eigen::MatrixXd::Zero(n * d, n * d);
  for (int k = 0; k < n; ++k) {
    turned.col(k) = corner.col(order[static_cast<std::size_t>(k)]);
    permutation.block(k * d, order[static_cast<std::size_t>(k)] * d, d, d).setIdentity();
  }
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, tissue, thickness);
  EXPECT_LT(relative(kernel_stiffness(c, turned, tissue, thickness), permutation * k * permutation.transpose()), 1e-13);
}

TEST_P(EachStiffness, GrowsWithYoungThicknessAndSize) {
  Random random(5);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, tissue, thickness);
  const bool planar = dimension(c.type) == 2;
  EXPECT_LT(relative(kernel_stiffness(c, corner, {3 * tissue.young_pa, tissue.poisson}, thickness), 3 * k), 1e-14);
  EXPECT_LT(relative(kernel_stiffness(c, corner, tissue, 3 * thickness), planar ? Eigen::MatrixXd(3 * k) : k), 1e-14);
  EXPECT_LT(relative(kernel_stiffness(c, 2 * corner, tissue, thickness), planar ? k : Eigen::MatrixXd(2 * k)), 1e-14);
}

// Against fourth-order tensors. With the same points for any shape; with 5 points, which are exact, where the kernels' rule is: elements
// whose Jacobian is constant.
TEST_P(EachStiffness, EqualsAnIndependentIntegration) {
  const Case c = GetParam();
  if (c.integration == Integration::BBar && c.model != Model::PlaneStress) return;  // bbar_test.cpp
  Random random(6);
  for (int trial = 0; trial < 10; ++trial) {
    const Corners odd = distorted(c.type, random, 0.25);
    EXPECT_LT(relative(kernel_stiffness(c, odd, tissue, thickness), reference_stiffness(c, odd, tissue, thickness, 2)), 1e-13);
    const Corners affine = distorted(c.type, random, 0.0);
    EXPECT_LT(relative(kernel_stiffness(c, affine, tissue, thickness), reference_stiffness(c, affine, tissue, thickness, 5)), 1e-13);
  }
}

// First row of the square's matrix in closed form (Cook, Concepts and Applications of Finite Element Analysis; also in Sigmund 2001).
TEST(Stiffness, SquareInPlaneStressMatchesTheClosedForm) {
  const double nu = 0.3;
  const Case c{Type::Quad4, Model::PlaneStress, Integration::Full};
  const Eigen::MatrixXd k = kernel_stiffness(c, 0.5 * reference(Type::Quad4), {1.0, nu}, 1.0);
  const double row[8] = {1.0 / 2 - nu / 6,  1.0 / 8 + nu / 8, -1.0 / 4 - nu / 12,  -1.0 / 8 + 3 * nu / 8, -1.0 / 4 + nu / 12,
                         -1.0 / 8 - nu / 8, nu / 6,           1.0 / 8 - 3 * nu / 8};
  for (int j = 0; j < 8; ++j) EXPECT_NEAR(k(0, j), row[j] / (1 - nu * nu), 1e-15);
}

// Right triangle with legs 1: K_00 = t/2 (C_11 + C_33), K_01 = t/2 (C_12 + C_33).
TEST(Stiffness, RightTriangleMatchesTheHandCase) {
  const Case c{Type::Tri3, Model::PlaneStrain, Integration::Full};
  const Lame lame(Model::PlaneStrain, tissue);
  const Eigen::MatrixXd k = kernel_stiffness(c, reference(Type::Tri3), tissue, 2.0);
  EXPECT_NEAR(k(0, 0) / (lame.lambda + 3 * lame.mu), 1.0, 1e-15);
  EXPECT_NEAR(k(0, 1) / (lame.lambda + lame.mu), 1.0, 1e-15);
  EXPECT_NEAR(k(2, 2) / (lame.lambda + 2 * lame.mu), 1.0, 1e-15);
  EXPECT_NEAR(k(2, 5) / lame.lambda, 1.0, 1e-15);
}

// The three models are one law: solid with eps_zz = 0 is plane strain, solid with sigma_zz = 0 is plane stress.
TEST(Stiffness, ElasticityReducesToThePlane) {
  const Elasticity solid = elasticity(Model::Solid, tissue);
  const Elasticity strain = elasticity(Model::PlaneStrain, tissue);
  const Elasticity stress = elasticity(Model::PlaneStress, tissue);
  const int of_solid[4] = {0, 1, 3, 2};  // xx, yy, xy, zz
  for (int i = 0; i < 4; ++i)
    for (int j = 0; j < 4; ++j) {
      EXPECT_NEAR(strain(i, j), solid(of_solid[i], of_solid[j]), 1e-9);
      const double condensed = solid(of_solid[i], of_solid[j]) - solid(of_solid[i], 2) * solid(2, of_solid[j]) / solid(2, 2);
      EXPECT_NEAR(stress(i, j), i == 3 || j == 3 ? 0.0 : condensed, 1e-9);
    }
  EXPECT_NEAR(1.0 / solid.inverse()(0, 0), tissue.young_pa, 1e-8);
  EXPECT_NEAR(-solid.inverse()(0, 1) * tissue.young_pa, tissue.poisson, 1e-12);
}

TEST_P(EachStiffness, SaysWhenTheElementIsInverted) {
  Random random(7);
  const Case c = GetParam();
  const Elasticity e = elasticity(c.model, tissue);
  Stiffness k;
  Corners mirrored = distorted(c.type, random, 0.1);
  mirrored.row(0) *= -1.0;
  EXPECT_EQ(stiffness(c.type, c.integration, mirrored, e, thickness, k), Status::Inverted);
  EXPECT_TRUE(k.isZero(0.0));
  Corners flat = distorted(c.type, random, 0.1);
  flat.row(1) = flat.row(0);
  EXPECT_EQ(stiffness(c.type, c.integration, flat, e, thickness, k), Status::Inverted);
  Corners broken = distorted(c.type, random, 0.1);
  broken(0, 1) = std::nan("");
  EXPECT_EQ(stiffness(c.type, c.integration, broken, e, thickness, k), Status::Inverted);
  broken(0, 1) = std::numeric_limits<double>::infinity();
  EXPECT_EQ(stiffness(c.type, c.integration, broken, e, thickness, k), Status::Inverted);
  if (!simplex(c.type)) {  // one corner pushed through the opposite side
    Corners dented = distorted(c.type, random, 0.1);
    const Eigen::Vector3d across = dented.col(2) - dented.col(0);
    dented.col(0) += 1.5 * across;
    EXPECT_EQ(stiffness(c.type, c.integration, dented, e, thickness, k), Status::Inverted);
  }
  Values u = Values::Zero(), force = Values::Constant(1.0);
  EXPECT_EQ(response(c.type, c.integration, mirrored, e, thickness, u, force, k), Status::Inverted);
  EXPECT_TRUE(force.isZero(0.0));
  EXPECT_TRUE(k.isZero(0.0));
}

}  // namespace
}  // namespace trocar::element
