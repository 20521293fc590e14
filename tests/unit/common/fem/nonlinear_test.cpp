#include "common/fem/nonlinear.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using Eigen::VectorXd;
using testing::block;
using testing::distorted;
using testing::Kind;
using testing::message_of;
using testing::name_of;

class EachElement : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(
    Nonlinear, EachElement,
    ::testing::Values(Kind{Type::Tri3, Model::PlaneStress, Integration::Full}, Kind{Type::Tri3, Model::PlaneStrain, Integration::Full},
                      Kind{Type::Quad4, Model::PlaneStress, Integration::Full}, Kind{Type::Quad4, Model::PlaneStrain, Integration::Full},
                      Kind{Type::Quad4, Model::PlaneStrain, Integration::BBar}, Kind{Type::Tet4, Model::Solid, Integration::Full},
                      Kind{Type::Hex8, Model::Solid, Integration::Full}, Kind{Type::Hex8, Model::Solid, Integration::BBar}),
    [](const auto& parameter) { return name_of(parameter.param); });

// A bar of 40 x 20 (x 20) mm from the origin along x, on three sliding faces: it can stretch uniformly.
Tissue bar(const Kind& c, double nu = 0.3) {
  Tissue tissue = block(uniform_grid(c.type, {0, 0, 0}, {0.04, 0.02, 0.02}, {5, 4, 4}));
  tissue.model = c.model;
  tissue.integration = c.integration;
  tissue.zones = {{{testing::young, nu}, {}, {}}};
  tissue.supports = {{Side::XMin, {true, false, false}}, {Side::YMin, {false, true, false}}};
  if (c.model == Model::Solid) tissue.supports.push_back({Side::ZMin, {false, false, true}});
  return tissue;
}

// Nodal forces of a uniform traction along x on the side x = max: each element face spreads its area over its corners.
VectorXd pull(const Mesh& mesh, double thickness, double pa) {
  const int d = mesh.dimension();
  const double end = bounding_box(mesh).max_m[0];
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size()) * d);
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    std::vector<int> face;
    for (int k = 0; k < mesh.nodes_per_element(); ++k) {
      const int n = mesh.element[e][static_cast<std::size_t>(k)];
      if (mesh.node[static_cast<std::size_t>(n)][0] > end - 1e-12) face.push_back(n);
    }
    if (static_cast<int>(face.size()) < (mesh.type == Type::Hex8 ? 4 : d)) continue;
    const Point& a = mesh.node[static_cast<std::size_t>(face[0])];
    const Point& b = mesh.node[static_cast<std::size_t>(face[1])];
    const Point& c = mesh.node[static_cast<std::size_t>(face[face.size() - 1])];
    double area = thickness * std::abs(b[1] - a[1]);
    if (d == 3) area = std::abs((b[1] - a[1]) * (c[2] - a[2]) - (c[1] - a[1]) * (b[2] - a[2])) * (mesh.type == Type::Hex8 ? 1.0 : 0.5);
    for (const int n : face) load(n * d) += pa * area / static_cast<double>(face.size());
  }
  return load;
}

// The stretch at which a St. Venant–Kirchhoff bar carries pa per undeformed area: stretch E (stretch^2 - 1) / 2 = pa.
double stretch_at(double young, double pa) {
  double stretch = 1.0;
  for (int i = 0; i < 100; ++i)
    stretch -= (0.5 * young * stretch * (stretch * stretch - 1) - pa) / (0.5 * young * (3 * stretch * stretch - 1));
  return stretch;
}

