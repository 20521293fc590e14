#include "sim_plant/phantom/plane_grid.hpp"

#include <gtest/gtest.h>

#include "common/fem/mesh.hpp"

namespace trocar::sim_plant {
namespace {

fem::Tissue tissue(fem::Type element) {
  fem::Tissue t;
  t.grid = fem::uniform_grid(element, {-0.05, 0.02, 0.0}, {0.1, 0.06, 0.0}, {6, 4, 1});
  return t;
}

class EachElement : public testing::TestWithParam<fem::Type> {};
INSTANTIATE_TEST_SUITE_P(PlaneGrid, EachElement, testing::Values(fem::Type::Tri3, fem::Type::Quad4));

TEST_P(EachElement, LocatesPointsInTheElementThatHoldsThem) {
  const fem::Mesh mesh = fem::make_mesh(tissue(GetParam()));
  const PlaneGrid grid = plane_grid(tissue(GetParam()));
  for (int i = 0; i <= 37; ++i) {
    for (int j = 0; j <= 29; ++j) {
      const Point x{-0.05 + 0.1 * i / 37.0, 0.02 + 0.06 * j / 29.0};
      const Embedding at = locate(grid, x);
      Point sum{};
      Point gradient_sum{};
      double weights = 0.0;
      for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k) {
        EXPECT_EQ(at.node[k], mesh.element[static_cast<std::size_t>(at.element)][k]);
        EXPECT_GE(at.weight[k], -1e-12);
        const fem::Point& corner = mesh.node[static_cast<std::size_t>(at.node[k])];
        for (std::size_t axis = 0; axis < 2; ++axis) {
          sum[axis] += at.weight[k] * corner[axis];
          gradient_sum[axis] += at.gradient[k][axis] * corner[axis];
        }
        weights += at.weight[k];
      }
      EXPECT_NEAR(weights, 1.0, 1e-14);
      EXPECT_NEAR(sum[0], x[0], 1e-15);
      EXPECT_NEAR(sum[1], x[1], 1e-15);
      EXPECT_NEAR(gradient_sum[0], 1.0, 1e-12);
      EXPECT_NEAR(gradient_sum[1], 1.0, 1e-12);
    }
  }
}

TEST_P(EachElement, GradientIsTheDerivativeOfTheWeights) {
  const PlaneGrid grid = plane_grid(tissue(GetParam()));
  const Point x{0.0123, 0.0571};
  const double step = 1e-7;
  const Embedding at = locate(grid, x);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    Point forward = x;
    Point backward = x;
    forward[axis] += step;
    backward[axis] -= step;
    const Embedding plus = locate(grid, forward);
    const Embedding minus = locate(grid, backward);
    for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k)
      EXPECT_NEAR(at.gradient[k][axis], (plus.weight[k] - minus.weight[k]) / (2 * step), 1e-6);
  }
}

TEST_P(EachElement, ContinuesTheNearestElementOutside) {
  const fem::Mesh mesh = fem::make_mesh(tissue(GetParam()));
  const PlaneGrid grid = plane_grid(tissue(GetParam()));
  const Point x{0.03, 0.01};
  EXPECT_FALSE(inside(grid, x));
  const Embedding at = locate(grid, x);
  Point sum{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k)
    for (std::size_t axis = 0; axis < 2; ++axis) sum[axis] += at.weight[k] * mesh.node[static_cast<std::size_t>(at.node[k])][axis];
  EXPECT_NEAR(sum[0], x[0], 1e-15);
  EXPECT_NEAR(sum[1], x[1], 1e-15);
}

TEST(PlaneGrid, RefusesWhatIsNoUniformPlane) {
  fem::Tissue t = tissue(fem::Type::Quad4);
  t.grid->axis_m[0][2] += 1e-3;
  EXPECT_THROW((void)plane_grid(t), fem::Error);
  t.grid = fem::uniform_grid(fem::Type::Hex8, {0.0, 0.0, 0.0}, {0.1, 0.1, 0.1}, {3, 3, 3});
  EXPECT_THROW((void)plane_grid(t), fem::Error);
  t.grid.reset();
  EXPECT_THROW((void)plane_grid(t), fem::Error);
}

}  // namespace
}  // namespace trocar::sim_plant
