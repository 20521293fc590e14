#include "common/fem/subdivide.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "cases.hpp"
#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using element::Random;
using testing::block;
using testing::distorted;
using testing::message_of;

Mesh tissue_mesh() { return distorted(uniform_grid(Type::Tri3, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {11, 11, 1})); }

double area(const Mesh& mesh, std::size_t e) {
  const Point& a = mesh.node[static_cast<std::size_t>(mesh.element[e][0])];
  const Point& b = mesh.node[static_cast<std::size_t>(mesh.element[e][1])];
  const Point& c = mesh.node[static_cast<std::size_t>(mesh.element[e][2])];
  return 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]));
}

double total_area(const Mesh& mesh) {
  double sum = 0.0;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) sum += area(mesh, e);
  return sum;
}

// How many triangles run along each edge in its direction; a conforming mesh has 1 each way, or 1 and none on the boundary.
std::map<std::pair<int, int>, int> directed_edges(const Mesh& mesh) {
  std::map<std::pair<int, int>, int> edges;
  for (const auto& e : mesh.element)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{e[k], e[(k + 1) % 3]}];
  return edges;
}

double boundary_length(const Mesh& mesh) {
  const auto edges = directed_edges(mesh);
  double length = 0.0;
  for (const auto& [edge, count] : edges) {
    if (edges.contains({edge.second, edge.first})) continue;
    const Point& a = mesh.node[static_cast<std::size_t>(edge.first)];
    const Point& b = mesh.node[static_cast<std::size_t>(edge.second)];
    length += std::hypot(b[0] - a[0], b[1] - a[1]);
  }
  return length;
}

// What must hold after any number of subdivisions. Nodes that hang on an edge would lengthen the boundary.
void expect_sound(const Mesh& mesh, const Mesh& before) {
  const double whole = total_area(before);
  for (std::size_t e = 0; e < mesh.element.size(); ++e) EXPECT_GT(area(mesh, e), 0.0);
  EXPECT_NEAR(total_area(mesh), whole, 1e-13 * whole);
  for (const auto& [edge, count] : directed_edges(mesh)) EXPECT_EQ(count, 1);
  EXPECT_NEAR(boundary_length(mesh), boundary_length(before), 1e-12);
  EXPECT_EQ(mesh.region.size(), before.region.empty() ? 0 : mesh.element.size());
}

// Distance from the line, largest over the nodes; they must be in order and joined by edges.
double expect_chain(const Mesh& mesh, const std::vector<int>& path, const Point& from, const Point& to) {
  const double length = std::hypot(to[0] - from[0], to[1] - from[1]);
  const double dx = (to[0] - from[0]) / length;
  const double dy = (to[1] - from[1]) / length;
  const auto edges = directed_edges(mesh);
  double last = -1.0;
  double off = 0.0;
  for (std::size_t k = 0; k < path.size(); ++k) {
    const Point& x = mesh.node[static_cast<std::size_t>(path[k])];
    const double along = (x[0] - from[0]) * dx + (x[1] - from[1]) * dy;
    EXPECT_GT(along, last);
    last = along;
    off = std::max(off, std::abs((x[1] - from[1]) * dx - (x[0] - from[0]) * dy));
    if (k == 0) continue;
    EXPECT_TRUE(edges.contains({path[k - 1], path[k]}) || edges.contains({path[k], path[k - 1]}))
        << "nodes " << path[k - 1] << " and " << path[k] << " are not joined";
  }
  return off;
}

TEST(Subdivide, BisectsAnEdgeBetweenTwoTriangles) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {2, 2, 1}));  // diagonal from node 0 to node 3
  const Mesh before = mesh;
  EXPECT_EQ(insert_node_on_edge(mesh, 3, 0, {0.25, 0.25, 0.0}), 4);
  EXPECT_EQ(mesh.element.size(), 4u);
  expect_sound(mesh, before);
  std::vector<double> areas;
  for (std::size_t e = 0; e < 4; ++e) areas.push_back(area(mesh, e));
  std::sort(areas.begin(), areas.end());
  EXPECT_NEAR(areas[0], 0.125, 1e-15);
  EXPECT_NEAR(areas[3], 0.375, 1e-15);
  // On the boundary there is one triangle beside.
  EXPECT_EQ(insert_node_on_edge(mesh, 0, 1, {0.5, 0.0, 0.0}), 5);
  EXPECT_EQ(mesh.element.size(), 5u);
  expect_sound(mesh, before);
}

TEST(Subdivide, RandomPathsLeaveAConformingMeshOfPositiveTriangles) {
  Random random(1);
  for (int trial = 0; trial < 200; ++trial) {
    Mesh mesh = tissue_mesh();
    const Mesh before = mesh;
    const Point from{random(-0.06, 0.06), random(-0.02, 0.12), 0.0};
    const Point to{random(-0.06, 0.06), random(-0.02, 0.12), 0.0};
    const std::vector<int> path = subdivide(mesh, from, to);
    expect_sound(mesh, before);
    EXPECT_LE(expect_chain(mesh, path, from, to), default_snap * 0.0142);  // no edge is longer than the diagonal
  }
}