TEST_P(EachElement, StretchesABarAsInClosedForm) {
  const Kind c = GetParam();
  const double nu = 0.3;
  const Tissue tissue = bar(c, nu);
  const Mesh mesh = distorted(*tissue.grid);
  const int d = mesh.dimension();
  const bool plane_strain = c.model == Model::PlaneStrain;
  const double young = plane_strain ? testing::young / (1 - nu * nu) : testing::young;
  const double side_nu = plane_strain ? nu / (1 - nu) : nu;
  for (const double pa : {0.9 * testing::young, 0.1 * testing::young, -0.1 * testing::young}) {
    const VectorXd load = pull(mesh, tissue.thickness_m, pa);
    EXPECT_NEAR(load.sum(), pa * 0.02 * (d == 3 ? 0.02 : tissue.thickness_m), 1e-12);
    const NonlinearResult result = solve_green_lagrange(mesh, tissue, load);
    ASSERT_TRUE(result.converged) << result.failure;
    EXPECT_EQ(result.load_fraction, 1.0);
    const double stretch = stretch_at(young, pa);
    const double side = std::sqrt(1 - side_nu * (stretch * stretch - 1));
    for (std::size_t n = 0; n < mesh.node.size(); ++n)
      for (int a = 0; a < d; ++a)
        EXPECT_NEAR(result.displacement_m(static_cast<Eigen::Index>(n) * d + a),
                    ((a == 0 ? stretch : side) - 1) * mesh.node[n][static_cast<std::size_t>(a)], 1e-10 * 0.04);
  }
}

// The same bar pulled by a prescribed displacement of its end.
TEST_P(EachElement, FollowsPrescribedDisplacements) {
  const Kind c = GetParam();
  Tissue tissue = bar(c);
  tissue.supports.push_back({Side::XMax, {true, false, false}});
  const Mesh mesh = distorted(*tissue.grid);
  const int d = mesh.dimension();
  const double stretch = 1.4;
  VectorXd prescribed = VectorXd::Constant(static_cast<Eigen::Index>(mesh.node.size()) * d, 7.0);  // free rows are ignored
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const auto row = static_cast<Eigen::Index>(n) * d;
    for (int a = 0; a < d; ++a)
      if (mesh.node[n][static_cast<std::size_t>(a)] < 1e-12) prescribed(row + a) = 0.0;
    if (mesh.node[n][0] > 0.04 - 1e-12) prescribed(row) = (stretch - 1) * 0.04;
  }
  const NonlinearResult result = solve_green_lagrange(mesh, tissue, VectorXd::Zero(prescribed.size()), {}, prescribed);
  ASSERT_TRUE(result.converged) << result.failure;
  const double nu = c.model == Model::PlaneStrain ? 0.3 / 0.7 : 0.3;
  const double side = std::sqrt(1 - nu * (stretch * stretch - 1));
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    for (int a = 0; a < d; ++a)
      EXPECT_NEAR(result.displacement_m(static_cast<Eigen::Index>(n) * d + a),
                  ((a == 0 ? stretch : side) - 1) * mesh.node[n][static_cast<std::size_t>(a)], 1e-10 * 0.04);
}

TEST_P(EachElement, ApproachesLinearStaticsAsLoadsVanish) {
  const Kind c = GetParam();
  Tissue tissue = bar(c);
  tissue.supports = {{Side::XMin, {true, true, c.model == Model::Solid}}};
  const Mesh mesh = distorted(*tissue.grid);
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size()) * mesh.dimension());
  for (Eigen::Index i = 0; i < load.size(); ++i) load(i) = 0.01 * std::sin(3.0 * static_cast<double>(i));
  const VectorXd linear = Statics(mesh, tissue).solve(load);
  double before = 0.0;
  for (const double factor : {1e-2, 1e-3, 1e-4}) {
    const NonlinearResult result = solve_green_lagrange(mesh, tissue, factor * load);
    ASSERT_TRUE(result.converged) << result.failure;
    const double difference = (result.displacement_m / factor - linear).norm() / linear.norm();
    if (before > 0.0) {
      EXPECT_NEAR(before / difference, 10.0, 2.0);  // first order in the load
    }
    before = difference;
  }
  EXPECT_LT(before, 1e-3);
}

// Each residual is at most a constant times the square of the one before: the digits double.
TEST_P(EachElement, NewtonConvergesQuadratically) {
  const Kind c = GetParam();
  Tissue tissue = bar(c);
  tissue.supports = {{Side::XMin, {true, true, c.model == Model::Solid}}};
  const Mesh mesh = distorted(*tissue.grid);
  VectorXd load = pull(mesh, tissue.thickness_m, 0.25 * testing::young);
  for (Eigen::Index i = 1; i < load.size(); i += mesh.dimension()) load(i) = -0.1 * load(i - 1);
  NonlinearOptions options;
  options.tolerance = 1e-12;
  const NonlinearResult result = solve_green_lagrange(mesh, tissue, load, options);
  ASSERT_TRUE(result.converged) << result.failure;
  EXPECT_EQ(result.halvings, 0);
  EXPECT_LE(result.iterations, 8);
  const auto& r = result.residuals_n;
  ASSERT_EQ(static_cast<int>(r.size()), result.iterations + 1);
  int seen = 0;

  for (std::size_t k = 2; k < r.size(); ++k) {
    if (r[k - 1] > 1e-4 * r[0] || r[k] < 1e-13 * r[0]) continue;  // not yet near, or rounding
    EXPECT_GT(std::log(r[k] / r[k - 1]) / std::log(r[k - 1] / r[k - 2]), 1.6);
    ++seen;
  }
  EXPECT_GE(seen, 1);
}

