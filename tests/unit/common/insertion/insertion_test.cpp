// What every method must do on every mesh: forces by closed form, balance on the whole sparse system.
#include "common/insertion/insertion.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "hand.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;
using contact::Method;
using contact::State;

struct Case {
  const char* name;
  fem::Type type;
  double distortion;
  Method method;
};

class InsertionBy : public ::testing::TestWithParam<Case> {
 protected:
  [[nodiscard]] const reference::GridImage& grid() const { return grid_of(GetParam().type, GetParam().distortion); }
  [[nodiscard]] bool embedded() const { return GetParam().method == Method::Embedded; }
};

INSTANTIATE_TEST_SUITE_P(
    Methods, InsertionBy,
    ::testing::Values(Case{"embedded_tri", fem::Type::Tri3, 0.0, Method::Embedded},
                      Case{"embedded_quad", fem::Type::Quad4, 0.0, Method::Embedded},
                      Case{"embedded_bent_tri", fem::Type::Tri3, 0.2, Method::Embedded},
                      Case{"embedded_bent_quad", fem::Type::Quad4, 0.2, Method::Embedded},
                      Case{"snap_tri", fem::Type::Tri3, 0.0, Method::Snap}, Case{"snap_quad", fem::Type::Quad4, 0.0, Method::Snap},
                      Case{"snap_bent_tri", fem::Type::Tri3, 0.2, Method::Snap},
                      Case{"snap_bent_quad", fem::Type::Quad4, 0.2, Method::Snap}, Case{"adapt_tri", fem::Type::Tri3, 0.0, Method::Adapt},
                      Case{"adapt_quad", fem::Type::Quad4, 0.0, Method::Adapt}, Case{"adapt_bent_tri", fem::Type::Tri3, 0.2, Method::Adapt},
                      Case{"adapt_bent_quad", fem::Type::Quad4, 0.2, Method::Adapt}),
    [](const auto& made) { return made.param.name; });

// The force is never more than the density times the path, and the tip's excess, and just that while everything slips. A node that has just
// become a contact is dragged along before it slips.
TEST_P(InsertionBy, TheBaseCarriesTheDensityTimesThePath) {
  Hand hand(grid(), GetParam().method);
  hand.pose.x_m = 0.0013;  // on no mesh line
  hand.step();
  int slipping = 0;
  int steps = 0;
  hand.move(0.0, 0.075, 0.0, 1e-3, [&](const Wrench&, const Result& now) {
    // A new contact may hold the tissue back for a moment: the zone ends where the cut ended.
    const double zone = std::max(0.0, now.path_m - std::max(0.0, hand.model().working_set().deepest_m() - 0.0025));
    const double most = shaft_n_per_m * now.path_m + 34.0 * zone;
    EXPECT_LE(now.base.fy_n, most + 1e-9);
    bool all = now.contacts > 0;
    for (std::size_t i = 0; i < hand.model().contacts(); ++i) all = all && hand.model().contact(i).state == State::SlipForward;
    ++steps;
    if (!all) return;
    ++slipping;
    EXPECT_NEAR(now.base.fy_n, most, 1e-9);
  });
  EXPECT_GT(slipping, steps / (embedded() ? 2 : 8));
  EXPECT_GT(hand.base().fy_n, 0.9 * (shaft_n_per_m * hand.path_m() + tip_excess_n));
  EXPECT_LT(hand.path_m(), 0.070 - 0.002);  // the tissue gives way
  EXPECT_GT(hand.path_m(), 0.070 - 0.010);
  EXPECT_LT(hand.worst_residual_n(), 1e-9);
  EXPECT_LE(hand.worst(), Status::NotAdapted);
}

