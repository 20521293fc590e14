// Embedded contacts: nothing may kick, the tip's density follows the cut, the velocity law follows the base.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "hand.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;

const reference::GridImage& quads() { return grid_of(fem::Type::Quad4); }

TEST(Embedded, FeelsNothingBeforeItTouches) {
  Hand hand(quads());
  hand.move(0.0, 0.00499);
  EXPECT_EQ(hand.model().contacts(), 0u);
  EXPECT_EQ(wrench_of(hand.result()), (std::array<double, 3>{}));
  hand.move(0.0, 0.00004);
  EXPECT_EQ(hand.model().contacts(), 1u);
  EXPECT_GT(hand.base().fy_n, 0.0);
  EXPECT_LT(hand.base().fy_n, 68.0 * 0.00003);
}

TEST(Embedded, ForceGrowsWithDepthAlongAStraightLine) {
  Hand hand(quads());
  std::vector<std::array<double, 2>> curve;
  hand.move(0.0, 0.075, 0.0, 1e-3, [&](const Wrench&, const Result& now) {
    const double depth = hand.pose.y_m + needle_m;
    if (depth > 0.01) curve.push_back({depth, now.base.fy_n});
    EXPECT_NEAR(now.base.fx_n, 0.0, 1e-8);
    EXPECT_NEAR(now.base.tau_nm, 0.0, 1e-8);
  });
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  for (const auto& [x, y] : curve) {
    n += 1;
    sx += x;
    sy += y;
    sxx += x * x;
    sxy += x * y;
    syy += y * y;
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  EXPECT_GT((n * sxy - sx * sy) / std::sqrt((n * sxx - sx * sx) * (n * syy - sy * sy)), 0.999);
  EXPECT_GT(slope, 0.9 * shaft_n_per_m);
  EXPECT_LT(slope, 1.1 * shaft_n_per_m);
}

// What changes per 0.1 mm is the density over the length newly covered: no contact kicks when it appears.
TEST(Embedded, ForceChangesByTheLengthNewlyCovered) {
  for (const auto& [type, distortion] : {std::pair{fem::Type::Quad4, 0.0}, {fem::Type::Tri3, 0.0}, {fem::Type::Quad4, 0.2}}) {
    for (const double theta : {0.0, 0.15}) {
      Hand hand(grid_of(type, distortion));
      hand.pose.x_m = 0.0007;
      hand.pose.theta_rad += theta;
      hand.step();
      double covered = 0.0;
      double before = 0.0;
      for (int i = 0; i < 700; ++i) {
        hand.move(-1e-4 * std::sin(theta), 1e-4 * std::cos(theta));
        const double force = hand.axis()[0] * hand.base().fx_n + hand.axis()[1] * hand.base().fy_n;
        const double zone = std::min(hand.path_m(), 0.0025) - std::min(covered, 0.0025);
        EXPECT_NEAR(force - before, shaft_n_per_m * (hand.path_m() - covered) + 34.0 * zone, 0.025)
            << i << ' ' << theta << ' ' << distortion;
        covered = hand.path_m();
        before = force;
      }
      EXPECT_GT(hand.model().contacts(), 8u);
      EXPECT_EQ(hand.worst(), Status::Ok);
    }
  }
}

TEST(Embedded, CutsAgainOnlyBeyondTheEndOfThePath) {
  Hand hand(quads());
  hand.move(0.0, 0.055);
  const double end = hand.path_m();
  hand.move(0.0, -0.02);
  double short_of_end = -1.0;
  double at_end = -1.0;
  hand.move(0.0, 0.03, 0.0, 1e-3, [&](const Wrench&, const Result& now) {
    const double excess = now.base.fy_n - shaft_n_per_m * now.path_m;
    if (now.path_m < end - 0.003 && now.path_m > end - 0.0035) short_of_end = excess;
    if (now.path_m > end + 0.001) at_end = excess;
  });
  EXPECT_GT(short_of_end, -1.0);
  EXPECT_LT(short_of_end, 0.01);
  EXPECT_NEAR(at_end, tip_excess_n, 1e-3);
}

TEST(Embedded, MirrorsWithItsScene) {
  Hand left(quads());
  Hand right(quads());
  left.pose.x_m = -0.012;
  right.pose.x_m = 0.012;
  for (Hand* hand : {&left, &right}) {
    hand->step();
    hand->move(0.0, 0.05);
  }
  left.move(0.003, 0.001, 0.05);
  right.move(-0.003, 0.001, -0.05);
  EXPECT_GT(std::abs(left.base().fx_n), 0.05);
  EXPECT_NEAR(left.base().fx_n, -right.base().fx_n, 1e-8);
  EXPECT_NEAR(left.base().fy_n, right.base().fy_n, 1e-8);
  EXPECT_NEAR(left.base().tau_nm, -right.base().tau_nm, 1e-9);
}

// One force per edge along a grid line is the mesh's worst case: nodes hardly feel forces that alternate. Stuck, along the line.
TEST(Embedded, ForcesDoNotAlternateAlongAGridLine) {
  for (const fem::Type type : {fem::Type::Quad4, fem::Type::Tri3}) {
    Hand hand(grid_of(type));
    hand.law().shaft_n_per_m = hand.law().tip_n_per_m = 1e9;
    ASSERT_EQ(hand.law().spacing_m, hand.image().tissue.edge_length_m);
    hand.pose.y_m = 0.0525 - needle_m;
    hand.open();
    hand.pose.y_m += 1e-4;
    hand.step();
    const contact::Solver& solver = hand.model().working_set().solver();
    ASSERT_EQ(solver.size(), 11u);
    // Fewest at a depth inside: forces fall from the entry, then rise to the tip.
    int turns = 0;
    for (std::size_t i = 0; i < 10; ++i) {
      EXPECT_GT(solver.contact(i).axial_n, 0.0) << i;
      if (i > 0 && i < 9) {
        const double before = solver.contact(i).axial_n - solver.contact(i - 1).axial_n;
        const double after = solver.contact(i + 1).axial_n - solver.contact(i).axial_n;
        turns += before * after < 0.0 ? 1 : 0;
      }
    }
    EXPECT_LE(turns, 2);
  }
}

// Beyond the elements' own compliance: what the contacts were given in excess is symmetric and a sum of squares, and forces of one density
// feel nothing of the part between neighbours.
TEST(Embedded, JumpsOfDensityAreASumOfSquares) {
  const reference::GridImage& whole = quads();
  Hand hand(whole);
  hand.pose.x_m = 0.0012;  // not along edges: there is a ridge as well
  hand.pose.y_m = 0.0325 - needle_m;
  hand.open();
  const contact::WorkingSet& set = hand.model().working_set();
  const auto n = static_cast<Eigen::Index>(set.size());
  ASSERT_EQ(n, 7);
  Eigen::MatrixXd load = Eigen::MatrixXd::Zero(whole.statics().degrees_of_freedom(), 2 * n);
  Eigen::MatrixXd tied(2 * n, 2 * n), ridge = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const contact::WorkingSet::Point& point = set.point(k);
    for (std::uint32_t m = 0; m < point.at.count; ++m)
      for (Eigen::Index c = 0; c < 2; ++c) load(2 * static_cast<Eigen::Index>(point.at.node[m]) + c, 2 * i + c) += point.at.weight[m];
    for (Eigen::Index j = 0; j < n; ++j) {
      const contact::Block b = set.solver().compliance(k, static_cast<std::size_t>(j));
      tied.block<2, 2>(2 * i, 2 * j) << b[0], b[1], b[2], b[3];
    }
    for (Eigen::Index c = 0; c < 2; ++c) {
      const Vector2 u = ridge_m(whole, point, set.point(1).path_m, {c == 0 ? 1.0 : 0.0, c == 1 ? 1.0 : 0.0});
      ridge.block<2, 1>(2 * i, 2 * i + c) << u[0], u[1];
    }
  }
  EXPECT_EQ((tied - tied.transpose()).norm(), 0.0);
  const Eigen::MatrixXd mesh = load.transpose() * whole.statics().solve(load);
  const Eigen::MatrixXd jumps = tied - mesh - ridge;
  const double scale = 0.15 / (whole.image().tissue.thickness_m * whole.image().tissue.material.front().young_pa);
  // All but the last two, which the end of the line makes stiffer.
  const auto inner = Eigen::seq(0, 2 * (n - 2) - 1);
  const Eigen::VectorXd eigenvalue = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(jumps(inner, inner)).eigenvalues();
  EXPECT_GT(eigenvalue.minCoeff(), -1e-6 * scale);
  EXPECT_GT(eigenvalue.maxCoeff(), 3.0 * scale);
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(tied).eigenvalues().minCoeff(), 0.3 * scale);
  // One density: the last segment is half a one. Softness across the shaft is its tie's own, so only along.
  Eigen::VectorXd even = Eigen::VectorXd::Zero(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) even(2 * i + 1) = i + 1 < n ? 1.0 : set.point(static_cast<std::size_t>(i)).length_m / 0.005;
  EXPECT_LT((jumps * even)(Eigen::seq(1, 2 * (n - 2) - 1, 2)).cwiseAbs().maxCoeff(), 1e-5 * mesh.diagonal().maxCoeff());
  // Alternating: every whole segment yields by both its jumps.
  Eigen::VectorXd alternating = Eigen::VectorXd::Zero(2 * n);
  for (Eigen::Index i = 0; i < n - 1; ++i) alternating(2 * i + 1) = i % 2 == 0 ? 1.0 : -1.0;
  const double shear_pa = whole.image().tissue.material.front().young_pa / (2.0 * (1.0 + whole.image().tissue.material.front().poisson));
  const double one = 0.15 / (whole.image().tissue.thickness_m * shear_pa);
  for (Eigen::Index i = 1; i < n - 2; ++i) EXPECT_NEAR((jumps * alternating)(2 * i + 1) * alternating(2 * i + 1), 4.0 * one, 1e-4 * one);
}