TEST(Subdivide, WithoutSnapEveryNodeLiesOnTheLine) {
  Random random(2);
  for (int trial = 0; trial < 100; ++trial) {
    Mesh mesh = tissue_mesh();
    const Mesh before = mesh;
    const Point from{random(-0.05, 0.05), -0.001, 0.0};
    const Point to{random(-0.05, 0.05), random(0.02, 0.099), 0.0};
    const std::vector<int> path = subdivide(mesh, from, to, 0.0);
    expect_sound(mesh, before);
    EXPECT_GT(path.size(), 3u);
    EXPECT_LT(expect_chain(mesh, path, from, to), 1e-11);
    const std::size_t size = mesh.node.size();
    EXPECT_EQ(subdivide(mesh, from, to, 0.0), path);
    EXPECT_EQ(mesh.node.size(), size);  // a second time there is nothing left to cut
  }
}

// A path that grows by pieces, bends included: the same soundness, and for a straight one the same nodes as at once.
TEST(Subdivide, GrowsByPieces) {
  Random random(3);
  for (int trial = 0; trial < 50; ++trial) {
    Mesh pieces = tissue_mesh();
    Mesh whole = pieces;
    const Mesh before = pieces;
    const Point from{random(-0.04, 0.04), 0.0, 0.0};
    const Point to{random(-0.04, 0.04), 0.09, 0.0};
    std::vector<int> path;
    const int count = 17;
    const auto at = [&](int i) { return Point{from[0] + (to[0] - from[0]) * i / count, from[1] + (to[1] - from[1]) * i / count, 0.0}; };
    for (int i = 0; i < count; ++i)
      for (const int n : subdivide(pieces, at(i), at(i + 1), 0.0))
        if (std::find(path.begin(), path.end(), n) == path.end()) path.push_back(n);
    expect_sound(pieces, before);
    EXPECT_LT(expect_chain(pieces, path, from, to), 1e-11);
    const std::vector<int> at_once = subdivide(whole, from, to, 0.0);
    ASSERT_EQ(path.size(), at_once.size());
    for (std::size_t k = 0; k < path.size(); ++k)
      for (std::size_t axis = 0; axis < 2; ++axis)
        EXPECT_NEAR(pieces.node[static_cast<std::size_t>(path[k])][axis], whole.node[static_cast<std::size_t>(at_once[k])][axis], 1e-11);
  }
  Mesh bent = tissue_mesh();
  const Mesh before = bent;
  Point last{0.0, 0.0, 0.0};
  for (int i = 1; i <= 40; ++i) {
    const double angle = 0.04 * i;
    const Point next{last[0] + 0.002 * std::sin(angle), last[1] + 0.002 * std::cos(angle), 0.0};
    const std::vector<int> path = subdivide(bent, last, next);
    (void)expect_chain(bent, path, {last[0] - (next[0] - last[0]), last[1] - (next[1] - last[1]), 0.0}, next);
    expect_sound(bent, before);
    last = next;
  }
}

TEST(Subdivide, FollowsEdgesThatLieOnThePath) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {6, 6, 1}));
  const Mesh before = mesh;
  EXPECT_EQ(subdivide(mesh, {0.4, 0.0, 0.0}, {0.4, 0.7, 0.0}), (std::vector<int>{2, 8, 14, 20}));
  EXPECT_EQ(subdivide(mesh, {0.0, 0.0, 0.0}, {1.0, 1.0, 0.0}), (std::vector<int>{0, 7, 14, 21, 28, 35}));  // the diagonals
  EXPECT_EQ(mesh.node, before.node);
  EXPECT_EQ(mesh.element, before.element);
}

TEST(Subdivide, SnapsToANodeNearThePathAndOnlyThen) {
  const Mesh grid = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {6, 6, 1}));
  for (const double off : {0.009, 0.011}) {  // snap 0.05 of 0.2
    Mesh mesh = grid;
    const std::vector<int> path = subdivide(mesh, {0.4 + off, 0.0, 0.0}, {0.4 + off, 0.5, 0.0});
    if (off < 0.01) {
      EXPECT_EQ(path, (std::vector<int>{2, 8, 14}));
      EXPECT_EQ(mesh.node.size(), grid.node.size());
    } else {
      EXPECT_EQ(path.size(), 6u);  // edges y = 0, 0.2, 0.4 and the diagonals above them
      EXPECT_GT(mesh.node.size(), grid.node.size());
    }
    expect_sound(mesh, grid);
  }
}

TEST(Subdivide, InsideOneTriangleNothingHappens) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {2, 2, 1}));
  EXPECT_TRUE(subdivide(mesh, {0.5, 0.2, 0.0}, {0.6, 0.3, 0.0}).empty());
  EXPECT_TRUE(subdivide(mesh, {2.0, 0.2, 0.0}, {3.0, 0.3, 0.0}).empty());
  EXPECT_EQ(mesh.node.size(), 4u);
}

