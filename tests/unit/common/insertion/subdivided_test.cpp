// A mesh that was cut along the path: its path nodes are the contacts, each of them, whether the tip runs on the cut or beside it.
#include <gtest/gtest.h>

#include "common/fem/subdivide.hpp"
#include "hand.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;

constexpr double depth_m = 0.05;

struct Cut {
  int nodes;  // of the uncut grid along each side
  double x_m;
  double angle_rad;  // from +y towards +x

  [[nodiscard]] Vector2 axis() const { return {std::sin(angle_rad), std::cos(angle_rad)}; }
  [[nodiscard]] Pose base(double tip_depth_m) const {
    const auto [tx, ty] = axis();
    return {x_m + (tip_depth_m - needle_m) * tx, (tip_depth_m - needle_m) * ty, std::numbers::pi / 2 - angle_rad};
  }
};

class CutGrid {
 public:
  explicit CutGrid(const Cut& cut) {
    const fem::Grid axes = fem::uniform_grid(fem::Type::Tri3, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {cut.nodes, cut.nodes, 1});
    fem::Mesh mesh = fem::structured_grid(axes);
    const auto [tx, ty] = cut.axis();
    const fem::Point end{cut.x_m + depth_m * tx, depth_m * ty, 0.0};
    // Explicit contacts have to lie on the shaft, so no node may count as on the path that is not.
    for (const int node : fem::subdivide(mesh, {cut.x_m, 0.0, 0.0}, end, 0.0)) along_.push_back(static_cast<std::uint32_t>(node));
    fem::Tissue tissue;
    tissue.thickness_m = 0.011;
    tissue.zones = {{{25300.0, 0.48}, {}, {}}};
    tissue.supports = {{fem::Side::YMax, {true, true, false}}};
    grid_ = std::make_unique<reference::GridImage>(std::move(mesh), tissue, 0.1 / (cut.nodes - 1));
  }

  [[nodiscard]] const reference::GridImage& grid() const { return *grid_; }
  [[nodiscard]] const std::vector<std::uint32_t>& along() const { return along_; }
  [[nodiscard]] Vector2 node_m(std::size_t k) const {
    const fem::Point& x = grid_->mesh().node[along_[k]];
    return {x[0], x[1]};
  }

 private:
  std::vector<std::uint32_t> along_{};
  std::unique_ptr<reference::GridImage> grid_{};
};

constexpr Cut cuts[] = {{11, -0.0123, 0.3}, {11, 0.0031, -0.3}, {21, -0.0123, 0.3},
                        {21, 0.0031, -0.3}, {29, -0.0123, 0.3}, {29, 0.0031, -0.2}};

TEST(Subdivided, EveryNodeOfTheCutUpToTheTipIsAContact) {
  std::size_t beside = 0;  // ticks with the tip a hundredth of an edge or more off the cut
  for (const Cut& cut : cuts) {
    SCOPED_TRACE(std::to_string(cut.nodes) + " nodes, " + std::to_string(cut.angle_rad) + " rad");
    const CutGrid whole(cut);
    const auto [tx, ty] = cut.axis();
    Hand hand(whole.grid(), contact::Method::Snap);
    hand.pose = cut.base(-0.002);
    hand.open();
    hand.model().working_set().name_nodes(whole.along());
    const auto check = [&] {
      const contact::WorkingSet& set = hand.model().working_set();
      const Vector2 tip = set.tip_material_m();
      std::size_t passed = 0;
      for (std::size_t k = 0; k < whole.along().size(); ++k) {
        const Vector2 x = whole.node_m(k);
        passed += tx * (tip[0] - x[0]) + ty * (tip[1] - x[1]) >= 0.0 ? 1U : 0U;
      }
      ASSERT_EQ(hand.result().contacts, passed);
      for (std::size_t i = 0; i < set.size(); ++i) ASSERT_EQ(set.point(i).at.node[0], whole.along()[i]);
      beside += std::abs(tx * tip[1] - ty * (tip[0] - cut.x_m)) > 0.01 * whole.grid().image().tissue.edge_length_m ? 1U : 0U;
    };
    const auto move = [&](double by_m) {
      constexpr double step_m = 5e-5;
      for (int k = 0; k < static_cast<int>(std::abs(by_m) / step_m); ++k) {
        hand.pose.x_m += std::copysign(step_m, by_m) * tx;
        hand.pose.y_m += std::copysign(step_m, by_m) * ty;
        hand.step();
        ASSERT_EQ(hand.result().status, Status::Ok);
        if (hand.result().contacts > 0) check();
      }
    };
    move(0.052);
    EXPECT_GT(hand.result().contacts, whole.along().size() / 2);
    const double sum = hand.base().fx_n * tx + hand.base().fy_n * ty;
    EXPECT_GT(sum, 0.8 * shaft_n_per_m * hand.path_m());
    move(-0.02);
    move(0.01);
    move(-0.06);
    EXPECT_EQ(hand.result().contacts, 0U);
  }
  EXPECT_GT(beside, 1000U);
}

// Nothing slips: the same springs as explicit contacts at these nodes.
TEST(Subdivided, StuckStiffnessIsThatOfTheNodesAsExplicitContacts) {
  for (const Cut& cut : cuts) {
    SCOPED_TRACE(std::to_string(cut.nodes) + " nodes, " + std::to_string(cut.angle_rad) + " rad");
    const CutGrid whole(cut);
    Hand named(whole.grid(), contact::Method::Snap);
    named.law().shaft_n_per_m = named.law().tip_n_per_m = 1e9;
    named.pose = cut.base(-0.01);
    named.open();
    named.model().working_set().name_nodes(whole.along());
    named.pose = cut.base(depth_m);
    named.step();
    Hand points(whole.grid());
    points.law().explicit_count = static_cast<std::uint32_t>(whole.along().size());
    for (std::size_t k = 0; k < whole.along().size(); ++k) {
      points.law().explicit_point_m[k] = whole.node_m(k);
      points.law().explicit_slip_force_n[k] = 1e9;
    }
    points.pose = cut.base(depth_m);
    points.open();
    ASSERT_EQ(named.result().contacts, whole.along().size());
    ASSERT_EQ(points.result().contacts, whole.along().size());
    const Pose from = cut.base(depth_m);
    for (const Pose& by : {Pose{1e-4, 0.0, 0.0}, Pose{0.0, 1e-4, 0.0}, Pose{0.0, 0.0, 1e-3}}) {
      for (Hand* hand : {&named, &points}) {
        hand->pose = {from.x_m + by.x_m, from.y_m + by.y_m, from.theta_rad + by.theta_rad};
        hand->step();
        ASSERT_EQ(hand->result().status, Status::Ok);
      }
      const auto a = wrench_of(named.result());
      const auto b = wrench_of(points.result());
      for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], 1e-8) << k;
      EXPECT_GT(std::hypot(a[0], a[1]), 1e-3);
    }
  }
}

// Without a cut named, nodes are looked for at edges again.
TEST(Subdivided, OpeningForgetsTheNames) {
  const CutGrid whole(cuts[2]);
  Hand hand(whole.grid(), contact::Method::Snap);
  const std::vector<std::uint32_t> one{whole.along()[0]};
  hand.model().working_set().name_nodes(one);
  hand.pose = cuts[2].base(0.03);
  hand.step();
  EXPECT_EQ(hand.result().contacts, 1U);
  hand.open();
  EXPECT_GT(hand.result().contacts, 5U);
}

}  // namespace
}  // namespace trocar::insertion
