#include "common/fem/mesh.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "models.hpp"

namespace trocar::fem {
namespace {

using testing::graded_grid;
using testing::message_of;

class EachType : public ::testing::TestWithParam<Type> {};
INSTANTIATE_TEST_SUITE_P(Mesh, EachType, ::testing::Values(Type::Tri3, Type::Quad4, Type::Tet4, Type::Hex8));

// Volume (area in the plane) by splitting into simplices, without the kernels: bricks of a grid are boxes.
double volume(const Mesh& mesh, std::size_t e) {
  const element::Corners c = mesh.corners(e);
  const auto edge = [&](int a, int b) -> Eigen::Vector3d { return c.col(b) - c.col(a); };
  switch (mesh.type) {
    case Type::Tri3:
      return 0.5 * edge(0, 1).cross(edge(0, 2))[2];
    case Type::Quad4:
      return 0.5 * (edge(0, 1).cross(edge(0, 2))[2] + edge(0, 2).cross(edge(0, 3))[2]);
    case Type::Tet4:
      return edge(0, 1).cross(edge(0, 2)).dot(edge(0, 3)) / 6.0;
    case Type::Hex8:
      break;
  }
  return edge(0, 1).cross(edge(0, 3)).dot(edge(0, 4));
}

TEST_P(EachType, GradedGridFillsItsBoxWithPositiveElements) {
  const Grid grid = graded_grid(GetParam());
  const Mesh mesh = structured_grid(grid);
  double box = 1.0;
  std::size_t nodes = 1;
  for (const auto& axis : grid.axis_m) {
    if (axis.empty()) continue;
    box *= axis.back() - axis.front();
    nodes *= axis.size();
  }
  EXPECT_EQ(mesh.node.size(), nodes);
  double sum = 0.0;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    EXPECT_GT(volume(mesh, e), 0.0);
    sum += volume(mesh, e);
    for (int k = mesh.nodes_per_element(); k < 8; ++k) EXPECT_EQ(mesh.element[e][static_cast<std::size_t>(k)], -1);
  }
  EXPECT_NEAR(sum, box, 1e-12 * box);
}

// Each inner face of the tetrahedra belongs to two, each outer one to one whose nodes lie on one side of the box.
TEST(Mesh, TetrahedraConform) {
  const Mesh mesh = structured_grid(graded_grid(Type::Tet4));
  std::map<std::array<int, 3>, int> faces;
  for (const auto& e : mesh.element)
    for (std::size_t skip = 0; skip < 4; ++skip) {
      std::array<int, 3> face{};
      for (std::size_t k = 0, at = 0; k < 4; ++k)
        if (k != skip) face[at++] = e[k];
      std::sort(face.begin(), face.end());
      ++faces[face];
    }
  const Box bounds = bounding_box(mesh);
  for (const auto& [face, count] : faces) {
    ASSERT_LE(count, 2);
    bool outer = false;
    for (std::size_t a = 0; a < 3; ++a)
      for (const double wall : {bounds.min_m[a], bounds.max_m[a]}) {
        bool all = true;
        for (const int n : face) all = all && mesh.node[static_cast<std::size_t>(n)][a] == wall;
        outer = outer || all;
      }
    EXPECT_EQ(count, outer ? 1 : 2);
  }
}

TEST_P(EachType, LocatorFindsTheElementThatHoldsAPoint) {
  const Mesh mesh = testing::distorted(graded_grid(GetParam()));
  const Locator locator(mesh);
  const Box bounds = bounding_box(mesh);
  const int steps = mesh.dimension() == 2 ? 40 : 11;
  for (int i = 0; i <= steps; ++i)
    for (int j = 0; j <= steps; ++j)
      for (int k = 0; k <= (mesh.dimension() == 2 ? 0 : steps); ++k) {
        Point x{};
        const std::array<int, 3> at{i, j, k};
        for (std::size_t a = 0; a < 3; ++a) x[a] = bounds.min_m[a] + (bounds.max_m[a] - bounds.min_m[a]) * at[a] / steps;
        const auto found = locator.locate(x);
        ASSERT_TRUE(found.has_value()) << x[0] << ' ' << x[1] << ' ' << x[2];
        Point sum{};
        double weights = 0.0;
        for (std::size_t n = 0; n < static_cast<std::size_t>(found->count); ++n) {
          EXPECT_EQ(found->node[n], mesh.element[static_cast<std::size_t>(found->element)][n]);
          EXPECT_GT(found->weight[n], -1e-6);
          weights += found->weight[n];
          for (std::size_t a = 0; a < 3; ++a) sum[a] += found->weight[n] * mesh.node[static_cast<std::size_t>(found->node[n])][a];
        }
        EXPECT_NEAR(weights, 1.0, 1e-12);
        for (std::size_t a = 0; a < 3; ++a) EXPECT_NEAR(sum[a], x[a], 1e-12);
      }
}

TEST_P(EachType, LocatorKnowsOutside) {
  const Mesh mesh = structured_grid(graded_grid(GetParam()));
  const Locator locator(mesh);
  const Box bounds = bounding_box(mesh);
  const double middle = 0.5 * (bounds.min_m[1] + bounds.max_m[1]);
  EXPECT_TRUE(locator.locate({bounds.min_m[0] - 0.9e-9, middle, bounds.min_m[2]}).has_value());
  EXPECT_FALSE(locator.locate({bounds.min_m[0] - 1e-6, middle, bounds.min_m[2]}).has_value());
  EXPECT_TRUE(locator.locate({bounds.min_m[0] - 1e-6, middle, bounds.min_m[2]}, 2e-6).has_value());
  EXPECT_FALSE(locator.locate({std::nan(""), middle, 0.0}).has_value());
}

TEST_P(EachType, NearestNodeIsTheNearestOfAll) {
  const Mesh mesh = testing::distorted(graded_grid(GetParam()));
  const Locator locator(mesh);
  unsigned state = 7;
  const auto random = [&state] {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / 16777216.0;
  };
  for (int i = 0; i < 300; ++i) {
    const Point x{-0.2 + 0.4 * random(), -0.2 + 0.4 * random(), mesh.dimension() == 3 ? -0.2 + 0.4 * random() : 0.0};
    const auto distance = [&](std::size_t n) {
      const Point& p = mesh.node[n];
      return std::hypot(p[0] - x[0], p[1] - x[1], p[2] - x[2]);
    };
    std::size_t best = 0;
    for (std::size_t n = 1; n < mesh.node.size(); ++n)
      if (distance(n) < distance(best)) best = n;
    EXPECT_DOUBLE_EQ(distance(static_cast<std::size_t>(locator.nearest_node(x))), distance(best));
  }
}

TEST(Mesh, SidesAndBoxesAndGroupsChooseNodes) {
  Mesh mesh = structured_grid(uniform_grid(Type::Hex8, {0.0, 0.0, 0.0}, {0.1, 0.3, 0.7}, {3, 4, 8}));
  EXPECT_EQ(nodes_at(mesh, Side::XMin).size(), 32u);
  EXPECT_EQ(nodes_at(mesh, Side::XMax).size(), 32u);
  EXPECT_EQ(nodes_at(mesh, Side::YMax).size(), 24u);
  EXPECT_EQ(nodes_at(mesh, Side::ZMin), (std::vector<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11}));
  EXPECT_EQ(nodes_at(mesh, Box{}).size(), mesh.node.size());
  EXPECT_EQ(nodes_at(mesh, Box{{0.05, 0.1, 0.1}, {0.05, 0.3, 0.2}}).size(), 1u * 3 * 2);
  EXPECT_TRUE(nodes_at(mesh, Box{{1.0, 1.0, 1.0}, {2.0, 2.0, 2.0}}).empty());
  mesh.group["skin"] = {3, 5};
  EXPECT_EQ(nodes_at(mesh, std::string("skin")), (std::vector<int>{3, 5}));
  EXPECT_EQ(message_of([&] { (void)nodes_at(mesh, std::string("bone")); }), "the mesh has no group \"bone\"; it has \"skin\"");
  EXPECT_NE(message_of([&] { (void)nodes_at(structured_grid(graded_grid(Type::Quad4)), Side::ZMax); }).find("planar"), std::string::npos);
}