TEST(Subdivide, RegionsAndGroupsAreInherited) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {3, 3, 1}));
  mesh.region_name = {"fat", "muscle"};
  for (std::size_t e = 0; e < mesh.element.size(); ++e) mesh.region.push_back(e < 4 ? 0 : 1);  // y below and above 0.5
  mesh.group["bottom"] = {0, 1, 2};
  mesh.group["skin"] = {0, 1, 2, 3, 5, 6, 7, 8};
  mesh.group["fat"] = {0, 1, 2, 3, 4, 5};
  const Mesh before = mesh;
  const std::vector<int> path = subdivide(mesh, {0.3, 0.0, 0.0}, {0.3, 0.99, 0.0});
  expect_sound(mesh, before);
  double fat = 0.0;
  for (std::size_t e = 0; e < mesh.element.size(); ++e)
    if (mesh.region[e] == 0) fat += area(mesh, e);
  EXPECT_NEAR(fat, 0.5, 1e-14);
  ASSERT_EQ(path.size(), 4u);  // edge y = 0, diagonal, edge y = 0.5, diagonal
  EXPECT_EQ(mesh.group["bottom"], (std::vector<int>{0, 1, 2, path[0]}));
  EXPECT_EQ(mesh.group["skin"], (std::vector<int>{0, 1, 2, 3, 5, 6, 7, 8, path[0]}));  // the upper diagonal joins 3 and 7 to nobody
  EXPECT_EQ(mesh.group["fat"], (std::vector<int>{0, 1, 2, 3, 4, 5, path[0], path[1]}));
}

// A chord between two boundary nodes is not the boundary.
TEST(Subdivide, ChordsDoNotJoinTheBoundary) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {3, 3, 1}));
  mesh.group["skin"] = {0, 1, 2, 3, 5, 6, 7, 8};
  const int added = insert_node_on_edge(mesh, 3, 7, {0.25, 0.75, 0.0});
  EXPECT_EQ(std::count(mesh.group["skin"].begin(), mesh.group["skin"].end(), added), 0);
}

// The finer mesh solves the same problem: a linear field stays exact on it.
TEST(Subdivide, TheFinerMeshPassesThePatchTest) {
  Mesh mesh = tissue_mesh();
  (void)subdivide(mesh, {-0.013, 0.0, 0.0}, {0.011, 0.07, 0.0});
  Tissue tissue = block(uniform_grid(Type::Tri3, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {11, 11, 1}));
  tissue.supports = {{Side::XMin, {true, true, false}},
                     {Side::XMax, {true, true, false}},
                     {Side::YMin, {true, true, false}},
                     {Side::YMax, {true, true, false}}};
  const Statics statics(mesh, tissue);
  Eigen::VectorXd linear(statics.degrees_of_freedom());
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    linear(static_cast<Eigen::Index>(2 * n)) = 0.01 + 0.3 * mesh.node[n][0] - 0.2 * mesh.node[n][1];
    linear(static_cast<Eigen::Index>(2 * n + 1)) = -0.02 + 0.1 * mesh.node[n][0] + 0.4 * mesh.node[n][1];
  }
  EXPECT_LT((statics.solve(Eigen::VectorXd::Zero(linear.size()), linear) - linear).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(Subdivide, RefusesWhatItCannotCut) {
  Mesh mesh = structured_grid(uniform_grid(Type::Tri3, {0, 0, 0}, {1, 1, 0}, {2, 2, 1}));
  const auto insert = [&](int a, int b, Point x) { return message_of([&] { (void)insert_node_on_edge(mesh, a, b, x); }); };
  EXPECT_NE(insert(1, 2, {0.5, 0.5, 0.0}).find("no edge"), std::string::npos);
  EXPECT_NE(insert(0, 1, {0.5, 0.1, 0.0}).find("does not lie on the edge"), std::string::npos);
  EXPECT_NE(insert(0, 1, {1.0, 0.0, 0.0}).find("does not lie on the edge"), std::string::npos);
  EXPECT_NE(insert(0, 1, {std::nan(""), 0.0, 0.0}).find("does not lie on the edge"), std::string::npos);
  const auto cut = [&](Point from, Point to, double snap) { return message_of([&] { (void)subdivide(mesh, from, to, snap); }); };
  EXPECT_NE(cut({0.5, 0.5, 0}, {0.5, 0.5, 0}, 0.05).find("no length"), std::string::npos);
  EXPECT_NE(cut({std::nan(""), 0.5, 0}, {0.5, 0.5, 0}, 0.05).find("no length"), std::string::npos);
  EXPECT_NE(cut({0.1, 0.5, 0}, {0.5, 0.5, 0}, 0.5).find("snap"), std::string::npos);
  EXPECT_EQ(mesh.node.size(), 4u);
  mesh = structured_grid(uniform_grid(Type::Quad4, {0, 0, 0}, {1, 1, 0}, {2, 2, 1}));
  EXPECT_NE(cut({0.1, 0.5, 0}, {0.5, 0.5, 0}, 0.05).find("tri3"), std::string::npos);
}

}  // namespace
}  // namespace trocar::fem