TEST_P(InsertionBy, ForcesBalanceOnTheWholeMesh) {
  Hand hand(grid(), GetParam().method);
  hand.pose = {-0.004, -needle_m - 0.005, std::numbers::pi / 2 - 0.06};
  hand.step();
  hand.move(0.06 * 0.05, 0.05);
  const auto check = [&] {
    const auto moved = adapted(grid(), hand);
    const Balance balance = balance_of(moved ? *moved : grid(), hand);
    EXPECT_LT(balance.wrench, 1e-8);
    EXPECT_LT(balance.off_axis_m, 1e-10);
    // Beyond its ridge a segment's tie is soft by a millionth of its own compliance, a node's by a millionth of that.
    EXPECT_LT(balance.stretch_m, embedded() ? 1e-7 : 1e-12);
    EXPECT_GT(hand.model().contacts(), 5u);
  };
  check();
  hand.move(0.002, 0.0, 0.03);
  check();
  hand.move(0.0, -0.01, -0.02);
  check();
  hand.move(-0.002, 0.02);
  check();
  if (GetParam().method == Method::Adapt) {
    EXPECT_GT(hand.model().working_set().geometry().moved(), 3u);
  }
}

TEST_P(InsertionBy, SticksOnReversalThenPullsBackThenLetsGo) {
  Hand hand(grid(), GetParam().method);
  hand.pose.x_m = 0.0013;
  hand.step();
  hand.move(0.0, 0.075);
  const double pushed = hand.base().fy_n;
  const double path = hand.path_m();
  hand.move(0.0, -0.0002);
  std::size_t stuck = 0;
  for (std::size_t i = 0; i < hand.model().contacts(); ++i) stuck += hand.model().contact(i).state == State::Stuck ? 1U : 0U;
  EXPECT_GE(stuck + 2, hand.model().contacts());
  EXPECT_LT(hand.base().fy_n, pushed);
  EXPECT_GT(hand.base().fy_n, 0.85 * pushed);
  EXPECT_NEAR(hand.path_m(), path, 0.0002);
  // Millimetres later all slips the other way: the shaft's density without the tip's excess.
  hand.move(0.0, -0.020);
  EXPECT_NEAR(hand.base().fy_n, -shaft_n_per_m * hand.path_m(), 1e-6);
  hand.move(0.0, -0.056);
  EXPECT_EQ(hand.model().contacts(), 0u);
  EXPECT_EQ(hand.path_m(), 0.0);
  EXPECT_EQ(wrench_of(hand.result()), (std::array<double, 3>{}));
  EXPECT_LT(hand.worst_residual_n(), 1e-9);
}

TEST_P(InsertionBy, PushesBackWhenTheBaseMovesSideways) {
  Hand hand(grid(), GetParam().method);
  hand.move(0.0, 0.055);
  const double before = hand.base().fx_n;
  hand.move(0.002, 0.0);
  EXPECT_GT(hand.base().fx_n, before + 0.05);  // what the base must apply points the way it went
  hand.move(-0.004, 0.0);
  EXPECT_LT(hand.base().fx_n, before - 0.05);
  Hand turned(grid(), GetParam().method);
  turned.move(0.0, 0.055);
  turned.move(0.0, 0.0, 0.02);
  EXPECT_GT(turned.base().tau_nm, 0.001);
  EXPECT_LT(turned.base().fx_n, 0.0);
}

TEST_P(InsertionBy, StartsAfreshAfterCompleteWithdrawal) {
  Hand used(grid(), GetParam().method);
  used.move(0.002, 0.06, 0.03);
  used.move(0.0, -0.065);
  ASSERT_EQ(used.model().contacts(), 0u);
  EXPECT_EQ(used.model().working_set().geometry().moved(), 0u);
  Hand fresh(grid(), GetParam().method);
  used.pose = fresh.pose = {-0.02, -needle_m - 0.005, std::numbers::pi / 2 - 0.05};
  for (Hand* hand : {&used, &fresh}) {
    hand->step();
    hand->move(0.0, 0.04);
  }
  EXPECT_EQ(wrench_of(used.result()), wrench_of(fresh.result()));
}

