// Couplings against the whole sparse system: of the mesh as it came, and of the moved mesh assembled and factored from scratch.
#include "common/contact/compliance.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>

#include "tests/reference/grid_image/grid_image.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::contact {
namespace {

using reference::GridImage;
using Moves = std::vector<std::pair<std::uint32_t, model::Vector2>>;

// H A H^T by solving for the displacements that forces through b cause.
Eigen::Matrix2d full_coupling(const GridImage& grid, const Embedding& a, const Embedding& b) {
  Eigen::MatrixXd load = Eigen::MatrixXd::Zero(grid.statics().degrees_of_freedom(), 2);
  for (std::uint32_t k = 0; k < b.count; ++k)
    for (Eigen::Index c = 0; c < 2; ++c) load(2 * static_cast<Eigen::Index>(b.node[k]) + c, c) += b.weight[k];
  const Eigen::MatrixXd u = grid.statics().solve(load);
  Eigen::Matrix2d g = Eigen::Matrix2d::Zero();
  for (std::uint32_t k = 0; k < a.count; ++k) g += a.weight[k] * u.middleRows(2 * static_cast<Eigen::Index>(a.node[k]), 2);
  return g;
}

double difference(const Block& found, const Eigen::Matrix2d& known) {
  return std::max({std::abs(found[0] - known(0, 0)), std::abs(found[1] - known(0, 1)), std::abs(found[2] - known(1, 0)),
                   std::abs(found[3] - known(1, 1))});
}

struct Mesh {
  const char* name;
  reference::Block block;
};

class ComplianceOnMesh : public ::testing::TestWithParam<Mesh> {
 protected:
  GridImage grid{GetParam().block};
  Geometry geometry{};
  std::unique_ptr<Compliance> compliance{std::make_unique<Compliance>()};
  reference::Random random{1};
  void SetUp() override {
    geometry.open(grid.image().tissue);
    compliance->open(grid.image().tissue);
  }
  Embedding anywhere() {
    const Vector2 from{random.uniform(-0.045, 0.045), random.uniform(0.0, 0.09)};
    return geometry.segment(from, {from[0] + random.uniform(-0.004, 0.004), from[1] + 0.008}, geometry.locate(from, -1));
  }
  // Every pair of some nodes and segments; largest difference over the largest entry.
  double worst_against(const GridImage& full, const std::vector<Embedding>& at) {
    double worst = 0.0;
    double largest = 0.0;
    for (const Embedding& a : at) {
      for (const Embedding& b : at) {
        const Eigen::Matrix2d known = full_coupling(full, a, b);
        worst = std::max(worst, difference(compliance->coupling(a, b), known));
        largest = std::max(largest, known.cwiseAbs().maxCoeff());
      }
    }
    return worst / largest;
  }
};

const std::vector<fem::Zone> layers{{{63e3, 0.3}, {}, {}}, {{18e3, 0.49}, fem::Box{{-1.0, 0.05, -1.0}, {1.0, 1.0, 1.0}}, {}}};
INSTANTIATE_TEST_SUITE_P(
    Meshes, ComplianceOnMesh,
    ::testing::Values(Mesh{"tri", {.element = fem::Type::Tri3, .nodes_x = 13, .nodes_y = 13}},
                      Mesh{"quad", {.nodes_x = 13, .nodes_y = 13, .zones = layers}},
                      Mesh{"bent_tri_plane_strain",
                           {.element = fem::Type::Tri3, .nodes_x = 13, .nodes_y = 13, .model = fem::Model::PlaneStrain, .distortion = 0.1}},
                      Mesh{"bent_quad_bbar",
                           {.nodes_x = 13,
                            .nodes_y = 13,
                            .model = fem::Model::PlaneStrain,
                            .integration = element::Integration::BBar,
                            .zones = layers,
                            .distortion = 0.1}}),
    [](const auto& made) { return made.param.name; });

TEST_P(ComplianceOnMesh, IsThatOfTheFullSystem) {
  std::vector<Embedding> at;
  for (int k = 0; k < 5; ++k) at.push_back(anywhere());
  for (const std::uint32_t node : {0U, 6U, 80U}) at.push_back(single_node(node));
  EXPECT_LT(worst_against(grid, at), 1e-10);
}

TEST_P(ComplianceOnMesh, IsSymmetric) {
  for (int k = 0; k < 200; ++k) {
    const Embedding a = anywhere();
    const Embedding b = anywhere();
    const Block ab = compliance->coupling(a, b);
    const Block ba = compliance->coupling(b, a);
    const double scale = 1e-14 * (std::abs(ab[0]) + std::abs(ab[3]));
    EXPECT_NEAR(ab[0], ba[0], scale);
    EXPECT_NEAR(ab[1], ba[2], scale);
    EXPECT_NEAR(ab[2], ba[1], scale);
    EXPECT_NEAR(ab[3], ba[3], scale);
  }
}

// A needle's neighbourhood: the nodes of one column in turn, so that rings overlap, and then of the next column.
TEST_P(ComplianceOnMesh, FollowsTheMovedMesh) {
  Moves moves;
  std::vector<Embedding> at;
  for (int column = 6; column < 8; ++column) {
    for (int row = 0; row < 12; row += column == 6 ? 1 : 3) {
      const auto node = static_cast<std::uint32_t>(13 * row + column);
      Vector2 x = geometry.node_m(node);
      const double edge = 0.1 / 12;
      x[0] += random.uniform(-0.3, 0.3) * edge;
      if (row > 0) x[1] += random.uniform(-0.2, 0.2) * edge;
      ASSERT_TRUE(compliance->move(geometry, node, x)) << row;
      moves.emplace_back(node, x);
      at.push_back(single_node(node));
      if (row % 4 == 0) {
        const auto moved = grid.with_moved(moves);
        EXPECT_LT(worst_against(*moved, at), 1e-9) << "after " << moves.size() << " moves";
      }
    }
  }
  EXPECT_EQ(compliance->moves(), moves.size());
  // Segments and far nodes that no move has touched follow too.
  const auto moved = grid.with_moved(moves);
  at = {single_node(0), single_node(12), single_node(100), anywhere(), anywhere()};
  EXPECT_LT(worst_against(*moved, at), 1e-9);
  const Block ab = compliance->coupling(at[0], at[3]);
  const Block ba = compliance->coupling(at[3], at[0]);
  EXPECT_NEAR(ab[1], ba[2], 1e-12 * std::abs(ab[0]));

  // And restoring forgets all of it.
  geometry.restore();
  compliance->restore();
  EXPECT_LT(worst_against(grid, at), 1e-10);
}

TEST_P(ComplianceOnMesh, FollowsAsManyMovesAsThereIsRoomFor) {
  Moves moves;
  for (int k = 0; moves.size() < capacity::adapted_nodes; ++k) {
    const int row = k % 11;
    const int column = 1 + (k / 11) * 2;
    const auto node = static_cast<std::uint32_t>(13 * row + column);
    Vector2 x = geometry.node_m(node);
    x[0] += random.uniform(-0.25, 0.25) * 0.1 / 12;
    ASSERT_TRUE(compliance->move(geometry, node, x));
    moves.emplace_back(node, x);
  }
  const std::uint32_t one_more = 13 * 11 + 11;
  const Vector2 place = geometry.node_m(one_more);
  EXPECT_FALSE(compliance->move(geometry, one_more, {place[0] + 1e-4, place[1]}));
  EXPECT_EQ(geometry.node_m(one_more), place);
  const auto moved = grid.with_moved(moves);
  std::vector<Embedding> at;
  for (std::size_t k = 0; k < moves.size(); k += 5) at.push_back(single_node(moves[k].first));
  at.push_back(anywhere());
  EXPECT_LT(worst_against(*moved, at), 1e-9);
}

TEST_P(ComplianceOnMesh, FollowsANodeThatIsMovedTwice) {
  const std::uint32_t node = 13 * 5 + 6;
  const Vector2 x = geometry.node_m(node);
  ASSERT_TRUE(compliance->move(geometry, node, {x[0] + 0.003, x[1] - 0.001}));
  ASSERT_TRUE(compliance->move(geometry, node, {x[0] - 0.002, x[1] + 0.002}));
  const auto moved = grid.with_moved({{node, {x[0] - 0.002, x[1] + 0.002}}});
  EXPECT_LT(worst_against(*moved, {single_node(node), single_node(node + 1), single_node(3), anywhere()}), 1e-9);
  // Back where it was, the mesh is what it was.
  ASSERT_TRUE(compliance->move(geometry, node, x));
  EXPECT_LT(worst_against(grid, {single_node(node), single_node(node + 1), single_node(3), anywhere()}), 1e-9);
}

TEST_P(ComplianceOnMesh, TellsWhatTheLatestMoveSubtracted) {
  const std::vector<std::uint32_t> nodes{3, 40, 13 * 5 + 6, 13 * 6 + 6, 13 * 4 + 7};
  ASSERT_TRUE(compliance->move(geometry, 13 * 4 + 6, {geometry.node_m(13 * 4 + 6)[0] + 0.002, geometry.node_m(13 * 4 + 6)[1]}));
  std::vector<Block> before;
  for (const std::uint32_t a : nodes)
    for (const std::uint32_t b : nodes) before.push_back(compliance->coupling(single_node(a), single_node(b)));
  ASSERT_TRUE(compliance->move(geometry, 13 * 5 + 6, {geometry.node_m(13 * 5 + 6)[0] + 0.002, geometry.node_m(13 * 5 + 6)[1]}));
  std::size_t k = 0;
  for (const std::uint32_t a : nodes) {
    for (const std::uint32_t b : nodes) {
      const Block now = compliance->coupling(single_node(a), single_node(b));
      const Block change = compliance->latest_change(a, b);
      for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(now[c], before[k][c] - change[c], 1e-12 * std::abs(before[0][0]));
      ++k;
    }
  }
}

TEST_P(ComplianceOnMesh, RefusedMovesChangeNothing) {
  const std::uint32_t node = 13 * 5 + 6;
  const Vector2 x = geometry.node_m(node);
  ASSERT_TRUE(compliance->move(geometry, node + 13, {geometry.node_m(node + 13)[0] + 0.001, geometry.node_m(node + 13)[1]}));
  const std::vector<Embedding> at{single_node(node), single_node(node + 1), single_node(3), anywhere()};
  std::vector<Block> before;
  for (const Embedding& a : at)
    for (const Embedding& b : at) before.push_back(compliance->coupling(a, b));
  const double edge = 0.1 / 12;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector2& bad : {Vector2{x[0] + 1.5 * edge, x[1]}, Vector2{x[0], x[1] - 1.5 * edge}, Vector2{x[0] + 3 * edge, x[1] + 3 * edge},
                             Vector2{nan, x[1]}, Vector2{x[0], std::numeric_limits<double>::infinity()}, Vector2{1e300, -1e300}}) {
    EXPECT_FALSE(compliance->move(geometry, node, bad)) << bad[0] << ' ' << bad[1];
    EXPECT_EQ(geometry.node_m(node), x);
    EXPECT_EQ(compliance->moves(), 1u);
    EXPECT_EQ(geometry.moved(), 1u);
    EXPECT_FALSE(geometry.is_moved(node));
    std::size_t k = 0;
    for (const Embedding& a : at)
      for (const Embedding& b : at) EXPECT_EQ(compliance->coupling(a, b), before[k++]);
  }
}