// Tip of an inextensible cantilever under a dead tip force, P L^2 / (E I) = 1, 2, 5 (elliptic integrals; table of Mattiasson 1981).
TEST(Nonlinear, SlenderCantileverFollowsTheElastica) {
  const double length = 0.1;
  const double height = 0.005;
  const int along = 400;
  Tissue tissue = block(uniform_grid(Type::Quad4, {0, 0, 0}, {length, height, 0}, {along + 1, 3, 1}));
  tissue.zones = {{{1e6, 0.0}, {}, {}}};
  tissue.supports = {{Side::XMin, {true, true, false}}};
  const Mesh mesh = structured_grid(*tissue.grid);
  const double bending = 1e6 * tissue.thickness_m * std::pow(height, 3) / 12;
  struct Row {
    double load, sideways, back;
  };
  for (const Row& row : {Row{1, 0.30172, 0.05643}, Row{2, 0.49346, 0.16064}, Row{5, 0.71379, 0.38763}}) {
    VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(2 * mesh.node.size()));
    const double force = row.load * bending / (length * length);
    for (int j = 0; j < 3; ++j) load(2 * (j * (along + 1) + along) + 1) = (j == 1 ? 0.5 : 0.25) * force;
    const NonlinearResult result = solve_green_lagrange(mesh, tissue, load);
    ASSERT_TRUE(result.converged) << result.failure;
    const Eigen::Index tip = 2 * (along + 1 + along);
    EXPECT_NEAR(result.displacement_m(tip + 1) / length, row.sideways, 0.01 * row.sideways);
    EXPECT_NEAR(-result.displacement_m(tip) / length, row.back, 0.01 * row.back);
  }
}

// Equilibrium does not depend on the way there, and a step that fails is halved rather than given up.
TEST(Nonlinear, LoadStepsAndHalvingsEndInTheSameEquilibrium) {
  Tissue tissue = block(uniform_grid(Type::Quad4, {0, 0, 0}, {0.1, 0.01, 0}, {41, 5, 1}));
  tissue.supports = {{Side::XMin, {true, true, false}}};
  const Mesh mesh = structured_grid(*tissue.grid);
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(2 * mesh.node.size()));
  for (int j = 0; j < 5; ++j) load(2 * (j * 41 + 40) + 1) = 0.002;
  NonlinearOptions options;
  options.load_steps = 20;
  const NonlinearResult slow = solve_green_lagrange(mesh, tissue, load, options);
  ASSERT_TRUE(slow.converged) << slow.failure;
  EXPECT_EQ(slow.steps, 20);
  options.load_steps = 1;
  options.max_iterations = 5;  // too few for the whole load at once
  const NonlinearResult halved = solve_green_lagrange(mesh, tissue, load, options);
  ASSERT_TRUE(halved.converged) << halved.failure;
  EXPECT_GT(halved.halvings, 0);
  EXPECT_GT(halved.steps, 1);
  EXPECT_LT((halved.displacement_m - slow.displacement_m).cwiseAbs().maxCoeff(), 1e-8 * slow.displacement_m.cwiseAbs().maxCoeff());
}

