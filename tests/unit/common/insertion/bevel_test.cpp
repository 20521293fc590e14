// A bevelled tip: its side force, where it steers the needle, and what must hold all the same.
#include <gtest/gtest.h>

#include <cmath>

#include "common/needle/bevel.hpp"
#include "common/needle/tube.hpp"
#include "hand.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;

constexpr double thirty_degrees = 0.5235987755982988;

void bevel(Hand& hand, double angle_rad, bool bends = true) {
  const needle::Section steel = needle::section_of(0.718e-3, 0.413e-3, 200e9);  // 22G
  model::Needle& needle = hand.image().needle;
  if (bends) {
    needle.elements = 24;
    needle.bending_nm2 = steel.bending_nm2;
    needle.axial_n = steel.axial_n;
  }
  needle.face_rad = angle_rad;
  needle.tip_lateral = needle::lateral_per_axial({.angle_rad = angle_rad, .friction = 0.2});
  hand.open();
}

struct Cut {
  double aside_m{}, turned_rad{};
  double jump_n{};   // of the lateral base force in one step of 0.1 mm
  double balance{};  // base wrench against the clamp's reaction
  double held_n{};   // of the tissue on the needle across it, all contacts
};

Cut cut(Hand& hand, double depth_m) {
  Cut seen;
  const auto after = [&](const Wrench& before, const Result& r) {
    EXPECT_EQ(r.status, Status::Ok);
    seen.jump_n = std::max(seen.jump_n, std::abs(r.base.fx_n - before.fx_n));
    if (!hand.model().bends() || r.contacts == 0) return;
    const Wrench clamp = hand.model().beam().reaction();
    seen.balance = std::max(
        {seen.balance, std::abs(clamp.fx_n - r.base.fx_n), std::abs(clamp.fy_n - r.base.fy_n), std::abs(clamp.tau_nm - r.base.tau_nm)});
  };
  hand.move(0.0, depth_m, 0.0, 1e-3, after, 1e-4);
  seen.aside_m = hand.result().tip.x_m - hand.pose.x_m;
  seen.turned_rad = hand.result().tip.theta_rad - hand.pose.theta_rad;
  seen.held_n = hand.base().fx_n;  // the shaft stands along y
  return seen;
}

// The needle goes along +y, its point on the left, -x: that is where the face sends it.
TEST(Bevel, SteersToTheSideOfItsPointAndMirrored) {
  Hand straight(grid_of(fem::Type::Quad4)), left(grid_of(fem::Type::Quad4)), right(grid_of(fem::Type::Quad4));
  bevel(straight, 0.0);
  bevel(left, thirty_degrees);
  bevel(right, -thirty_degrees);
  EXPECT_NEAR(cut(straight, 0.06).aside_m, 0.0, 1e-12);
  const Cut to_left = cut(left, 0.06), to_right = cut(right, 0.06);
  EXPECT_LT(to_left.aside_m, -1e-3);
  EXPECT_GT(to_left.turned_rad, 0.01);
  EXPECT_NEAR(to_right.aside_m, -to_left.aside_m, 1e-9);
  EXPECT_NEAR(to_right.held_n, -to_left.held_n, 1e-9);
  EXPECT_LT(to_left.balance, 1e-9);
  EXPECT_LT(to_left.jump_n, 1e-3);
}

TEST(Bevel, SteersMoreTheMoreOfTheForceIsLateral) {
  double last_m = 0.0;
  for (const double angle : {1.2, 0.8, 0.5}) {
    Hand hand(grid_of(fem::Type::Quad4));
    bevel(hand, angle);
    hand.image().needle.face_rad = 0.5;
    hand.open();
    const double aside_m = cut(hand, 0.05).aside_m;
    EXPECT_LT(aside_m, last_m) << angle;
    last_m = aside_m;
  }
  Hand square(grid_of(fem::Type::Quad4));
  bevel(square, std::numbers::pi / 2);
  EXPECT_NEAR(cut(square, 0.05).aside_m, 0.0, 1e-12);
}

TEST(Bevel, SteersTheSameOnFinerMeshes) {
  std::vector<double> aside_m;
  for (const int nodes : {25, 49}) {
    reference::GridImage grid({.nodes_x = nodes, .nodes_y = nodes});
    Hand hand(grid);
    bevel(hand, thirty_degrees);
    aside_m.push_back(cut(hand, 0.05).aside_m);
  }
  // First order, as the contacts follow the tip by segments: half the spacing changes it by a quarter at most.
  EXPECT_LT(std::abs(aside_m[1] - aside_m[0]), 0.25 * std::abs(aside_m[1]));
}

TEST(Bevel, SteersTheSameWhateverTheStep) {
  std::vector<double> aside_m;
  for (const double step_m : {1e-4, 4e-5, 1.3e-5}) {
    Hand hand(grid_of(fem::Type::Quad4));
    bevel(hand, thirty_degrees);
    hand.move(
        0.0, 0.05, 0.0, 1e-3, [](const Wrench&, const Result& r) { EXPECT_EQ(r.status, Status::Ok); }, step_m);
    aside_m.push_back(hand.result().tip.x_m - hand.pose.x_m);
  }
  EXPECT_NEAR(aside_m[1] / aside_m[0], 1.0, 0.03);
  EXPECT_NEAR(aside_m[2] / aside_m[0], 1.0, 0.03);
}

// A needle that does not give way. The segments make the force swing about the cutting one's share, less on a finer mesh.
TEST(Bevel, HoldsTheLateralForceOfTheCuttingOneOnARigidNeedle) {
  reference::GridImage grid({.nodes_x = 49, .nodes_y = 49});
  Hand hand(grid);
  bevel(hand, thirty_degrees, false);
  const double full_n = tip_excess_n * hand.image().needle.tip_lateral;
  double sum_n = 0.0;
  int steps = 0;
  const auto after = [&](const Wrench&, const Result& r) {
    ASSERT_EQ(r.status, Status::Ok);
    if (r.path_m < 0.02) return;
    const contact::WorkingSet& set = hand.model().working_set();
    const std::size_t last = set.size() - 1;
    const double grown = (r.path_m - set.point(last).path_m) / hand.law().spacing_m;
    sum_n -= set.solver().contact(last).lateral_n + (1.0 - grown) * set.solver().contact(last - 1).lateral_n;
    ++steps;
  };
  hand.move(0.0, 0.05, 0.0, 1e-3, after, 1e-4);
  EXPECT_NEAR(sum_n / steps / full_n, 1.0, 0.4);
}

// Coming back and going again in the same cut, nothing is carried aside any more.
TEST(Bevel, KeepsToTheCutWhereItWasCut) {
  Hand hand(grid_of(fem::Type::Quad4));
  bevel(hand, thirty_degrees);
  (void)cut(hand, 0.05);
  const Vector2 deepest = hand.model().working_set().tip_material_m();
  hand.move(0.0, -0.02);
  hand.move(0.0, 0.019);
  std::vector<Vector2> before;
  for (std::size_t i = 0; i < hand.model().contacts(); ++i) before.push_back(hand.model().working_set().point(i).begin_m);
  hand.move(0.0, -0.01);
  hand.move(0.0, 0.01);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(hand.model().working_set().point(i).begin_m, before[i]) << i;
  hand.move(0.0, 0.001);
  const Vector2 again = hand.model().working_set().tip_material_m();
  EXPECT_LT(std::hypot(again[0] - deepest[0], again[1] - deepest[1]), 5e-4);
}

}  // namespace
}  // namespace trocar::insertion
