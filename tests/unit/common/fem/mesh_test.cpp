#include "common/fem/mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "common/fem/element.hpp"

namespace trocar::fem {
namespace {

Grid grid(Element element) { return {{0.1, 0.06}, {-0.05, 0.02}, {6, 4}, element}; }

class EachElement : public testing::TestWithParam<Element> {};
INSTANTIATE_TEST_SUITE_P(Mesh, EachElement, testing::Values(Element::Tri3, Element::Quad4));

TEST_P(EachElement, CoversTheBoxOnce) {
  const Mesh mesh = structured_grid(grid(GetParam()));
  EXPECT_EQ(mesh.node.size(), 24u);
  double area = 0.0;
  for (const auto& e : mesh.element) {
    const auto corners = static_cast<std::size_t>(mesh.nodes_per_element());
    double twice = 0.0;
    for (std::size_t k = 0; k < corners; ++k) {
      const Point& p = mesh.node[static_cast<std::size_t>(e[k])];
      const Point& q = mesh.node[static_cast<std::size_t>(e[(k + 1) % corners])];
      twice += p[0] * q[1] - p[1] * q[0];
    }
    EXPECT_GT(twice, 0.0);
    area += 0.5 * twice;
  }
  EXPECT_NEAR(area, 0.1 * 0.06, 1e-15);
}

TEST_P(EachElement, LocatesPointsInTheElementThatHoldsThem) {
  const Grid g = grid(GetParam());
  const Mesh mesh = structured_grid(g);
  for (int i = 0; i <= 37; ++i) {
    for (int j = 0; j <= 29; ++j) {
      const Point x{g.origin_m[0] + g.size_m[0] * i / 37.0, g.origin_m[1] + g.size_m[1] * j / 29.0};
      const Embedding at = locate(g, x);
      Point sum{};
      Point gradient_sum{};
      double weights = 0.0;
      for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k) {
        EXPECT_EQ(at.node[k], mesh.element[static_cast<std::size_t>(at.element)][k]);
        EXPECT_GE(at.weight[k], -1e-12);
        const Point& corner = mesh.node[static_cast<std::size_t>(at.node[k])];
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
  const Grid g = grid(GetParam());
  const Point x{0.0123, 0.0571};
  const double step = 1e-7;
  const Embedding at = locate(g, x);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    Point forward = x;
    Point backward = x;
    forward[axis] += step;
    backward[axis] -= step;
    const Embedding plus = locate(g, forward);
    const Embedding minus = locate(g, backward);
    for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k)
      EXPECT_NEAR(at.gradient[k][axis], (plus.weight[k] - minus.weight[k]) / (2 * step), 1e-6);
  }
}

TEST_P(EachElement, ContinuesTheNearestElementOutside) {
  const Grid g = grid(GetParam());
  const Mesh mesh = structured_grid(g);
  const Point x{0.03, 0.01};
  EXPECT_FALSE(inside(g, x));
  const Embedding at = locate(g, x);
  Point sum{};
  for (std::size_t k = 0; k < static_cast<std::size_t>(at.count); ++k)
    for (std::size_t axis = 0; axis < 2; ++axis) sum[axis] += at.weight[k] * mesh.node[static_cast<std::size_t>(at.node[k])][axis];
  EXPECT_NEAR(sum[0], x[0], 1e-15);
  EXPECT_NEAR(sum[1], x[1], 1e-15);
}

TEST(Mesh, RefusesGridsWithoutElements) {
  Grid g = grid(Element::Quad4);
  g.nodes[1] = 1;
  EXPECT_THROW((void)structured_grid(g), Error);
  g = grid(Element::Quad4);
  g.size_m[0] = -0.1;
  EXPECT_THROW((void)structured_grid(g), Error);
  g.size_m[0] = std::nan("");
  EXPECT_THROW((void)structured_grid(g), Error);
}

}  // namespace
}  // namespace trocar::fem
