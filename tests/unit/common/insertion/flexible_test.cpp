// A needle that bends: against the rigid one in the limit, and by what must hold in every tick.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/needle/tube.hpp"
#include "hand.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;

void bend(Hand& hand, double stiffer = 1.0) {
  const needle::Section steel = needle::section_of(0.718e-3, 0.413e-3, 200e9);  // 22G
  model::Needle& needle = hand.image().needle;
  needle.elements = 24;
  needle.bending_nm2 = stiffer * steel.bending_nm2;
  needle.axial_n = stiffer * steel.axial_n;
  hand.open();
}

struct Seen {
  double wrench{};  // base wrench against the clamp reaction: N, and N m
  double residual_n{};
  int most_newton{};
  long newton{}, ticks{};
};

void look(Seen& seen, const Hand& hand) {
  const Result& r = hand.result();
  ASSERT_EQ(r.status, Status::Ok);
  const Wrench clamp = hand.model().beam().reaction();
  if (r.contacts > 0)
    seen.wrench = std::max(
        {seen.wrench, std::abs(clamp.fx_n - r.base.fx_n), std::abs(clamp.fy_n - r.base.fy_n), std::abs(clamp.tau_nm - r.base.tau_nm)});
  seen.residual_n = std::max(seen.residual_n, r.residual_n);
  seen.most_newton = std::max(seen.most_newton, r.newton);
  seen.newton += r.newton;
  ++seen.ticks;
}

TEST(Flexible, IsTheRigidNeedleInTheLimit) {
  Hand rigid(grid_of(fem::Type::Tri3));
  Hand bending(grid_of(fem::Type::Tri3));
  bend(bending, 1e8);
  const auto both = [&](double dx, double dy, double turn) {
    rigid.move(dx, dy, turn);
    bending.move(dx, dy, turn);
    const auto a = wrench_of(rigid.result());
    const auto b = wrench_of(bending.result());
    // The last segment follows the tip by steps, which two needles may take a tick apart.
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(a[k], b[k], 4e-6) << k;
    EXPECT_EQ(rigid.result().contacts, bending.result().contacts);
    EXPECT_EQ(bending.worst(), Status::Ok);
  };
  both(0.0, 0.045, 0.0);
  both(0.002, 0.0, 0.0);
  both(0.0, 0.0, 0.03);
  both(0.0, 0.01, 0.0);
  both(0.0, -0.02, 0.0);
}

TEST(Flexible, BalancesTheClampInEveryTickOfASteeredInsertion) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4}) {
    Hand hand(grid_of(type));
    bend(hand);
    Seen seen;
    const auto walk = [&](double dx, double dy, double turn, int steps) {
      for (int i = 0; i < steps; ++i) {
        hand.pose.x_m += dx / steps;
        hand.pose.y_m += dy / steps;
        hand.pose.theta_rad += turn / steps;
        hand.step();
        look(seen, hand);
        if (::testing::Test::HasFatalFailure()) return;
      }
    };
    walk(0.0, 0.035, 0.0, 1750);
    walk(0.004, 0.01, 0.0, 500);
    walk(0.0, 0.01, -0.05, 500);
    walk(-0.006, 0.0, 0.03, 400);
    EXPECT_GT(hand.result().contacts, 5U);
    walk(0.0, -0.08, 0.0, 4000);
    EXPECT_EQ(hand.result().contacts, 0U);
    EXPECT_LT(seen.wrench, 1e-9);
    EXPECT_LE(seen.residual_n, Flexible::tolerance_n);
    EXPECT_LT(static_cast<double>(seen.newton) / static_cast<double>(seen.ticks), 4.0);
  }
}

// Thesis figure 5.14: 50 relaxations after the base is stepped by 3 mm. Here contacts that keep their places are settled at once.
TEST(Flexible, SettlesWithinTheTickOfAStepOfTheBase) {
  Hand hand(grid_of(fem::Type::Tri3));
  hand.law().explicit_count = 8;
  for (std::size_t i = 0; i < 8; ++i) {
    hand.law().explicit_point_m[i] = {0.0, 0.004 + 0.006 * static_cast<double>(i)};
    hand.law().explicit_slip_force_n[i] = 0.2;
  }
  hand.pose = {0.0, -0.05, std::numbers::pi / 2};
  bend(hand);
  ASSERT_EQ(hand.result().status, Status::Ok);
  hand.pose.x_m += 3e-3;
  const Wrench first = hand.step().base;
  ASSERT_EQ(hand.result().status, Status::Ok);
  for (int k = 0; k < 50; ++k) hand.step();
  const Wrench settled = hand.result().base;
  EXPECT_GT(std::abs(settled.fx_n), 0.02);
  EXPECT_NEAR(first.fx_n / settled.fx_n, 1.0, 1e-6);
  EXPECT_NEAR(first.tau_nm / settled.tau_nm, 1.0, 1e-6);
}