TEST(Mesh, LaterZonesOverrideEarlierOnes) {
  Mesh mesh = structured_grid(uniform_grid(Type::Quad4, {0.0, 0.0, 0.0}, {0.4, 0.1, 0.0}, {5, 2, 1}));
  mesh.region_name = {"fat", "muscle"};
  mesh.region = {0, 0, 1, -1};
  const Material m{1e4, 0.4};
  Box left;
  left.max_m[0] = 0.1;
  EXPECT_EQ(zones_of(mesh, {{m, {}, {}}, {m, {}, "muscle"}, {m, left, {}}}), (std::vector<int>{2, 0, 1, 0}));
  EXPECT_EQ(zones_of(mesh, {{m, {}, {}}, {m, left, "muscle"}}), (std::vector<int>{0, 0, 0, 0}));
  EXPECT_NE(message_of([&] { (void)zones_of(mesh, {{m, {}, "fat"}, {m, {}, "muscle"}}); }).find("no material at (0.35"), std::string::npos);
  EXPECT_EQ(message_of([&] { (void)zones_of(mesh, {{m, {}, "bone"}}); }), "the mesh has no region \"bone\"; it has \"fat\", \"muscle\"");
}

TEST(Mesh, RefusesGridsWithoutElements) {
  const auto refusal = [](const Grid& grid) { return message_of([&] { (void)structured_grid(grid); }); };
  Grid grid = graded_grid(Type::Quad4);
  EXPECT_EQ(refusal(grid), "");
  grid.axis_m[1] = {0.0};
  EXPECT_NE(refusal(grid).find("1 nodes along y"), std::string::npos);
  grid.axis_m[1] = {0.0, 0.1, 0.1};
  EXPECT_NE(refusal(grid).find("along y must be finite and increase; entry 3 is 0.1"), std::string::npos);
  grid.axis_m[1] = {0.0, std::nan("")};
  EXPECT_NE(refusal(grid).find("finite"), std::string::npos);
  grid = graded_grid(Type::Hex8);
  grid.element = Type::Tri3;
  EXPECT_NE(refusal(grid).find("planar"), std::string::npos);
  grid.element = Type::Tet4;
  grid.axis_m[2].clear();
  EXPECT_NE(refusal(grid).find("0 nodes along z"), std::string::npos);
  EXPECT_THROW((void)uniform_grid(Type::Quad4, {}, {0.1, -0.1, 0.0}, {3, 3, 1}), Error);
  EXPECT_THROW((void)uniform_grid(Type::Quad4, {}, {0.1, 0.1, 0.0}, {3, 1, 1}), Error);
  EXPECT_THROW((void)structured_grid(uniform_grid(Type::Hex8, {}, {0.1, 0.1, 0.1}, {300, 300, 300})), Error);
}

}  // namespace
}  // namespace trocar::fem
