#include "common/fem/statics.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <string>

#include "common/fem/element.hpp"

namespace trocar::fem {
namespace {

constexpr double young = 25300.0;
constexpr double poisson = 0.48;

Tissue block(Element element, Model model = Model::PlaneStress) {
  Tissue tissue;
  tissue.model = model;
  tissue.thickness_m = 0.011;
  tissue.grid = {{0.1, 0.1}, {-0.05, 0.18}, {8, 7}, element};
  tissue.materials = {{young, poisson, {}}};
  tissue.supports = {{Edge::YMax, {}, true, true}};
  return tissue;
}

// Moves the interior nodes so that no element keeps a right angle.
Mesh distorted(const Grid& grid) {
  Mesh mesh = structured_grid(grid);
  for (int j = 1; j + 1 < grid.nodes[1]; ++j)
    for (int i = 1; i + 1 < grid.nodes[0]; ++i) {
      Point& p = mesh.node[static_cast<std::size_t>(j * grid.nodes[0] + i)];
      p[0] += 0.003 * std::sin(3.0 * i + 5.0 * j);
      p[1] += 0.003 * std::cos(7.0 * i - 2.0 * j);
    }
  return mesh;
}

struct Case {
  Element element;
  Model model;
};
class EachElementAndModel : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Statics, EachElementAndModel,
                         testing::Values(Case{Element::Tri3, Model::PlaneStress}, Case{Element::Tri3, Model::PlaneStrain},
                                         Case{Element::Quad4, Model::PlaneStress}, Case{Element::Quad4, Model::PlaneStrain}));

// Linear displacement on the whole boundary must be met exactly inside, on distorted elements too.
TEST_P(EachElementAndModel, PassesThePatchTest) {
  Tissue tissue = block(GetParam().element, GetParam().model);
  tissue.supports = {
      {Edge::XMin, {}, true, true}, {Edge::XMax, {}, true, true}, {Edge::YMin, {}, true, true}, {Edge::YMax, {}, true, true}};
  const Mesh mesh = distorted(tissue.grid);
  const Statics statics(mesh, tissue);
  Eigen::VectorXd linear(statics.degrees_of_freedom());
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const auto [x, y] = mesh.node[n];
    linear(static_cast<Eigen::Index>(2 * n)) = 0.01 + 0.3 * x - 0.2 * y;
    linear(static_cast<Eigen::Index>(2 * n + 1)) = -0.02 + 0.1 * x + 0.4 * y;
  }
  const Eigen::VectorXd u = statics.solve(Eigen::VectorXd::Zero(linear.size()), linear);
  EXPECT_LT((u - linear).cwiseAbs().maxCoeff(), 1e-12 * linear.cwiseAbs().maxCoeff());
}

// A uniform pull on the lower edge, the upper one sliding: u_y and u_x in closed form, with the model's own E and nu.
TEST_P(EachElementAndModel, StretchesUniformlyAsInClosedForm) {
  Tissue tissue = block(GetParam().element, GetParam().model);
  tissue.supports = {{Edge::YMax, {}, false, true}, {Edge::XMin, Box{{-0.051, 0.279}, {-0.049, 0.281}}, true, false}};
  const Mesh mesh = distorted(tissue.grid);
  const Statics statics(mesh, tissue);
  const double pull = 100.0;  // Pa
  const double spacing = tissue.grid.size_m[0] / (tissue.grid.nodes[0] - 1);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
  for (int i = 0; i < tissue.grid.nodes[0]; ++i) {
    const bool corner = i == 0 || i + 1 == tissue.grid.nodes[0];
    load(2 * i + 1) = -pull * tissue.thickness_m * spacing * (corner ? 0.5 : 1.0);
  }
  const Eigen::VectorXd u = statics.solve(load);
  const bool strain_model = GetParam().model == Model::PlaneStrain;
  const double effective_young = strain_model ? young / (1 - poisson * poisson) : young;
  const double effective_poisson = strain_model ? poisson / (1 - poisson) : poisson;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const auto [x, y] = mesh.node[n];
    EXPECT_NEAR(u(static_cast<Eigen::Index>(2 * n)), -effective_poisson * pull / effective_young * (x + 0.05), 1e-14);
    EXPECT_NEAR(u(static_cast<Eigen::Index>(2 * n + 1)), pull / effective_young * (y - 0.28), 1e-14);
  }
}

