#include "common/contact/geometry.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/reference/grid_image/grid_image.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::contact {
namespace {

using reference::GridImage;

struct Mesh {
  const char* name;
  reference::Block block;
};

class GeometryOnMesh : public ::testing::TestWithParam<Mesh> {
 protected:
  GridImage grid{GetParam().block};
  Geometry geometry{};
  reference::Random random{1};
  void SetUp() override { geometry.open(grid.image().tissue); }
  Vector2 anywhere() { return {random.uniform(-0.05, 0.05), random.uniform(0.0, 0.1)}; }
};

INSTANTIATE_TEST_SUITE_P(Meshes, GeometryOnMesh,
                         ::testing::Values(Mesh{"tri", {.element = fem::Type::Tri3, .nodes_x = 11, .nodes_y = 11}},
                                           Mesh{"quad", {.nodes_x = 11, .nodes_y = 11}},
                                           Mesh{"bent_tri", {.element = fem::Type::Tri3, .nodes_x = 11, .nodes_y = 11, .distortion = 0.25}},
                                           Mesh{"bent_quad", {.nodes_x = 11, .nodes_y = 11, .distortion = 0.25}}),
                         [](const auto& made) { return made.param.name; });

TEST_P(GeometryOnMesh, LocatesPointsWhereAnotherSearchDoes) {
  const fem::Locator locator(grid.mesh());
  std::int32_t hint = -1;
  for (int k = 0; k < 5000; ++k) {
    const Vector2 x = anywhere();
    const std::int32_t cold = geometry.locate(x, -1);
    ASSERT_GE(cold, 0);
    ASSERT_TRUE(geometry.inside(cold, x));
    const std::int32_t warm = geometry.locate(x, hint);
    ASSERT_TRUE(geometry.inside(warm, x));
    hint = warm;
    // Shape functions, too, are those of common/fem, whichever cell answers on an edge.
    const auto known = locator.locate({x[0], x[1], 0.0});
    ASSERT_TRUE(known.has_value());
    const Embedding at = geometry.point(cold, x);
    if (known->element != cold) continue;
    for (std::uint32_t p = 0; p < at.count; ++p) {
      double weight = 0.0;
      for (int q = 0; q < known->count; ++q)
        if (known->node[static_cast<std::size_t>(q)] == static_cast<int>(at.node[p])) weight += known->weight[static_cast<std::size_t>(q)];
      EXPECT_NEAR(at.weight[p], weight, 1e-9);
    }
  }
}

TEST_P(GeometryOnMesh, FindsNothingOutside) {
  for (const Vector2& x : {Vector2{-0.0501, 0.05}, Vector2{0.0501, 0.05}, Vector2{0.0, -0.0001}, Vector2{0.0, 0.1001}, Vector2{1e300, 0.0},
                           Vector2{0.0, -1e300}, Vector2{std::numeric_limits<double>::quiet_NaN(), 0.05},
                           Vector2{0.0, std::numeric_limits<double>::infinity()}})
    EXPECT_EQ(geometry.locate(x, -1), -1) << x[0] << ' ' << x[1];
  // And the hint does not hold on to it.
  EXPECT_EQ(geometry.locate({0.0, -0.0001}, geometry.locate({0.0, 0.001}, -1)), -1);
}

TEST_P(GeometryOnMesh, FindsEveryNodeAndEveryMiddleOfAnEdge) {
  for (std::size_t c = 0; c < grid.image().tissue.cell.size(); ++c) {
    const model::Cell& cell = grid.image().tissue.cell[c];
    for (std::size_t k = 0; k < cell.count; ++k) {
      const Vector2 a = geometry.node_m(cell.node[k]);
      const Vector2 b = geometry.node_m(cell.node[(k + 1) % cell.count]);
      EXPECT_GE(geometry.locate(a, -1), 0);
      EXPECT_GE(geometry.locate({0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])}, -1), 0);
      EXPECT_TRUE(geometry.inside(static_cast<std::int32_t>(c), a));
    }
  }
}