// In compression the force of the material has its maximum E / (3 sqrt(3)) per undeformed area at a stretch of 1 / sqrt(3).
TEST(Nonlinear, StopsAtTheLimitLoadAndSaysSo) {
  for (const Kind& c : {Kind{Type::Quad4, Model::PlaneStress, Integration::Full}, Kind{Type::Hex8, Model::Solid, Integration::Full}}) {
    Tissue tissue = bar(c, 0.0);
    tissue.grid = uniform_grid(c.type, {0, 0, 0}, {0.02, 0.02, 0.02}, {2, 4, 4});
    const Mesh mesh = structured_grid(*tissue.grid);
    const double limit = testing::young / (3 * std::sqrt(3.0));
    const NonlinearResult below = solve_green_lagrange(mesh, tissue, pull(mesh, tissue.thickness_m, -0.99 * limit));
    EXPECT_TRUE(below.converged) << below.failure;
    const NonlinearResult above = solve_green_lagrange(mesh, tissue, pull(mesh, tissue.thickness_m, -1.25 * limit));
    EXPECT_FALSE(above.converged);
    EXPECT_LE(above.load_fraction, 0.8);
    EXPECT_GT(above.load_fraction, 0.8 - 2.0 / 1024);
    EXPECT_NE(above.failure.find("stopped at 80 % of the load"), std::string::npos) << above.failure;
    // What is returned is an equilibrium, at that fraction.
    const double stretch = 1 + above.displacement_m.minCoeff() / 0.02;
    EXPECT_NEAR(0.5 * testing::young * stretch * (1 - stretch * stretch), above.load_fraction * 1.25 * limit, 1e-6 * limit);
  }
}

TEST(Nonlinear, NamesBucklingForWhatItIs) {
  Tissue tissue = block(uniform_grid(Type::Quad4, {0, 0, 0}, {0.1, 0.01, 0}, {41, 5, 1}));
  tissue.zones = {{{1e5, 0.0}, {}, {}}};
  tissue.supports = {{Side::XMin, {true, true, false}}};
  const Mesh mesh = structured_grid(*tissue.grid);
  // Euler: pi^2 E I / (4 L^2), for the stiffness against bending of these four quads rather than the beam's.
  const double euler = std::pow(M_PI, 2) * 1e5 * tissue.thickness_m * 1e-6 / 12 / (4 * 0.01);
  const VectorXd load = pull(mesh, tissue.thickness_m, -2 * euler / (0.01 * tissue.thickness_m));
  const NonlinearResult result = solve_green_lagrange(mesh, tissue, load);
  EXPECT_FALSE(result.converged);
  EXPECT_NEAR(2 * result.load_fraction, 1.0, 0.05);
  EXPECT_NE(result.failure.find("buckles"), std::string::npos) << result.failure;
}

// A clamped block sheared by a third of its height. From nu = 0.45 to 0.4999 full integration loses half of the motion, B-bar 5 %.
TEST(Nonlinear, BBarDoesNotLockAtLargeStrain) {
  const auto sheared = [](Type type, Integration integration, double nu) {
    const bool solid = type == Type::Hex8;
    Tissue tissue = block(uniform_grid(type, {0, 0, 0}, {0.04, 0.04, 0.02}, {7, 7, 4}));
    tissue.model = solid ? Model::Solid : Model::PlaneStrain;
    tissue.integration = integration;
    tissue.zones = {{{testing::young, nu}, {}, {}}};
    tissue.supports = {{Side::XMin, {true, true, solid}}};
    if (solid)
      for (const Side side : {Side::ZMin, Side::ZMax}) tissue.supports.push_back({side, {false, false, true}});
    const Mesh mesh = structured_grid(*tissue.grid);
    VectorXd load = pull(mesh, tissue.thickness_m, 0.05 * testing::young);
    for (Eigen::Index i = 0; i < load.size(); i += mesh.dimension()) std::swap(load(i), load(i + 1));
    const NonlinearResult result = solve_green_lagrange(mesh, tissue, load);
    EXPECT_TRUE(result.converged) << result.failure;
    return result.displacement_m.maxCoeff();
  };
  for (const Type type : {Type::Quad4, Type::Hex8}) {
    EXPECT_LT(sheared(type, Integration::Full, 0.4999) / sheared(type, Integration::Full, 0.45), 0.6);
    EXPECT_GT(sheared(type, Integration::BBar, 0.4999) / sheared(type, Integration::BBar, 0.45), 0.94);
  }
}

