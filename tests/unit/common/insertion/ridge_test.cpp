// A straight line load through a strip has a displacement that is known: held at x = 0 and x = W, with sliding ends, u depends on x
// alone and is a tent over the line. With force q per length on it, u = q a b / ((a + b) C t) there, a and b the distances to the held
// sides and C the shear modulus along the line, that of uniaxial strain across it. Elements that the line crosses cut the tent's top off;
// embedded contacts add it again.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <array>
#include <memory>
#include <numbers>

#include "common/condense/compile.hpp"
#include "common/insertion/insertion.hpp"

namespace trocar::insertion {
namespace {

constexpr double width_m = 0.04, height_m = 0.03, thickness_m = 0.011;
constexpr double young_pa = 25.3e3, poisson = 0.4;

// Force per displacement of a needle that runs through the strip and holds it.
double stiffness_n_per_m(fem::Type element, double x_m, bool along) {
  scene::Scene scene;
  scene.tissue.model = fem::Model::PlaneStress;
  scene.tissue.thickness_m = thickness_m;
  scene.tissue.grid = fem::uniform_grid(element, {0.0, 0.0, 0.0}, {width_m, height_m, 0.0}, {9, 7, 1});
  scene.tissue.zones = {{.material = {young_pa, poisson}}};
  // The ends take the tractions of the exact solution and move with it.
  const std::array<bool, 3> held{along, !along, false};
  scene.tissue.supports = {
      {fem::Side::XMin, {true, true, false}}, {fem::Side::XMax, {true, true, false}}, {fem::Side::YMin, held}, {fem::Side::YMax, held}};
  scene.needle = scene::Needle{.length_m = 0.05};
  contact::Law law;
  law.tip_zone_m = 1e-3;
  law.spacing_m = 0.0075;
  scene.contact = law;
  const condense::Compiled compiled = condense::compile_to_memory(scene, {.visible = condense::WithVisible::No});
  model::Image image;
  EXPECT_EQ(model::open(compiled.image.span(), image), model::ImageStatus::Ok);
  const auto needle = std::make_unique<Insertion>();
  needle->open(image);
  // Goes through, so that the line has no end.
  Pose base{x_m, height_m - 1e-4 - 0.05, 0.5 * std::numbers::pi};
  for (int k = 0; k < 4; ++k, base.y_m += 2e-4) EXPECT_EQ(needle->step(base, 1e-3).status, Status::Ok);
  const contact::Solver& solver = needle->working_set().solver();
  const auto n = static_cast<Eigen::Index>(solver.size());
  EXPECT_GE(n, 4);
  Eigen::MatrixXd compliance(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j)
      compliance(i, j) = solver.compliance(static_cast<std::size_t>(i), static_cast<std::size_t>(j))[along ? 3 : 0];
  return compliance.llt().solve(Eigen::VectorXd::Ones(n)).sum();
}

constexpr std::array places_m{0.02, 0.0213, 0.0225, 0.0249, 0.0061};

double exact_n_per_m(double x_m, bool along) {
  const double modulus_pa = along ? young_pa / (2.0 * (1.0 + poisson)) : young_pa / (1.0 - poisson * poisson);
  return modulus_pa * thickness_m * height_m * (1.0 / x_m + 1.0 / (width_m - x_m));
}

TEST(Ridge, MakesALineLoadExactWhereverItCrossesQuads) {
  for (const double x_m : places_m)
    for (const bool along :
         {true, false})  // without the ridge 1 to 20 % too stiff; regularisation is 1e-6 of each contact's own compliance
      EXPECT_NEAR(stiffness_n_per_m(fem::Type::Quad4, x_m, along) / exact_n_per_m(x_m, along), 1.0, 3e-6) << x_m << ' ' << along;
}

// Diagonals share a load out unevenly along the line, so the nodes beside it do not move alike. Without the ridge they are 1 to 20 % too
// stiff.
TEST(Ridge, MakesALineLoadAlmostExactWhereverItCrossesTriangles) {
  for (const double x_m : places_m)
    for (const bool along : {true, false})
      EXPECT_NEAR(stiffness_n_per_m(fem::Type::Tri3, x_m, along) / exact_n_per_m(x_m, along), 1.0, 4e-3) << x_m << ' ' << along;
}

}  // namespace
}  // namespace trocar::insertion