TEST_P(GeometryOnMesh, ShapeFunctionsReproduceLinearFieldsAndTheirGradients) {
  for (int k = 0; k < 500; ++k) {
    const Vector2 x = anywhere();
    const std::int32_t cell = geometry.locate(x, -1);
    const CellShape at = geometry.shape(cell, x);
    double sum = 0.0;
    Vector2 mean{};
    std::array<double, 4> gradient{};
    Vector2 of_one{};
    for (std::uint32_t p = 0; p < at.count; ++p) {
      const Vector2 node = geometry.node_m(grid.image().tissue.cell[static_cast<std::size_t>(cell)].node[p]);
      sum += at.weight[p];
      for (std::size_t a = 0; a < 2; ++a) {
        mean[a] += at.weight[p] * node[a];
        of_one[a] += at.gradient[p][a];
        for (std::size_t b = 0; b < 2; ++b) gradient[2 * a + b] += node[a] * at.gradient[p][b];
      }
    }
    EXPECT_NEAR(sum, 1.0, 1e-14);
    for (std::size_t a = 0; a < 2; ++a) {
      EXPECT_NEAR(mean[a], x[a], 1e-14);
      EXPECT_NEAR(of_one[a], 0.0, 1e-10);
    }
    EXPECT_NEAR(gradient[0], 1.0, 1e-12);
    EXPECT_NEAR(gradient[1], 0.0, 1e-12);
    EXPECT_NEAR(gradient[2], 0.0, 1e-12);
    EXPECT_NEAR(gradient[3], 1.0, 1e-12);
  }
}

TEST_P(GeometryOnMesh, GradientsAreThoseOfFiniteDifferences) {
  constexpr double h = 1e-7;
  for (int k = 0; k < 200; ++k) {
    const Vector2 x = anywhere();
    const std::int32_t cell = geometry.locate(x, -1);
    const CellShape at = geometry.shape(cell, x);
    for (std::size_t a = 0; a < 2; ++a) {
      Vector2 low = x;
      Vector2 high = x;
      low[a] -= h;
      high[a] += h;
      const CellShape left = geometry.shape(cell, low);
      const CellShape right = geometry.shape(cell, high);
      for (std::uint32_t p = 0; p < at.count; ++p)
        EXPECT_NEAR(at.gradient[p][a], (right.weight[p] - left.weight[p]) / (2 * h), 1e-4 * 100.0);
    }
  }
}

// A mean over a line must see a linear field as its middle does, and sum to one, within few nodes.
TEST_P(GeometryOnMesh, SegmentMeansAreExactForLinearFields) {
  for (int k = 0; k < 2000; ++k) {
    const Vector2 from = anywhere();
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    const double length = random.uniform(0.0, 0.012);
    const Vector2 to{from[0] + length * std::cos(angle), from[1] + length * std::sin(angle)};
    if (geometry.locate(to, -1) < 0) continue;
    const Embedding at = geometry.segment(from, to, geometry.locate(from, -1));
    double sum = 0.0;
    for (std::uint32_t p = 0; p < at.count; ++p) {
      sum += at.weight[p];
      for (std::uint32_t q = 0; q < p; ++q) EXPECT_NE(at.node[p], at.node[q]);
    }
    const Vector2 mean = geometry.mean_m(at);
    EXPECT_NEAR(sum, 1.0, 1e-13);
    EXPECT_NEAR(mean[0], 0.5 * (from[0] + to[0]), 1e-13);
    EXPECT_NEAR(mean[1], 0.5 * (from[1] + to[1]), 1e-13);
    EXPECT_LE(at.count, capacity::embedding_nodes);
  }
}

// Against the mean of many points, found by another search.
TEST_P(GeometryOnMesh, SegmentMeansAreMeansOfTheShapeFunctions) {
  const fem::Locator locator(grid.mesh());
  for (int k = 0; k < 100; ++k) {
    const Vector2 from{random.uniform(-0.035, 0.035), random.uniform(0.015, 0.085)};
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    const Vector2 to{from[0] + 0.01 * std::cos(angle), from[1] + 0.01 * std::sin(angle)};
    std::vector<double> weight(grid.mesh().node.size());
    constexpr int samples = 2000;
    for (int i = 0; i < samples; ++i) {
      const double s = (i + 0.5) / samples;
      const auto at = locator.locate({from[0] + s * (to[0] - from[0]), from[1] + s * (to[1] - from[1]), 0.0});
      ASSERT_TRUE(at.has_value());
      for (std::size_t p = 0; p < static_cast<std::size_t>(at->count); ++p)
        weight[static_cast<std::size_t>(at->node[p])] += at->weight[p] / samples;
    }
    const Embedding mean = geometry.segment(from, to, geometry.locate(from, -1));
    // Kinks of the shape functions between the 8 points cost up to a hundredth.
    for (std::uint32_t p = 0; p < mean.count; ++p) {
      EXPECT_NEAR(mean.weight[p], weight[mean.node[p]], 0.012);
      weight[mean.node[p]] = 0.0;
    }
    for (const double rest : weight) EXPECT_LT(std::abs(rest), 0.012);
  }
}

