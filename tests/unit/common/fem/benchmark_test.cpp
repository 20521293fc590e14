// Cases with a known answer: Cook's membrane, and pure bending, whose exact solution is quadratic. Locking is measured on both.
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using Eigen::VectorXd;
using testing::Kind;
using testing::name_of;

// Corners (0, 0), (48, 44), (48, 60), (0, 44); n x n quads. The left side is held, the right one carries a shear force of 1 in all.
// Bricks: one layer of thickness 1, held across it.
double cook(const Kind& kind, double nu, int n) {
  const bool solid = kind.type == Type::Hex8;
  Mesh mesh = structured_grid(uniform_grid(kind.type, {0, 0, 0}, {1, 1, 1}, {n + 1, n + 1, 2}));
  for (Point& x : mesh.node) x = {48 * x[0], 44 * x[0] + x[1] * (44 - 28 * x[0]), x[2]};
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size()) * mesh.dimension());
  for (std::size_t k = 0; k < mesh.node.size(); ++k) {
    const Point& x = mesh.node[k];
    if (x[0] < 1e-9) mesh.group["left"].push_back(static_cast<int>(k));
    if (x[0] > 48 - 1e-9) {
      const bool end = x[1] < 44 + 1e-9 || x[1] > 60 - 1e-9;
      load(static_cast<Eigen::Index>(k) * mesh.dimension() + 1) = (end ? 0.5 : 1.0) / n * (solid ? 0.5 : 1.0);
    }
  }
  Tissue tissue;
  tissue.model = kind.model;
  tissue.integration = kind.integration;
  tissue.thickness_m = 1.0;
  tissue.zones = {{{1.0, nu}, {}, {}}};
  tissue.supports = {{std::string("left"), {true, true, false}}};
  if (solid)
    for (const Side side : {Side::ZMin, Side::ZMax}) tissue.supports.push_back({side, {false, false, true}});
  const VectorXd u = Statics(mesh, tissue).solve(load);
  return u(Locator(mesh).nearest_node({48, 52, 0}) * mesh.dimension() + 1);
}

constexpr Kind plane_stress{Type::Quad4, Model::PlaneStress, Integration::Full};
constexpr Kind strain_full{Type::Quad4, Model::PlaneStrain, Integration::Full};
constexpr Kind strain_bbar{Type::Quad4, Model::PlaneStrain, Integration::BBar};
constexpr Kind brick_full{Type::Hex8, Model::Solid, Integration::Full};
constexpr Kind brick_bbar{Type::Hex8, Model::Solid, Integration::BBar};

TEST(Cook, PlaneStressConvergesTo2396) {
  double before = 1.0;
  for (const int n : {4, 8, 16, 32, 64, 128}) {  // 18.30, 22.08, 23.43, 23.82, 23.92, 23.95: the corner at (0, 44) slows it down
    const double error = 1.0 - cook(plane_stress, 1.0 / 3, n) / 23.96;
    EXPECT_LT(error, before / 2);
    before = error;
  }
  EXPECT_LT(std::abs(before), 0.0005);
  // Triangles get there as well, later.
  EXPECT_NEAR(cook({Type::Tri3, Model::PlaneStress, Integration::Full}, 1.0 / 3, 64), 23.96, 0.2);
}

// On 16 x 16, over the fine mesh, nu = 0.3 … 0.4999: full 0.98, 0.88, 0.48, 0.31; B-bar 0.99 throughout.
TEST(Cook, FullIntegrationLocksInPlaneStrainAndBBarDoesNot) {
  for (const double nu : {0.3, 0.48, 0.499, 0.4999}) {
    const double reference = cook(strain_bbar, nu, 64);
    const double full = cook(strain_full, nu, 16) / reference;
    const double bbar = cook(strain_bbar, nu, 16) / reference;
    EXPECT_NEAR(bbar, 1.0, 0.02);
    if (nu > 0.49) {
      EXPECT_LT(full, 0.5);
    }
  }
}

// A layer of bricks held across its thickness is plane strain, digit by digit, B-bar included.
TEST(Cook, ALayerOfBricksIsPlaneStrain) {
  for (const double nu : {0.3, 0.4999}) {
    EXPECT_NEAR(cook(brick_full, nu, 8) / cook(strain_full, nu, 8), 1.0, 1e-9);
    EXPECT_NEAR(cook(brick_bbar, nu, 8) / cook(strain_bbar, nu, 8), 1.0, 1e-9);
  }
}