TEST(Compliance, MovesOnlyNodesWhoseCellsItKnows) {
  const GridImage grid({.nodes_x = 7, .nodes_y = 7});
  model::Tissue tissue = grid.image().tissue;
  std::vector<std::uint8_t> flags(tissue.node_flags.begin(), tissue.node_flags.end());
  flags[24] = 0;
  tissue.node_flags = flags;
  Geometry geometry;
  geometry.open(tissue);
  const auto compliance = std::make_unique<Compliance>();
  compliance->open(tissue);
  const Vector2 x = geometry.node_m(24);
  EXPECT_FALSE(compliance->move(geometry, 24, {x[0] + 1e-3, x[1]}));
  EXPECT_EQ(geometry.moved(), 0u);
  EXPECT_TRUE(compliance->move(geometry, 25, {geometry.node_m(25)[0] + 1e-3, x[1]}));
}

// Refused moves must not use up room: geometry remembers as many moved nodes as compliance.
TEST(Compliance, ManyRefusedMovesLeaveRoomForAGoodOne) {
  const GridImage grid({.nodes_x = 13, .nodes_y = 13});
  Geometry geometry;
  geometry.open(grid.image().tissue);
  const auto compliance = std::make_unique<Compliance>();
  compliance->open(grid.image().tissue);
  for (std::uint32_t node = 14; node < 14 + 3 * capacity::adapted_nodes; ++node) {
    const Vector2 x = geometry.node_m(node);
    const bool at_right_side = node % 13 == 12;
    EXPECT_FALSE(!at_right_side && compliance->move(geometry, node, {x[0] + 0.5, x[1]}));
  }
  EXPECT_EQ(geometry.moved(), 0u);
  const Vector2 x = geometry.node_m(84);
  EXPECT_TRUE(compliance->move(geometry, 84, {x[0] + 1e-3, x[1]}));
}

TEST(Compliance, ReadsFloat32AsItReadsFloat64) {
  const GridImage grid({.nodes_x = 7, .nodes_y = 7});
  model::Tissue single = grid.image().tissue;
  std::vector<float> rounded;
  for (const double value : single.compliance64) rounded.push_back(static_cast<float>(value));
  single.compliance64 = {};
  single.compliance32 = rounded;
  const auto exact = std::make_unique<Compliance>();
  const auto coarse = std::make_unique<Compliance>();
  exact->open(grid.image().tissue);
  coarse->open(single);
  for (const std::uint32_t a : {3U, 24U}) {
    for (const std::uint32_t b : {3U, 24U, 30U}) {
      const Block x = exact->coupling(single_node(a), single_node(b));
      const Block y = coarse->coupling(single_node(a), single_node(b));
      for (std::size_t k = 0; k < 4; ++k) EXPECT_NEAR(x[k], y[k], 1e-7 * std::abs(x[0]));
    }
  }
}

}  // namespace
}  // namespace trocar::contact