// A needle that is pulled out while it is bent out of its path lets go gently, contact by contact.
TEST(Embedded, LeavesALoadedPathWithoutKicks) {
  Hand hand(quads());
  hand.move(0.0, 0.065);
  hand.move(0.0, 0.0, -0.08);
  EXPECT_GT(hand.base().fx_n, 0.5);
  double worst = 0.0;
  hand.move(
      0.0, -0.08, 0.0, 1e-3,
      [&](const Wrench& old, const Result& now) {
        worst = std::max(worst, std::hypot(now.base.fx_n - old.fx_n, now.base.fy_n - old.fy_n));
      },
      1e-5);
  EXPECT_LT(worst, 0.01);  // per 10 um
  EXPECT_EQ(hand.model().contacts(), 0u);
  EXPECT_LT(hand.worst_residual_n(), 1e-9);
}

TEST(Embedded, DensityFollowsTheSpeedAlongTheShaft) {
  Hand hand(quads());
  hand.law().velocity = rising_law();
  hand.open();
  hand.move(0.0, 0.075, 0.0, 9e-3);
  const double total = hand.base().fy_n;
  EXPECT_NEAR(hand.model().shaft_n_per_m(), 60.0, 0.01);
  EXPECT_NEAR(total, 60.0 * hand.path_m() + 1.0 * 0.0025, 0.01);
  // At rest the lowest speed's density holds: the force falls with the filter's 20 ms.
  for (int i = 0; i < 20; ++i) hand.step();
  EXPECT_NEAR(hand.model().speed_m_s(), 9e-3 * std::exp(-1.0), 3e-4);
  for (int i = 0; i < 500; ++i) hand.step();
  EXPECT_DOUBLE_EQ(hand.model().shaft_n_per_m(), 34.0);
  const auto rest = wrench_of(hand.result());
  for (int i = 0; i < 500; ++i) hand.step();
  EXPECT_NEAR(hand.base().fy_n, rest[1], 1e-12);  // and nothing relaxes further
  EXPECT_LT(rest[1], 34.0 * hand.path_m() + tip_excess_n + 1e-6);
  // Sideways motion is no speed along the shaft, and drawing back is as fast as pushing on.
  hand.move(0.0005, 0.0, 0.0, 9e-3);
  EXPECT_DOUBLE_EQ(hand.model().shaft_n_per_m(), 34.0);
  hand.move(0.0, -0.02, 0.0, 9e-3);
  EXPECT_NEAR(hand.model().shaft_n_per_m(), 60.0, 0.01);
}