// A bar 100 x 20 (x 20) mm, bent to the curvature 1 / m by stresses sigma_xx = E' y on its end: the middle of the end falls by length^2
// / 2. Returns that deflection over the exact one.
double bending(const Kind& kind, double nu, int refinement) {
  const int d = element::dimension(kind.type);
  const bool plane_strain = kind.model == Model::PlaneStrain;
  Tissue tissue;
  tissue.model = kind.model;
  tissue.integration = kind.integration;
  tissue.thickness_m = 0.011;
  tissue.zones = {{{testing::young, nu}, {}, {}}};
  const Mesh mesh =
      structured_grid(uniform_grid(kind.type, {0, -0.01, 0}, {0.1, 0.02, 0.02}, {5 * refinement + 1, 2 * refinement + 1, refinement + 1}));
  // Planes stay plane; one node of the end holds y, and in space the bar's middle plane z.
  const Box axis{{-1e-6, -1e-6, -1e-6}, {1e-6, 1e-6, 1e-6}};
  tissue.supports = {{Side::XMin, {true, false, false}}, {axis, {false, true, false}}};
  if (d == 3) tissue.supports.push_back({Side::ZMin, {false, false, true}});  // u_z = -nu y z vanishes there

  // Each element face on the end spreads its linear traction by its own mass matrix.
  const double young = plane_strain ? testing::young / (1 - nu * nu) : testing::young;
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size()) * d);
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    std::vector<int> face;
    for (int k = 0; k < mesh.nodes_per_element(); ++k) {
      const int node = mesh.element[e][static_cast<std::size_t>(k)];
      if (mesh.node[static_cast<std::size_t>(node)][0] > 0.1 - 1e-9) face.push_back(node);
    }
    const auto corners = face.size();
    if (corners < (kind.type == Type::Hex8 ? 4u : static_cast<std::size_t>(d))) continue;
    const double h = 0.01 / refinement;
    const double area = d == 2 ? h * tissue.thickness_m : h * 2 * h * (corners == 3 ? 0.5 : 1.0);
    for (const int a : face)
      for (const int b : face) {
        const Point& p = mesh.node[static_cast<std::size_t>(a)];
        const Point& q = mesh.node[static_cast<std::size_t>(b)];
        double mass = a == b ? 2.0 : 1.0;  // line: / 6; triangle: / 12; rectangle: the product of two lines, / 36
        if (corners == 4) mass = (p[1] == q[1] ? 2.0 : 1.0) * (p[2] == q[2] ? 2.0 : 1.0);
        load(a * d) -= mass / (corners == 2 ? 6 : corners == 3 ? 12 : 36) * area * young * q[1];
      }
  }
  const VectorXd u = Statics(mesh, tissue).solve(load);
  return u(Locator(mesh).nearest_node({0.1, 0, 0}) * d + 1) / (0.1 * 0.1 / 2);
}

class Bending : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(Benchmark, Bending,
                         ::testing::Values(Kind{Type::Tri3, Model::PlaneStress, Integration::Full},
                                           Kind{Type::Tri3, Model::PlaneStrain, Integration::Full}, plane_stress, strain_full, strain_bbar,
                                           Kind{Type::Tet4, Model::Solid, Integration::Full}, brick_full, brick_bbar),
                         [](const auto& parameter) { return name_of(parameter.param); });

TEST_P(Bending, ConvergesToTheExactDeflectionWithOrderTwo) {
  const double coarse = 1 - bending(GetParam(), 0.3, 4);
  const double fine = 1 - bending(GetParam(), 0.3, 8);
  EXPECT_GT(coarse, 0.0);  // too stiff, never too soft
  EXPECT_NEAR(std::log2(coarse / fine), 2.0, 0.25);
  EXPECT_LT(fine, 0.1);
}

// Shares of the exact deflection at nu = 0.4999 with four elements over the height: quads 0.01 (full) and 0.98 (B-bar), bricks 0.67 and
// 0.92, triangles 0.15, tetrahedra 0.15.
TEST(Locking, BendingTellsFullFromBBar) {
  for (const auto& [full, bbar, most] : {std::tuple{strain_full, strain_bbar, 0.02}, {brick_full, brick_bbar, 0.7}}) {
    for (const double nu : {0.3, 0.48, 0.499, 0.4999}) EXPECT_GT(bending(bbar, nu, 2), 0.9);
    EXPECT_GT(bending(full, 0.3, 2), 0.89);
    EXPECT_LT(bending(full, 0.4999, 2), most);
  }
}

}  // namespace
}  // namespace trocar::fem