TEST_P(InsertionBy, FrictionTakesEnergyOverClosedLoops) {
  Hand hand(grid(), GetParam().method);
  hand.pose.x_m = 0.0013;
  hand.step();
  hand.move(0.0, 0.055);
  const auto loop = [&](auto&& corners) {
    double work = 0.0;
    double slip_work = 0.0;
    Pose last = hand.pose;
    const auto add = [&](const Wrench& old, const Result& now) {
      work += 0.5 * ((old.fx_n + now.base.fx_n) * (hand.pose.x_m - last.x_m) + (old.fy_n + now.base.fy_n) * (hand.pose.y_m - last.y_m) +
                     (old.tau_nm + now.base.tau_nm) * (hand.pose.theta_rad - last.theta_rad));
      last = hand.pose;
      for (std::size_t i = 0; i < hand.model().contacts(); ++i) {
        const contact::Contact& c = hand.model().working_set().solver().contact(i);
        EXPECT_GE(c.axial_n * c.slip_m, -1e-14);
        slip_work += c.axial_n * c.slip_m;
      }
    };
    for (const Pose& by : corners) hand.move(by.x_m, by.y_m, by.theta_rad, 1e-3, add);
    return std::array<double, 2>{work, slip_work};
  };
  const std::array<Pose, 2> stroke{{{0.0, -0.015, 0.0}, {0.0, 0.015, 0.0}}};
  (void)loop(stroke);
  const auto [work, slip_work] = loop(stroke);
  EXPECT_GT(work, 0.002);
  EXPECT_LT(work, 2 * 2.0 * 0.015);  // the thresholds along the whole stroke
  // What the hand put in is what friction took, but for what the contacts that come and go store.
  EXPECT_NEAR(work, slip_work, (embedded() ? 0.004 : 0.05) * work);
  if (embedded()) {
    EXPECT_GT(work, slip_work);  // what is not kept is lost: a hand gains nothing
  }
  const std::array<Pose, 2> within_stick{{{0.0, -1e-4, 0.0}, {0.0, 1e-4, 0.0}}};
  (void)loop(within_stick);
  EXPECT_NEAR(loop(within_stick)[0], 0.0, 1e-7);  // a spring
  const std::array<Pose, 4> around{{{0.002, 0.0, 0.0}, {0.0, -0.01, 0.01}, {-0.002, 0.0, 0.0}, {0.0, 0.01, -0.01}}};
  (void)loop(around);
  EXPECT_GT(loop(around)[0], 0.0);
}

TEST_P(InsertionBy, SameInputsGiveTheSameBits) {
  const auto run = [&] {
    Hand hand(grid(), GetParam().method);
    hand.law().velocity = rising_law();
    hand.open();
    hand.move(0.001, 0.05, 0.04, 3e-3);
    hand.move(-0.002, -0.01, -0.02, 5e-3);
    return wrench_of(hand.result());
  };
  EXPECT_EQ(run(), run());
}

// Skipping what has not changed changes no result: with the factor not one bit (solver_sequence_test), with repeated corrections their
// rounding.
TEST_P(InsertionBy, SkippingChangesNoResult) {
  Hand skips(grid(), GetParam().method);
  Hand computes(grid(), GetParam().method);
  computes.model().skip(false);
  long skipped = 0;
  long computed = 0;
  for (const Pose& by :
       {Pose{0.001, 0.05, 0.0}, Pose{0.0, -0.004, 0.0}, Pose{0.0015, 0.002, 0.03}, Pose{0.0, 0.02, 0.0}, Pose{0.0, -0.08, -0.03}}) {
    constexpr int steps = 400;
    for (int k = 0; k < steps; ++k) {
      for (Hand* hand : {&skips, &computes}) {
        hand->pose.x_m += by.x_m / steps;
        hand->pose.y_m += by.y_m / steps;
        hand->pose.theta_rad += by.theta_rad / steps;
        hand->step();
        (hand == &skips ? skipped : computed) += hand->result().rows_factored;
      }
      for (std::size_t c = 0; c < 3; ++c) ASSERT_NEAR(wrench_of(skips.result())[c], wrench_of(computes.result())[c], 1e-11);
      ASSERT_EQ(skips.model().contacts(), computes.model().contacts());
      for (std::size_t i = 0; i < skips.model().contacts(); ++i)
        ASSERT_EQ(skips.model().contact(i).state, computes.model().contact(i).state);
    }
  }
  EXPECT_LT(2 * skipped, computed);
}

