#include "common/condense/candidates.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "common/condense/corridor.hpp"
#include "common/core/capacities.hpp"
#include "scenes.hpp"

namespace trocar::condense {
namespace {

using model::Cell;
using model::Vector2;
using testing::planar_scene;
using testing::solid_scene;

Candidates of(const scene::Scene& s) { return candidates_of(fem::make_mesh(s.tissue), s); }

scene::Corridor axis_corridor(double half_width_m) { return {{0.0, 0.0}, {0.0, 0.1}, half_width_m}; }

std::pair<double, double> x_range(const Candidates& c) {
  const auto [low, high] = std::minmax_element(c.node_m.begin(), c.node_m.end());
  return {(*low)[0], (*high)[0]};
}

TEST(Corridor, MeasuresToTouchingCrossingAndContainingCells) {
  const std::vector<Vector2> square{{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  EXPECT_EQ(distance_m({{-1, 0.5}, {2, 0.5}, 0}, square), 0.0);     // through
  EXPECT_EQ(distance_m({{0.2, 0.2}, {0.3, 0.3}, 0}, square), 0.0);  // inside
  EXPECT_EQ(distance_m({{1, -1}, {1, 2}, 0}, square), 0.0);         // along an edge
  EXPECT_DOUBLE_EQ(distance_m({{3, -5}, {3, 5}, 0}, square), 2.0);
  EXPECT_DOUBLE_EQ(distance_m({{4, 5}, {7, 9}, 0}, square), 5.0);  // end to corner
  EXPECT_DOUBLE_EQ(distance_m({{0.5, 3}, {0.5, 3}, 0}, square), 2.0);
}

TEST(Candidates, AreTheWholeMeshWithoutACorridor) {
  for (const auto element : {fem::Type::Quad4, fem::Type::Tri3}) {
    const Candidates c = of(planar_scene(element));
    EXPECT_EQ(c.node_m.size(), 121U);
    EXPECT_EQ(c.cell.size(), element == fem::Type::Quad4 ? 100U : 200U);
    for (const Cell& cell : c.cell) EXPECT_EQ(std::count(cell.neighbour.begin(), cell.neighbour.end(), model::limit), 0);
    for (const std::uint8_t flags : c.flags) EXPECT_TRUE(flags & model::whole_ring);
    EXPECT_EQ(std::count_if(c.flags.begin(), c.flags.end(), [](auto f) { return (f & 3) == 3; }), 11);  // y_max
    EXPECT_EQ(std::count_if(c.flags.begin(), c.flags.end(), [](auto f) { return (f & 3) == 0; }), 110);
    EXPECT_EQ(c.load.nonZeros(), 242);
    EXPECT_EQ(c.cell.front().material, 0);
    EXPECT_EQ(c.cell.back().material, 1);
  }
}

// Elements of 10 mm: those that touch |x| <= 4 mm have nodes at -10, 0 and 10 mm; the ring around them reaches to 20 mm.
TEST(Candidates, AreTheCorridorAndOneRingInThePlane) {
  scene::Scene s = planar_scene();
  s.corridor = axis_corridor(0.004);
  const Candidates c = of(s);
  EXPECT_EQ(c.node_m.size(), 5U * 11U);
  EXPECT_NEAR(x_range(c).first, -0.02, 1e-12);
  EXPECT_NEAR(x_range(c).second, 0.02, 1e-12);
  EXPECT_NEAR(c.edge_length_m, 0.01, 1e-12);
  for (std::size_t n = 0; n < c.node_m.size(); ++n) EXPECT_EQ((c.flags[n] & model::whole_ring) != 0, std::abs(c.node_m[n][0]) < 0.015) << n;
  int limits = 0;
  int surfaces = 0;
  for (const Cell& cell : c.cell)
    for (std::size_t k = 0; k < 4; ++k) {
      const Vector2& a = c.node_m[cell.node[k]];
      const Vector2& b = c.node_m[cell.node[(k + 1) % 4]];
      const bool side = std::abs(a[0] - b[0]) < 1e-9 && std::abs(std::abs(a[0]) - 0.02) < 1e-9;
      const bool end = std::abs(a[1] - b[1]) < 1e-9 && (a[1] < 1e-9 || a[1] > 0.0999);
      EXPECT_EQ(cell.neighbour[k] == model::limit, side);
      EXPECT_EQ(cell.neighbour[k] == model::surface, end);
      limits += side ? 1 : 0;
      surfaces += end ? 1 : 0;
    }
  EXPECT_EQ(limits, 20);
  EXPECT_EQ(surfaces, 8);
}

TEST(Candidates, TouchingCellsCountOnTheCorridorsEdge) {
  scene::Scene s = planar_scene();
  s.corridor = axis_corridor(0.01);
  EXPECT_NEAR(x_range(of(s)).second, 0.03, 1e-12);
  s.corridor = axis_corridor(0.01 - 1e-6);
  EXPECT_NEAR(x_range(of(s)).second, 0.02, 1e-12);
}

TEST(Candidates, OfASolidLieOnItsGridInTheNeedlesPlane) {
  scene::Scene s = solid_scene();
  const Candidates all = of(s);
  EXPECT_EQ(all.node_m.size(), 49U);
  s.corridor = axis_corridor(0.01);  // one element each side, exactly
  const Candidates c = of(s);
  EXPECT_EQ(c.node_m.size(), 3U * 7U);
  EXPECT_NEAR(x_range(c).second, 0.01, 1e-12);
  // Every column sums to one in its own direction and to nothing in the others.
  for (Eigen::Index column = 0; column < c.load.cols(); ++column) {
    double sum = 0.0;
    for (Eigen::SparseMatrix<double>::InnerIterator it(c.load, column); it; ++it) {
      EXPECT_EQ(it.row() % 3, column % 2);
      sum += it.value();
    }
    EXPECT_NEAR(sum, 1.0, 1e-12);
  }
}

TEST(Candidates, OfAMeshWithoutAGridGetUniformLines) {
  scene::Scene s = solid_scene();
  const fem::Mesh mesh = fem::make_mesh(s.tissue);
  s.tissue.grid.reset();  // as if it came from a file: mean edge of 10 x 10 x 4 mm bricks, 7.7 mm
  const Candidates c = candidates_of(mesh, s);
  EXPECT_EQ(c.node_m.size(), 81U);  // eight elements of 7.5 mm each way
  EXPECT_NEAR(c.edge_length_m, 0.0075, 1e-9);
  EXPECT_NEAR(x_range(c).first, -0.03, 1e-12);
}

TEST(Candidates, WithoutTissueAreRefused) {
  scene::Scene s = planar_scene();
  s.corridor = scene::Corridor{{0.2, 0.0}, {0.2, 0.1}, 0.004};
  EXPECT_THROW((void)of(s), fem::Error);
  scene::Scene above = solid_scene();
  above.plane_z_m = 0.0081;
  EXPECT_THROW((void)of(above), fem::Error);
  scene::Scene thin = solid_scene();
  thin.needle->outer_m.reset();
  EXPECT_THROW((void)of(thin), fem::Error);
}

TEST(Topology, FindsTheCellOfAPoint) {
  const Candidates c = of(planar_scene(fem::Type::Tri3));
  for (std::size_t i = 0; i < c.cell.size(); ++i) {
    Vector2 x{};
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t axis = 0; axis < 2; ++axis) x[axis] += c.node_m[c.cell[i].node[k]][axis] / 3.0;
    EXPECT_EQ(cell_at(c.node_m, c.cell, c.buckets, x), static_cast<std::int32_t>(i));
  }
  EXPECT_EQ(cell_at(c.node_m, c.cell, c.buckets, {0.0501, 0.05}), -1);
  EXPECT_GE(cell_at(c.node_m, c.cell, c.buckets, {0.05 + 0.9e-9, 0.05}), 0);
}

TEST(Topology, GradedMeshesGetSmallerBucketsUntilSearchesAreShort) {
  scene::Scene s = planar_scene();
  auto& x = s.tissue.grid->axis_m[0];
  x.clear();
  for (int i = 0; i <= 40; ++i) x.push_back(-0.05 + 0.1 * std::pow(i / 40.0, 3.0));
  const Candidates c = of(s);
  EXPECT_LE(c.buckets.longest, capacity::cells_per_bucket);
  for (int i = 0; i <= 60; ++i) x.push_back(0.05 + std::pow(10.0, -9.0 + i / 10.0));  // from a nanometre to a millimetre
  EXPECT_THROW((void)of(s), fem::Error);
}

TEST(Topology, ThreeCellsOnOneEdgeAreRefused) {
  std::vector<Cell> cells{{{0, 1, 2, 0}, {}, 3, 0}, {{1, 0, 3, 0}, {}, 3, 0}, {{1, 0, 4, 0}, {}, 3, 0}};
  EXPECT_THROW(join(cells, rings_of(cells, 5)), fem::Error);
}

}  // namespace
}  // namespace trocar::condense