// Embedded contacts follow the tip at the start of the next tick, so their places settle a tick later.
TEST(Flexible, SettlesButForTheTipsPlaceWithEmbeddedContacts) {
  Hand hand(grid_of(fem::Type::Tri3));
  bend(hand);
  hand.move(0.0, 0.06);
  hand.pose.x_m += 3e-3;
  const Wrench first = hand.step().base;
  ASSERT_EQ(hand.result().status, Status::Ok);
  for (int k = 0; k < 50; ++k) hand.step();
  EXPECT_NEAR(first.fx_n / hand.base().fx_n, 1.0, 5e-5);
}

// The thrust of friction buckles a 27G needle of nitinol: a perfectly straight one does not stay upright, and ends where one does that is
// bent by next to nothing.
TEST(Flexible, StaysInNoUnstableEquilibrium) {
  const needle::Section nitinol = needle::section_of(0.413e-3, 0.21e-3, 60e9);
  std::vector<double> thrust_n;
  for (const double curvature : {0.0, 1e-9}) {
    Hand hand(grid_of(fem::Type::Quad4));
    hand.image().needle.elements = 24;
    hand.image().needle.bending_nm2 = nitinol.bending_nm2;
    hand.image().needle.axial_n = nitinol.axial_n;
    hand.image().needle.curvature_per_m = curvature;
    hand.open();
    int unsolved = 0;
    const auto after = [&](const Wrench&, const Result& r) { unsolved += r.status == Status::Ok ? 0 : 1; };
    hand.move(0.0, 0.06, 0.0, 1e-3, after, 1e-4);
    EXPECT_LT(unsolved, 6) << curvature;  // of 600, while it snaps aside
    thrust_n.push_back(hand.base().fy_n);
    EXPECT_GT(std::abs(hand.result().tip.theta_rad - hand.pose.theta_rad), 1e-4);
  }
  EXPECT_NEAR(thrust_n[0] / thrust_n[1], 1.0, 0.05);  // they snap at slightly other depths, and friction remembers
  EXPECT_LT(thrust_n[0], 1.0);                        // upright it would be the friction of 55 mm, 1.8 N
}

// Reported forces are parts along and across the shaft as it stands: together they are the base's.
TEST(Flexible, ReportsForcesInTheFrameOfTheShaft) {
  Hand hand(grid_of(fem::Type::Tri3));
  bend(hand);
  hand.move(0.0, 0.03);
  hand.move(0.006, 0.02, 0.1);
  Vector2 sum{};
  for (std::size_t i = 0; i < hand.result().contacts; ++i) {
    const Insertion::ContactReport c = hand.model().contact(i);
    const needle::Station at = hand.model().beam().at(c.arclength_m);
    sum[0] += c.axial_n * at.tangent[0] - c.lateral_n * at.tangent[1];
    sum[1] += c.axial_n * at.tangent[1] + c.lateral_n * at.tangent[0];
  }
  EXPECT_NEAR(sum[0], hand.base().fx_n, 1e-9);
  EXPECT_NEAR(sum[1], hand.base().fy_n, 1e-9);
}