// A base that rests keeps the last forces: those that a solve from force-free contacts finds. Outside of the tissue no contact is solved:
// the same as solving none. In and out, twice, with rests everywhere.
TEST_P(InsertionBy, RestingAndStandingOutsideChangeNoResult) {
  Hand skips(grid(), GetParam().method);
  Hand computes(grid(), GetParam().method);
  computes.model().skip(false);
  int kept = 0, solved = 0, outside = 0;
  double apart_n = 0.0;
  const auto compare = [&](bool resting) {
    skips.step();
    computes.step();
    const Result& a = skips.result();
    const Result& b = computes.result();
    ASSERT_EQ(a.status, b.status);
    ASSERT_EQ(a.contacts, b.contacts);
    ASSERT_NEAR(a.path_m, b.path_m, 1e-12);
    const auto wrench = wrench_of(a);
    const auto other = wrench_of(b);
    for (std::size_t k = 0; k < 3; ++k) apart_n = std::max(apart_n, std::abs(wrench[k] - other[k]));
    if (a.contacts == 0) {
      ++outside;
      ASSERT_EQ(wrench, other);
      ASSERT_EQ((std::array{a.tip.x_m, a.tip.y_m, a.tip.theta_rad}), (std::array{b.tip.x_m, b.tip.y_m, b.tip.theta_rad}));
    } else if (resting) {
      kept += a.iterations == 0 ? 1 : 0;
      solved += b.iterations > 0 ? 1 : 0;
    }
    for (std::size_t i = 0; i < skips.model().contacts(); ++i) ASSERT_EQ(skips.model().contact(i).state, computes.model().contact(i).state);
  };
  for (const Pose& by : {Pose{0.001, 0.04, 0.0}, Pose{0.0, -0.004, 0.01}, Pose{0.0015, 0.012, 0.02}, Pose{0.0, -0.06, -0.03},
                         Pose{-0.003, 0.05, 0.0}, Pose{0.0, -0.05, 0.0}}) {
    constexpr int steps = 400;
    for (int k = 0; k < steps; ++k) {
      for (Hand* hand : {&skips, &computes}) {
        hand->pose.x_m += by.x_m / steps;
        hand->pose.y_m += by.y_m / steps;
        hand->pose.theta_rad += by.theta_rad / steps;
      }
      compare(false);
      for (int rest = 0; rest < (k % 20 == 19 ? 5 : 0); ++rest) compare(true);
      if (HasFatalFailure()) return;
    }
  }
  EXPECT_LT(apart_n, 1e-11);  // of some 2 N
  EXPECT_GT(kept, 100);
  EXPECT_GE(solved, kept);
  EXPECT_GT(outside, 200);
}

