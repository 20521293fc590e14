#include "common/condense/spread.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "scenes.hpp"

namespace trocar::condense {
namespace {

// Mean of ln |a - b| over pairs of points in the cross-section of a line of balls of radius 1, by sampling the balls themselves.
TEST(BallRadius, GivesALineTheSelfComplianceOfTheNeedlesSurface) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> coordinate(-1.0, 1.0);
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi);
  const auto in_ball = [&] {
    for (;;) {
      const std::array<double, 3> x{coordinate(random), coordinate(random), coordinate(random)};
      if (x[0] * x[0] + x[1] * x[1] + x[2] * x[2] <= 1.0) return std::array<double, 2>{x[0], x[1]};
    }
  };
  const auto on_circle = [&] {
    const double a = angle(random);
    return std::array<double, 2>{std::cos(a), std::sin(a)};
  };
  const auto mean_log = [](const auto& sample) {
    constexpr int pairs = 2'000'000;
    double sum = 0.0;
    for (int i = 0; i < pairs; ++i) {
      const auto a = sample();
      const auto b = sample();
      sum += std::log(std::hypot(a[0] - b[0], a[1] - b[1]));
    }
    return sum / pairs;
  };
  // The standard deviation of ln |a - b| is below 1, so the means are good to 0.0007 (one sigma).
  const double circle = mean_log(on_circle);
  EXPECT_NEAR(circle, 0.0, 0.003);
  EXPECT_NEAR(std::exp(circle - mean_log(in_ball)), ball_per_needle_radius, 0.006);
}

TEST(BallRadius, IsItsClosedForm) {
  EXPECT_NEAR(ball_per_needle_radius, std::exp(1.75) / 4.0, 1e-12);
  // ln c = 1/2 integral of (1 - (1 - s)^(3/2))^2 / s, by the midpoint rule.
  constexpr int steps = 100000;
  double sum = 0.0;
  for (int i = 0; i < steps; ++i) {
    const double s = (i + 0.5) / steps;
    const double m = 1.0 - std::pow(1.0 - s, 1.5);
    sum += m * m / s / steps;
  }
  EXPECT_NEAR(std::log(ball_per_needle_radius), 0.5 * sum, 1e-8);
}

TEST(BallRule, IntegratesPolynomialsAndKinks) {
  for (const int n : {4, 8, 15}) {
    const BallRule rule = ball_rule(n);
    double one = 0.0, x = 0.0, xx = 0.0, yyzz = 0.0, corner = 0.0;
    for (std::size_t q = 0; q < rule.point.size(); ++q) {
      const auto& p = rule.point[q];
      one += rule.weight[q];
      x += rule.weight[q] * p[0];
      xx += rule.weight[q] * p[2] * p[2];
      yyzz += rule.weight[q] * p[1] * p[1] * p[2] * p[2];
      corner += rule.weight[q] * std::abs(p[0]);
    }
    EXPECT_NEAR(one, 1.0, 1e-13);
    EXPECT_NEAR(x, 0.0, 1e-15);
    const double tolerance = n == 4 ? 1e-4 : 1e-10;
    EXPECT_NEAR(xx, 1.0 / 5.0, tolerance);
    EXPECT_NEAR(yyzz, 1.0 / 35.0, tolerance);
    EXPECT_NEAR(corner, 3.0 / 8.0, tolerance);
  }
}

class BallWeights : public ::testing::Test {
 protected:
  // Elements of 10 x 10 x 4 mm.
  const fem::Mesh mesh = fem::make_mesh(testing::solid_scene().tissue);
  const fem::Locator locator{mesh};
  static double sum(const std::vector<NodeWeight>& weights) {
    double all = 0.0;
    for (const NodeWeight& w : weights) all += w.weight;
    return all;
  }
};

TEST_F(BallWeights, ReproduceLinearFieldsInsideTheTissue) {
  for (const double radius : {1e-9, 1e-3, 7e-3}) {
    const fem::Point centre{0.0013, 0.0311, 0.0002};
    const auto weights = ball_weights(locator, centre, radius, ball_rule(ball_order(radius, 0.004)));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double mean = 0.0;
      for (const NodeWeight& w : weights) mean += w.weight * mesh.node[static_cast<std::size_t>(w.node)][axis];
      EXPECT_NEAR(mean, centre[axis], 1e-15) << radius;
    }
    EXPECT_NEAR(sum(weights), 1.0, 1e-13);
  }
}

// On a node of a brick mesh, all eight octants alike: mean of (1 - x/hx)(1 - y/hy)(1 - z/hz) over an octant of the ball. Means there,
// radius 1: x 3/8, xy 2/(5 pi), xyz (1/48) / (pi/6).
TEST_F(BallWeights, OnANodeAreTheMeanOfItsHat) {
  const double a = 0.002;
  const double px = a / 0.01;
  const double pz = a / 0.004;
  const double expected = 1.0 - 3.0 / 8.0 * (2 * px + pz) + 2.0 / (5.0 * std::numbers::pi) * (px * px + 2 * px * pz) -
                          1.0 / (8.0 * std::numbers::pi) * px * px * pz;
  for (const auto& [order, tolerance] : {std::pair{ball_order(a, 0.004), 1e-5}, std::pair{15, 1e-12}}) {
    const auto weights = ball_weights(locator, {0.0, 0.03, 0.0}, a, ball_rule(order));
    ASSERT_EQ(weights.size(), 27U);
    const auto most = std::max_element(weights.begin(), weights.end(), [](const auto& l, const auto& r) { return l.weight < r.weight; });
    EXPECT_NEAR(most->weight, expected, tolerance);
  }
}

TEST_F(BallWeights, DropWhatLiesOutsideAndStillSumToOne) {
  const auto weights = ball_weights(locator, {0.0, 0.0, 0.0}, 0.003, ball_rule(6));  // half of it
  EXPECT_NEAR(sum(weights), 1.0, 1e-13);
  double y = 0.0;
  for (const NodeWeight& w : weights) y += w.weight * mesh.node[static_cast<std::size_t>(w.node)][1];
  EXPECT_NEAR(y, 3.0 / 8.0 * 0.003, 1e-6);
  EXPECT_TRUE(ball_weights(locator, {0.0, -0.1, 0.0}, 0.003, ball_rule(6)).empty());
}

// Radius four times the element: the order that ball_order picks agrees with a finer rule.
TEST_F(BallWeights, AreResolvedUpToFourElementsInTheNeedlesRadius) {
  scene::Scene s = testing::solid_scene();
  s.tissue.grid = fem::uniform_grid(fem::Type::Hex8, {-0.008, -0.008, -0.008}, {0.016, 0.016, 0.016}, {17, 17, 17});
  const fem::Mesh fine = fem::make_mesh(s.tissue);
  const fem::Locator in_fine(fine);
  const double a = ball_per_needle_radius * 0.004;
  ASSERT_EQ(ball_order(a, 0.001), 15);
  const auto chosen = ball_weights(in_fine, {0.0, 0.0, 0.0}, a, ball_rule(15));
  const auto finer = ball_weights(in_fine, {0.0, 0.0, 0.0}, a, ball_rule(30));
  std::map<int, double> difference;
  for (const NodeWeight& w : chosen) difference[w.node] += w.weight;
  for (const NodeWeight& w : finer) difference[w.node] -= w.weight;
  double change = 0.0;
  for (const auto& [node, d] : difference) change += std::abs(d);
  EXPECT_LT(change, 0.03);  // of all weights, which sum to 1
}

}  // namespace
}  // namespace trocar::condense