TEST_P(GeometryOnMesh, WalksFromFaceToFaceAcrossNeighbours) {
  for (int k = 0; k < 300; ++k) {
    Vector2 at = anywhere();
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    const Vector2 direction{std::cos(angle), std::sin(angle)};
    std::int32_t cell = geometry.locate(at, -1);
    double walked = 0.0;
    int steps = 0;
    while (true) {
      const Exit exit = geometry.exit(cell, at, direction);
      ASSERT_TRUE(std::isfinite(exit.distance));
      ASSERT_GE(exit.distance, 0.0);
      const Vector2 to{at[0] + exit.distance * direction[0], at[1] + exit.distance * direction[1]};
      ASSERT_TRUE(geometry.inside(cell, to));
      ASSERT_TRUE(geometry.inside(cell, {0.5 * (at[0] + to[0]), 0.5 * (at[1] + to[1])}));
      walked += exit.distance;
      at = to;
      cell = grid.image().tissue.cell[static_cast<std::size_t>(cell)].neighbour[exit.edge];
      if (cell < 0) break;
      ASSERT_LT(++steps, 100);
    }
    EXPECT_EQ(cell, model::surface);
    // The end lies on the square's boundary.
    const double to_side = std::min({std::abs(at[0] - 0.05), std::abs(at[0] + 0.05), std::abs(at[1]), std::abs(at[1] - 0.1)});
    EXPECT_LT(to_side, 1e-10);
    EXPECT_LT(walked, 0.1415);
  }
}

// Straight along mesh lines and through nodes, where every comparison is a tie.
TEST(Geometry, WalksAlongMeshLinesAndThroughNodes) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4}) {
    const GridImage grid({.element = type, .nodes_x = 11, .nodes_y = 11});
    Geometry geometry;
    geometry.open(grid.image().tissue);
    const double diagonal = std::numbers::sqrt2 / 2;
    for (const Vector2& direction : {Vector2{0.0, 1.0}, Vector2{diagonal, diagonal}, Vector2{-diagonal, diagonal}, Vector2{1e-12, 1.0},
                                     Vector2{-1e-12, 1.0}, Vector2{std::sin(1e-8), std::cos(1e-8)}}) {
      Vector2 at{0.0, 0.0};
      std::int32_t cell = geometry.locate(at, -1);
      ASSERT_GE(cell, 0);
      int steps = 0;
      while (cell >= 0) {
        const Exit exit = geometry.exit(cell, at, direction);
        ASSERT_TRUE(std::isfinite(exit.distance));
        at = {at[0] + exit.distance * direction[0], at[1] + exit.distance * direction[1]};
        cell = grid.image().tissue.cell[static_cast<std::size_t>(cell)].neighbour[exit.edge];
        ASSERT_LT(++steps, 60);
      }
      const double along = std::abs(direction[0]) > 0.5 ? 0.05 : 0.1;
      EXPECT_NEAR(std::max(std::abs(at[0]), along == 0.1 ? at[1] : 0.0), along, 1e-9);
    }
  }
}

TEST(Geometry, MovedNodesMoveTheirCells) {
  const GridImage grid({.nodes_x = 11, .nodes_y = 11});
  Geometry geometry;
  geometry.open(grid.image().tissue);
  const std::uint32_t node = 5 * 11 + 5;
  const Vector2 before = geometry.node_m(node);
  const Vector2 after{before[0] + 0.004, before[1] - 0.003};
  geometry.move(node, after);
  EXPECT_EQ(geometry.node_m(node), after);
  EXPECT_TRUE(geometry.is_moved(node));
  EXPECT_FALSE(geometry.is_moved(node + 1));
  reference::Random random(2);
  for (int k = 0; k < 2000; ++k) {
    const Vector2 x{random.uniform(-0.0499, 0.0499), random.uniform(0.0, 0.0999)};
    const std::int32_t cell = geometry.locate(x, -1);
    ASSERT_GE(cell, 0) << x[0] << ' ' << x[1];
    ASSERT_TRUE(geometry.inside(cell, x));
    const Vector2 mean = geometry.mean_m(geometry.point(cell, x));
    EXPECT_NEAR(mean[0], x[0], 1e-13);
    EXPECT_NEAR(mean[1], x[1], 1e-13);
  }
  // Moved twice, it is one moved node.
  geometry.move(node, before);
  EXPECT_EQ(geometry.moved(), 1u);
  geometry.restore();
  EXPECT_EQ(geometry.moved(), 0u);
  EXPECT_EQ(geometry.node_m(node), before);
  EXPECT_FALSE(geometry.is_moved(node));
}

TEST(Geometry, ASingleNodeIsItself) {
  const Embedding at = single_node(7);
  ASSERT_EQ(at.count, 1u);
  EXPECT_EQ(at.node[0], 7u);
  EXPECT_EQ(at.weight[0], 1.0);
}

}  // namespace
}  // namespace trocar::contact