// The same for a needle that bends, whose shape stands free there too.
TEST(Insertion, ABendingNeedleOutsideNeedsNoContactSolve) {
  for (const double curvature_per_m : {0.0, 2.0}) {
    Hand skips(grid_of(fem::Type::Tri3));
    Hand computes(grid_of(fem::Type::Tri3));
    for (Hand* hand : {&skips, &computes}) {
      model::Needle& needle = hand->image().needle;
      needle.elements = 24;
      needle.bending_nm2 = 2.3e-3;
      needle.axial_n = 5e4;
      needle.curvature_per_m = curvature_per_m;
      hand->pose.y_m -= 0.02;
      hand->open();
    }
    computes.model().skip(false);
    int outside = 0;
    for (const Pose& by : {Pose{0.001, 0.015, 0.1}, Pose{0.0, 0.0, -0.05}, Pose{0.0, 0.02, 0.0}, Pose{0.0, -0.04, 0.1}}) {
      for (int k = 0; k < 200; ++k) {
        for (Hand* hand : {&skips, &computes}) {
          hand->pose.x_m += by.x_m / 200;
          hand->pose.y_m += by.y_m / 200;
          hand->pose.theta_rad += by.theta_rad / 200;
          hand->step();
          ASSERT_EQ(hand->result().status, Status::Ok);
        }
        const Result& a = skips.result();
        const Result& b = computes.result();
        ASSERT_EQ(a.contacts, b.contacts);
        if (a.contacts > 0) continue;
        ++outside;
        ASSERT_EQ(wrench_of(a), wrench_of(b));
        ASSERT_NEAR(a.tip.x_m, b.tip.x_m, 1e-12);
        ASSERT_NEAR(a.tip.y_m, b.tip.y_m, 1e-12);
        ASSERT_NEAR(a.tip.theta_rad, b.tip.theta_rad, 1e-11);
      }
    }
    EXPECT_GT(outside, 300);
    EXPECT_LT(outside, 800);
  }
}

TEST_P(InsertionBy, ARigidNeedleHasNoUseForItsStiffness) {
  Hand plain(grid(), GetParam().method);
  Hand stiff(grid(), GetParam().method);
  model::Needle& needle = stiff.image().needle;
  needle.elements = 0;
  needle.bending_nm2 = 2.3e-3;
  needle.axial_n = 5e4;
  needle.curvature_per_m = 3.0;
  stiff.open();
  for (Hand* hand : {&plain, &stiff}) hand->move(0.001, 0.05, 0.03);
  EXPECT_EQ(wrench_of(plain.result()), wrench_of(stiff.result()));
  EXPECT_GT(plain.base().fy_n, 0.5);
}

TEST_P(InsertionBy, RefusesPosesThatAreNotNumbers) {
  Hand hand(grid(), GetParam().method);
  Hand untouched(grid(), GetParam().method);
  for (Hand* h : {&hand, &untouched}) h->move(0.0, 0.03);
  const auto wrench = wrench_of(hand.result());
  const Pose good = hand.pose;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const Pose& pose : {Pose{bad, good.y_m, good.theta_rad}, Pose{good.x_m, -bad, good.theta_rad}, Pose{good.x_m, good.y_m, bad}}) {
      const Result result = hand.model().step(pose, 1e-3);
      EXPECT_EQ(result.status, Status::NotFinite);
      EXPECT_EQ(wrench_of(result), wrench);
    }
    EXPECT_EQ(hand.model().step(good, bad).status, Status::NotFinite);
  }
  EXPECT_EQ(hand.model().step(good, 0.0).status, Status::NotFinite);
  EXPECT_EQ(hand.model().step(good, -1e-3).status, Status::NotFinite);
  for (Hand* h : {&hand, &untouched}) h->move(0.001, 0.01, 0.01);
  EXPECT_EQ(wrench_of(hand.result()), wrench_of(untouched.result()));
}

TEST_P(InsertionBy, SurvivesJumpsAndWanderingOutOfTheTissue) {
  Hand hand(grid(), GetParam().method);
  hand.move(0.0, 0.04);
  unsigned state = 1;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / 16777216.0 - 0.5;
  };
  for (int i = 0; i < 1500; ++i) {
    hand.pose = {0.2 * random(), -0.05 + 0.3 * random(), 10.0 * random()};
    hand.step();
    for (const double value : wrench_of(hand.result())) ASSERT_TRUE(std::isfinite(value)) << i;
    ASSERT_TRUE(hand.result().status != Status::Ok || hand.result().residual_n <= 1e-9) << i << ' ' << hand.result().residual_n;
    ASSERT_LE(hand.result().pivots, contact::Solver::max_pivots);
  }
  hand.pose = {0.0, -1.0, 1.5};
  for (int i = 0; i < 3; ++i) hand.step();
  EXPECT_EQ(hand.model().contacts(), 0u);
}