// Exactly three motions cost no energy; every other deformation costs some.
TEST_P(EachElementAndModel, ElementHasThreeRigidBodyModes) {
  const std::array<Point, 4> corner{{{0.0, 0.0}, {0.006, 0.001}, {0.005, 0.006}, {-0.001, 0.004}}};
  const auto count = GetParam().element == Element::Quad4 ? 4u : 3u;
  const ElementStiffness full =
      stiffness(GetParam().element, {corner.data(), count}, elasticity(GetParam().model, {young, poisson, {}}), 0.011);
  const auto size = static_cast<Eigen::Index>(2 * count);
  const Eigen::MatrixXd k = full.topLeftCorner(size, size);
  EXPECT_LT((k - k.transpose()).cwiseAbs().maxCoeff(), 1e-13 * k.cwiseAbs().maxCoeff());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(k);
  const double largest = eigen.eigenvalues()(size - 1);
  for (Eigen::Index i = 0; i < 3; ++i) EXPECT_NEAR(eigen.eigenvalues()(i) / largest, 0.0, 1e-13);
  EXPECT_GT(eigen.eigenvalues()(3) / largest, 1e-4);
}

TEST_P(EachElementAndModel, ComplianceIsSymmetricAndPositive) {
  const Tissue tissue = block(GetParam().element, GetParam().model);
  const Statics statics(structured_grid(tissue.grid), tissue);
  std::vector<Eigen::Index> all;
  for (Eigen::Index i = 0; i < statics.degrees_of_freedom(); ++i) all.push_back(i);
  const Eigen::MatrixXd a = compliance_columns(statics, all);
  EXPECT_LT((a - a.transpose()).cwiseAbs().maxCoeff(), 1e-12 * a.cwiseAbs().maxCoeff());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  EXPECT_GT(eigen.eigenvalues()(0), -1e-12 * eigen.eigenvalues().maxCoeff());
  for (Eigen::Index i = 0; i < a.rows(); ++i) EXPECT_EQ(a(i, i) == 0.0, statics.supported(i));
}

// Balance: what the supports hold is what was applied.
TEST(Statics, ReactionsBalanceTheLoads) {
  const Tissue tissue = block(Element::Quad4);
  const Mesh mesh = structured_grid(tissue.grid);
  const Statics statics(mesh, tissue);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
  load(2 * 10) = 0.3;
  load(2 * 10 + 1) = 1.7;
  const Eigen::VectorXd u = statics.solve(load);
  const Eigen::VectorXd reaction = statics.stiffness_n_per_m() * u - load;
  double sum_x = 0.0;
  double sum_y = 0.0;
  double moment = 0.0;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const auto row = static_cast<Eigen::Index>(2 * n);
    if (!statics.supported(row)) {
      EXPECT_NEAR(reaction(row), 0.0, 1e-12);
    }
    sum_x += reaction(row);
    sum_y += reaction(row + 1);
    moment += mesh.node[n][0] * reaction(row + 1) - mesh.node[n][1] * reaction(row);
  }
  EXPECT_NEAR(sum_x, -0.3, 1e-12);
  EXPECT_NEAR(sum_y, -1.7, 1e-12);
  EXPECT_NEAR(moment, -(mesh.node[10][0] * 1.7 - mesh.node[10][1] * 0.3), 1e-12);
}

// Quads mirror a straight push exactly; triangles with one diagonal do not (and must not be mistaken for broken).
TEST(Statics, StraightPushStaysOnTheAxisWithQuadsOnly) {
  for (const Element element : {Element::Quad4, Element::Tri3}) {
    Tissue tissue = block(element);
    tissue.grid.nodes = {9, 9};
    const Statics statics(structured_grid(tissue.grid), tissue);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
    load(2 * 4 + 1) = 1.0;
    const double sideways = std::abs(statics.solve(load)(2 * 4));
    if (element == Element::Quad4)
      EXPECT_LT(sideways, 1e-13);
    else
      EXPECT_GT(sideways, 1e-6);
  }
}