// A tick that changes nothing leaves the last forces, whatever the path was.
TEST(Embedded, HoldsItsForcesAtRest) {
  Hand hand(quads());
  hand.move(0.001, 0.05, 0.03);
  hand.move(0.0, -0.001);
  for (int k = 0; k < 50; ++k) hand.step();  // the path comes to rest
  const auto rest = wrench_of(hand.result());
  for (int k = 0; k < 2000; ++k) hand.step();
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(wrench_of(hand.result())[k], rest[k], 1e-12);
  EXPECT_EQ(hand.result().rows_factored, 0);
}

TEST(Embedded, NamesTheEndOfTheCandidates) {
  // The right half of the block is tissue without candidates.
  const reference::GridImage& grid = quads();
  std::vector<model::Cell> cells(grid.image().tissue.cell.begin(), grid.image().tissue.cell.end());
  std::vector<std::int32_t> renumbered(cells.size(), model::limit);
  std::vector<model::Cell> kept;
  std::vector<std::uint8_t> flags(grid.image().tissue.node_flags.begin(), grid.image().tissue.node_flags.end());
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const bool inside =
        std::all_of(cells[c].node.begin(), cells[c].node.end(), [&](std::uint32_t n) { return grid.mesh().node[n][0] < 0.0101; });
    if (!inside) continue;
    renumbered[c] = static_cast<std::int32_t>(kept.size());
    kept.push_back(cells[c]);
  }
  for (model::Cell& cell : kept)
    for (std::int32_t& next : cell.neighbour)
      if (next >= 0) next = renumbered[static_cast<std::size_t>(next)];
  const model::Buckets& all = grid.image().tissue.buckets;
  std::vector<std::uint32_t> begin{0};
  std::vector<std::uint32_t> list;
  for (std::size_t b = 0; b + 1 < all.begin.size(); ++b) {
    for (std::uint32_t k = all.begin[b]; k < all.begin[b + 1]; ++k)
      if (renumbered[all.cell[k]] >= 0) list.push_back(static_cast<std::uint32_t>(renumbered[all.cell[k]]));
    begin.push_back(static_cast<std::uint32_t>(list.size()));
  }
  for (std::uint8_t& flag : flags) flag = static_cast<std::uint8_t>(flag & ~model::whole_ring);
  for (const contact::Method method : {contact::Method::Embedded, contact::Method::Snap}) {
    Hand hand(grid, method);
    hand.image().tissue.cell = kept;
    hand.image().tissue.node_flags = flags;
    hand.image().tissue.buckets.begin = begin;
    hand.image().tissue.buckets.cell = list;
    const double step = std::numbers::sqrt2 / 2;
    hand.pose = {-0.02 - needle_m * step, -0.005 - needle_m * step, std::numbers::pi / 4};  // aims across the limit
    hand.open();
    ASSERT_EQ(hand.model().contacts(), 0u);
    hand.move(0.025 * step, 0.025 * step);
    EXPECT_EQ(hand.worst(), Status::Ok);
    EXPECT_GT(hand.model().contacts(), 1u);
    hand.move(0.04 * step, 0.04 * step);
    EXPECT_EQ(hand.result().status, Status::LeftCandidates);
    EXPECT_LT(hand.path_m(), 0.032 * 1.4143 + 1e-3);
    EXPECT_LE(hand.result().residual_n, 1e-9);
    hand.move(-0.08 * step, -0.08 * step);
    EXPECT_EQ(hand.model().contacts(), 0u);
    EXPECT_EQ(hand.result().status, Status::Ok);
  }
}

TEST(Embedded, NamesTheContactThatDoesNotFit) {
  Hand hand(quads());
  hand.law().spacing_m = 0.001;  // 64 contacts are 64 mm
  hand.open();
  hand.move(0.0, 0.06);
  EXPECT_EQ(hand.worst(), Status::Ok);
  hand.move(0.0, 0.025);
  EXPECT_EQ(hand.result().status, Status::CapacityReached);
  EXPECT_EQ(hand.model().contacts(), capacity::contacts);
  EXPECT_LE(hand.result().residual_n, 1e-9);
  EXPECT_NEAR(hand.base().fy_n, shaft_n_per_m * hand.path_m() + tip_excess_n, 1e-6);
}

}  // namespace
}  // namespace trocar::insertion