// Ten millimetres in a tick and back: the needle is where it was, and so is the force's bound.
TEST_P(InsertionBy, TakesJumpsOfTenMillimetres) {
  Hand hand(grid(), GetParam().method);
  hand.move(0.0, 0.05);
  for (const Pose& by : {Pose{0.0, 0.01, 0.0}, Pose{0.0, -0.01, 0.0}, Pose{0.01, 0.0, 0.0}, Pose{-0.01, 0.0, 0.0}, Pose{0.0, -0.01, 0.0}}) {
    hand.pose = {hand.pose.x_m + by.x_m, hand.pose.y_m + by.y_m, hand.pose.theta_rad};
    hand.step();
    EXPECT_TRUE(hand.result().status <= Status::TipLost) << to_string(hand.result().status);
    EXPECT_LE(hand.result().residual_n, 1e-9);
    double thresholds = 0.0;
    for (std::size_t i = 0; i < hand.model().contacts(); ++i) thresholds += std::abs(hand.model().contact(i).axial_n);
    EXPECT_LE(thresholds, shaft_n_per_m * (0.1 + hand.path_m()) + tip_excess_n);
  }
  hand.pose.y_m -= 0.08;
  for (int k = 0; k < 3; ++k) hand.step();
  EXPECT_EQ(hand.model().contacts(), 0u);
}

TEST_P(InsertionBy, PassesThroughTheFarFaceWithoutNewContacts) {
  Hand hand(grid(), GetParam().method);
  hand.image().needle.length_m = 0.15;
  hand.pose.y_m = -0.155;
  hand.open();
  hand.move(0.0, 0.13);
  EXPECT_NEAR(hand.path_m(), 0.1, 1e-6);
  EXPECT_NEAR(hand.base().fy_n, 3.4 + tip_excess_n, 0.05);
  const std::size_t contacts = hand.model().contacts();
  hand.move(0.0, 0.01);
  EXPECT_EQ(hand.model().contacts(), contacts);
  hand.move(0.0, -0.05);
  EXPECT_LT(hand.base().fy_n, 0.0);
}

TEST_P(InsertionBy, TakesPosesBeyondAllSense) {
  Hand hand(grid(), GetParam().method);
  hand.law().velocity = rising_law();
  hand.open();
  hand.move(0.0, 0.04);
  for (const double huge : {1e3, 1e10, 1e100, 1e300, std::numeric_limits<double>::max(), std::numeric_limits<double>::denorm_min()}) {
    for (const Pose& pose : {Pose{huge, -0.06, 1.57}, Pose{0.0, -huge, 1.57}, Pose{0.0, huge, 1.57}, Pose{0.0, -0.06, huge}}) {
      const Result result = hand.model().step(pose, 1e-3);
      for (const double value : wrench_of(result)) EXPECT_TRUE(std::isfinite(value)) << huge << ' ' << to_string(result.status);
      EXPECT_TRUE(std::isfinite(result.path_m));
      EXPECT_TRUE(std::isfinite(hand.model().speed_m_s())) << huge;
    }
  }
  hand.pose = {0.0, -1.0, std::numbers::pi / 2};
  for (int k = 0; k < 3; ++k) hand.step();
  hand.model().reset();  // the speed of that
  Hand fresh(grid(), GetParam().method);
  fresh.law().velocity = rising_law();
  fresh.open();
  fresh.model().reset();
  for (Hand* h : {&hand, &fresh}) {
    h->pose = {0.001, -needle_m - 0.005, std::numbers::pi / 2};
    h->step();
    h->move(0.001, 0.04, 0.02);
  }
  EXPECT_EQ(wrench_of(hand.result()), wrench_of(fresh.result()));
}

}  // namespace
}  // namespace trocar::insertion