// A slender cantilever of quads in shear approaches Timoshenko's tip deflection under refinement.
TEST(Statics, CantileverConvergesToBeamTheory) {
  const double length = 0.1;
  const double height = 0.01;
  const double thickness = 0.011;
  const double inertia = thickness * height * height * height / 12;
  const double shear = young / (2 * (1 + poisson));
  const double exact = length * length * length / (3 * young * inertia) + length / (5.0 / 6.0 * shear * height * thickness);
  double error = 1.0;
  for (const int refinement : {2, 4, 8}) {
    Tissue tissue = block(Element::Quad4);
    tissue.thickness_m = thickness;
    tissue.grid = {{length, height}, {0.0, 0.0}, {10 * refinement + 1, refinement + 1}, Element::Quad4};
    tissue.supports = {{Edge::XMin, {}, true, true}};
    const Statics statics(structured_grid(tissue.grid), tissue);
    Eigen::VectorXd load = Eigen::VectorXd::Zero(statics.degrees_of_freedom());
    for (int j = 0; j <= refinement; ++j)
      load(2 * ((j + 1) * (10 * refinement + 1) - 1) + 1) = (j == 0 || j == refinement ? 0.5 : 1.0) / refinement;
    const double tip = statics.solve(load)(2 * (10 * refinement) + 1);
    const double now = std::abs(tip - exact) / exact;
    EXPECT_LT(now, 0.5 * error);
    error = now;
  }
  EXPECT_LT(error, 0.02);
}

TEST(Statics, LaterMaterialsOverrideEarlierOnesInTheirBox) {
  Tissue soft = block(Element::Quad4);
  Tissue layered = soft;
  layered.materials.push_back({10 * young, poisson, Box{{-0.05, 0.18}, {0.05, 0.28}}});
  const Mesh mesh = structured_grid(soft.grid);
  Eigen::VectorXd load = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(2 * mesh.node.size()));
  load(7) = 1.0;
  const Eigen::VectorXd a = Statics(mesh, soft).solve(load);
  const Eigen::VectorXd b = Statics(mesh, layered).solve(load);
  EXPECT_LT((a - 10 * b).cwiseAbs().maxCoeff(), 1e-12 * a.cwiseAbs().maxCoeff());
  layered.materials = {{young, poisson, Box{{-0.05, 0.18}, {0.05, 0.2}}}};
  EXPECT_THROW(Statics(mesh, layered), Error);
}

std::string refusal(const Mesh& mesh, const Tissue& tissue) {
  try {
    const Statics statics(mesh, tissue);
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(Statics, NamesWhatIsWrongWithAModel) {
  const Tissue good = block(Element::Quad4);
  const Mesh mesh = structured_grid(good.grid);
  EXPECT_EQ(refusal(mesh, good), "");

  Tissue bad = good;
  bad.supports.clear();
  EXPECT_NE(refusal(mesh, bad).find("unsupported"), std::string::npos);
  bad.supports = {{Edge::YMax, {}, false, true}};
  EXPECT_NE(refusal(mesh, bad).find("move along x"), std::string::npos);
  bad.supports = {{Edge::XMin, {}, true, false}};
  EXPECT_NE(refusal(mesh, bad).find("move along y"), std::string::npos);
  bad.supports = {{Edge::XMin, Box{{-0.051, 0.179}, {-0.049, 0.181}}, true, true}};
  EXPECT_NE(refusal(mesh, bad).find("unsupported"), std::string::npos);
  bad.supports = {{Edge::XMin, Box{{1.0, 1.0}, {2.0, 2.0}}, true, true}};
  EXPECT_NE(refusal(mesh, bad).find("holds no node"), std::string::npos);

  bad = good;
  bad.materials[0].poisson = 0.5;
  EXPECT_NE(refusal(mesh, bad).find("poisson"), std::string::npos);
  bad.materials[0] = {-1.0, 0.3, {}};
  EXPECT_NE(refusal(mesh, bad).find("young_pa"), std::string::npos);
  bad = good;
  bad.thickness_m = 0.0;
  EXPECT_NE(refusal(mesh, bad).find("thickness_m"), std::string::npos);

  Mesh inverted = mesh;
  std::swap(inverted.element[5][1], inverted.element[5][3]);
  EXPECT_NE(refusal(inverted, good).find("inverted"), std::string::npos);
}

}  // namespace
}  // namespace trocar::fem