// An explicit contact that the tip leaves behind stays, on the straight continuation of the bent needle.
TEST(Flexible, CarriesExplicitContactsBeyondTheTip) {
  Hand hand(grid_of(fem::Type::Tri3));
  hand.law().explicit_count = 4;
  for (std::size_t i = 0; i < 4; ++i) {
    hand.law().explicit_point_m[i] = {0.0, 0.01 + 0.012 * static_cast<double>(i)};
    hand.law().explicit_slip_force_n[i] = 0.05;
  }
  hand.pose = {0.0, -0.05, std::numbers::pi / 2};  // the tip stands at y = 0.05
  bend(hand);
  Seen seen;
  for (int k = 0; k < 300; ++k) {
    hand.pose.y_m -= 1e-4;
    hand.pose.x_m += 1e-5;
    hand.step();
    look(seen, hand);
    ASSERT_FALSE(::testing::Test::HasFatalFailure()) << k;
  }
  EXPECT_EQ(hand.result().contacts, 4U);
  EXPECT_LT(seen.wrench, 1e-9);
  const needle::Station tip = hand.model().beam().tip();
  int beyond = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Insertion::ContactReport c = hand.model().contact(i);
    if (c.arclength_m <= needle_m) continue;
    ++beyond;
    const double past_m = c.arclength_m - needle_m;
    EXPECT_NEAR(c.position_m[0], tip.position_m[0] + past_m * tip.tangent[0], 1e-11);
    EXPECT_NEAR(c.position_m[1], tip.position_m[1] + past_m * tip.tangent[1], 1e-11);
  }
  EXPECT_EQ(beyond, 3);
}

TEST(Flexible, RefusesAnExplicitContactBesideTheCurvedShaft) {
  Hand hand(grid_of(fem::Type::Tri3));
  hand.law().explicit_count = 1;
  hand.law().explicit_slip_force_n[0] = 0.2;
  hand.pose = {0.0, -0.05, std::numbers::pi / 2};
  hand.image().needle.curvature_per_m = 2.0;
  hand.law().explicit_point_m[0] = {0.0, 0.03};  // on the straight line that the shaft leaves
  bend(hand);
  EXPECT_EQ(hand.result().status, Status::OffShaft);
  // Counter-clockwise on a circle of radius 1 / 2 m that leaves the base along +y.
  const double angle = 2.0 * 0.08;
  hand.law().explicit_point_m[0] = {-0.5 * (1.0 - std::cos(angle)), -0.05 + 0.5 * std::sin(angle)};
  hand.open();
  EXPECT_EQ(hand.result().status, Status::Ok);
  EXPECT_NEAR(hand.model().contact(0).arclength_m, 0.08, 1e-6);
}

// A needle that bends more than its equations hold for, or meets none: named, finite, and the next tick goes on.
TEST(Flexible, NamesATickWithoutEquilibriumAndGoesOn) {
  Hand hand(grid_of(fem::Type::Tri3));
  bend(hand, 1e-4);
  hand.move(0.0, 0.03);
  for (int k = 0; k < 200; ++k) {
    hand.pose.x_m += (k % 2 == 0 ? 1.0 : -1.0) * 0.02;
    hand.pose.theta_rad += 0.1;
    const Result r = hand.step();
    ASSERT_TRUE(std::isfinite(r.base.fx_n) && std::isfinite(r.base.tau_nm) && std::isfinite(r.tip.x_m)) << k;
    ASSERT_LE(r.newton, 2 * Flexible::max_iterations);
    if (r.status == Status::Ok) {
      ASSERT_LE(r.residual_n, Flexible::tolerance_n);
    }
  }
}

// The cut is kept in material coordinates: a needle that steered in comes out along its own cut, though its base goes elsewhere.
TEST(Flexible, WithdrawsAlongTheCutPath) {
  Hand hand(grid_of(fem::Type::Tri3));
  bend(hand);
  const auto material_path = [&] {
    std::vector<Vector2> path;
    for (std::size_t i = 0; i < hand.model().contacts(); ++i) path.push_back(hand.model().working_set().point(i).material_m);
    return path;
  };
  std::vector<Vector2> cut;
  hand.move(0.0, 0.01);
  const auto steer = [&](double dx, double dy, double turn) {
    for (int k = 0; k < 20; ++k) {
      hand.move(dx / 20, dy / 20, turn / 20);
      cut.push_back(hand.model().working_set().tip_material_m());
    }
  };
  steer(0.012, 0.02, 0.0);
  steer(-0.004, 0.025, -0.3);
  const std::vector<Vector2> at_depth = material_path();
  double bow = 0.0;
  for (const Vector2& x : cut) bow = std::max(bow, std::abs(x[0]));
  EXPECT_GT(bow, 1e-3);  // it has steered
  double off = 0.0;
  for (int k = 0; k < 60; ++k) {
    hand.move(k < 30 ? 2e-5 : -5e-5, -5e-4, 0.0);
    const std::vector<Vector2> now = material_path();
    ASSERT_LE(now.size(), at_depth.size());
    // What is left of the path is where it was cut; only the segment that the tip is in shrinks.
    for (std::size_t i = 0; i + 1 < now.size(); ++i) ASSERT_EQ(now[i], at_depth[i]) << k;
    const Vector2 tip = hand.model().working_set().tip_material_m();
    double nearest = 1.0;
    for (std::size_t i = 0; i + 1 < cut.size(); ++i) {
      const Vector2 along{cut[i + 1][0] - cut[i][0], cut[i + 1][1] - cut[i][1]};
      const Vector2 from{tip[0] - cut[i][0], tip[1] - cut[i][1]};
      const double part = std::clamp((along[0] * from[0] + along[1] * from[1]) / (along[0] * along[0] + along[1] * along[1]), 0.0, 1.0);
      nearest = std::min(nearest, std::hypot(from[0] - part * along[0], from[1] - part * along[1]));
    }
    off = std::max(off, nearest);
  }
  EXPECT_LT(off, 0.1 * bow);
  EXPECT_EQ(hand.worst(), Status::Ok);
}