// MODELS, section 1: at the measured loads Green–Lagrange moves the entry about 1.4 times as far as linear elasticity. Phantom of the
// thesis; 34 N/m along 70 mm and twice that over the last 2.5 mm, 2.5 N. Far edge held, sides free and held: 1.51 and 1.33.
TEST(Nonlinear, PhantomEntryMovesFartherThanInLinearElasticity) {
  for (const bool sides : {false, true}) {
    Tissue tissue = block(uniform_grid(Type::Quad4, {-0.05, 0, 0}, {0.1, 0.1, 0}, {21, 21, 1}));
    tissue.zones = {{{25300.0, 0.48}, {}, {}}};
    if (sides)
      for (const Side side : {Side::XMin, Side::XMax}) tissue.supports.push_back({side, {true, true, false}});
    const Mesh mesh = structured_grid(*tissue.grid);
    const Locator locator(mesh);
    VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(2 * mesh.node.size()));
    const int pieces = 700;
    for (int i = 0; i < pieces; ++i) {
      const double depth = 0.07 * (i + 0.5) / pieces;
      const auto at = locator.locate({0.0, depth, 0.0});
      ASSERT_TRUE(at);
      for (std::size_t k = 0; k < static_cast<std::size_t>(at->count); ++k)
        load(2 * at->node[k] + 1) += at->weight[k] * (depth > 0.0675 ? 68.0 : 34.0) * 0.07 / pieces;
    }
    EXPECT_NEAR(load.sum(), 2.465, 0.01);
    const Eigen::Index entry = 2 * locator.nearest_node({0, 0, 0}) + 1;
    const double linear = Statics(mesh, tissue).solve(load)(entry, 0);
    const NonlinearResult result = solve_green_lagrange(mesh, tissue, load);
    ASSERT_TRUE(result.converged) << result.failure;
    EXPECT_GT(result.displacement_m(entry) / linear, 1.3);
    EXPECT_LT(result.displacement_m(entry) / linear, 1.55);
  }
}

TEST(Nonlinear, RefusesWhatMakesNoSense) {
  const Tissue tissue = bar({Type::Quad4, Model::PlaneStress, Integration::Full});
  const Mesh mesh = structured_grid(*tissue.grid);
  const VectorXd load = pull(mesh, tissue.thickness_m, 100.0);
  const auto refusal = [&](const VectorXd& f, const NonlinearOptions& options = {}, const VectorXd& prescribed = {}) {
    return message_of([&] { (void)solve_green_lagrange(mesh, tissue, f, options, prescribed); });
  };
  EXPECT_EQ(refusal(load), "");
  EXPECT_NE(refusal(load.head(6)).find("one for each degree of freedom"), std::string::npos);
  EXPECT_NE(refusal(load, {}, load.head(6)).find("one for each degree of freedom"), std::string::npos);
  VectorXd broken = load;
  broken(2 * 7) = std::nan("");
  EXPECT_NE(refusal(broken).find("is not a number"), std::string::npos);
  NonlinearOptions options;
  options.load_steps = 0;
  EXPECT_NE(refusal(load, options).find("load_steps"), std::string::npos);
  options = {};
  options.max_iterations = 0;
  EXPECT_NE(refusal(load, options).find("max_iterations"), std::string::npos);
  options = {};
  options.max_halvings = -1;
  EXPECT_NE(refusal(load, options).find("max_halvings"), std::string::npos);
  options = {};
  options.tolerance = 0.0;
  EXPECT_NE(refusal(load, options).find("tolerance"), std::string::npos);
  Tissue loose = tissue;
  loose.supports.clear();
  EXPECT_NE(message_of([&] { (void)solve_green_lagrange(mesh, loose, load); }).find("unsupported"), std::string::npos);
  Mesh inverted = mesh;
  std::swap(inverted.element[3][1], inverted.element[3][3]);
  EXPECT_NE(message_of([&] { (void)solve_green_lagrange(inverted, tissue, load); }).find("inverted"), std::string::npos);
}

TEST(Nonlinear, RestsWithoutLoad) {
  const Tissue tissue = bar({Type::Hex8, Model::Solid, Integration::Full});
  const Mesh mesh = structured_grid(*tissue.grid);
  const NonlinearResult result = solve_green_lagrange(mesh, tissue, VectorXd::Zero(static_cast<Eigen::Index>(3 * mesh.node.size())));
  EXPECT_TRUE(result.converged);
  EXPECT_EQ(result.iterations, 0);
  EXPECT_TRUE(result.displacement_m.isZero(0.0));
}

}  // namespace
}  // namespace trocar::fem