// Against steps from the same state with a perturbed base: those go on as the last step did, so every contact keeps its state. Advancing,
// where all slip, and a little back, where some stick.
void expect_the_jacobian_of_the_next_step(fem::Type type, bool back) {
  Hand hand(grid_of(type));
  bend(hand);
  hand.move(0.0, 0.045);
  hand.move(0.004, 0.012, 0.03);
  const auto slipping_of = [](const Insertion& model) {
    int count = 0;
    for (std::size_t i = 0; i < model.contacts(); ++i) count += model.contact(i).state == contact::State::Stuck ? 0 : 1;
    return count;
  };
  if (back) hand.move(0.0, -1e-4);
  for (int k = 0; back && k < 100 && slipping_of(hand.model()) < 2; ++k) hand.move(0.0, -1e-4);
  const std::unique_ptr<Insertion> before = std::make_unique<Insertion>(hand.model());
  Pose pose = hand.pose;
  pose.y_m += back ? -5e-5 : 1e-4;
  pose.x_m += 2e-5;
  const auto tip_after = [&](double dx, double dy, double turn) {
    const auto model = std::make_unique<Insertion>(*before);
    const Result r = model->step({pose.x_m + dx, pose.y_m + dy, pose.theta_rad + turn}, 1e-3);
    EXPECT_EQ(r.status, Status::Ok);
    return std::array{r.tip.x_m, r.tip.y_m, r.tip.theta_rad};
  };
  const auto model = std::make_unique<Insertion>(*before);
  ASSERT_EQ(model->step(pose, 1e-3).status, Status::Ok);
  const int slipping = slipping_of(*model);
  const int stuck = static_cast<int>(model->contacts()) - slipping;
  EXPECT_GE(slipping, back ? 2 : 10);
  EXPECT_EQ(stuck >= 2, back) << stuck;
  const Wrench reaction = model->beam().reaction();
  Jacobian jacobian{};
  ASSERT_TRUE(model->jacobian(jacobian));
  EXPECT_EQ(model->beam().reaction().tau_nm, reaction.tau_nm);
  for (std::size_t column = 0; column < 3; ++column) {
    const double step = column == 2 ? 2e-5 : 2e-6;
    const auto up = tip_after(column == 0 ? step : 0.0, column == 1 ? step : 0.0, column == 2 ? step : 0.0);
    const auto down = tip_after(column == 0 ? -step : 0.0, column == 1 ? -step : 0.0, column == 2 ? -step : 0.0);
    // Of the column's largest entry, lengths in units of 50 mm.
    double largest = 0.0;
    for (std::size_t row = 0; row < 3; ++row) largest = std::max(largest, std::abs(jacobian[row][column]) * (row == 2 ? 0.05 : 1.0));
    for (std::size_t row = 0; row < 3; ++row)
      EXPECT_NEAR((up[row] - down[row]) / (2.0 * step), jacobian[row][column], 1e-6 * largest * (row == 2 ? 20.0 : 1.0))
          << row << column << ", " << stuck << " stuck";
  }
  // It is not the rigid needle's.
  EXPECT_GT(std::abs(jacobian[0][2] + 0.1 * std::sin(pose.theta_rad)), 5e-3);
}

TEST(Flexible, JacobianIsTheDerivativeOfTheStep) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4})
    for (const bool back : {false, true}) expect_the_jacobian_of_the_next_step(type, back);
}

}  // namespace
}  // namespace trocar::insertion
