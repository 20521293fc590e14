#include "sim_plant/phantom/phantom.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "common/config/user_error.hpp"
#include "scene.hpp"

namespace trocar::sim_plant {
namespace {

// Thesis figure 4.10: nearly linear in depth, the sum of the thresholds once everything slips.
TEST(Phantom, BaseForceBuildsUpWithDepth) {
  Hand hand;
  std::vector<double> depth;
  std::vector<double> force;
  hand.move(0.0, 0.075, 0.0, 1e-3, [&](const auto&, const auto& wrench) {
    depth.push_back(hand.pose[1] + needle_m - face_m);
    force.push_back(wrench[1]);
    EXPECT_NEAR(wrench[0], 0.0, 1e-9);
    EXPECT_NEAR(wrench[2], 0.0, 1e-9);
  });
  const double path = hand.path_m();
  EXPECT_NEAR(force.back(), shaft_n_per_m * path + tip_excess_n, 1e-3);
  // The tissue gives way: less path than travel, by the few millimetres that 2.3 N push the block.
  EXPECT_LT(path, 0.070 - 0.002);
  EXPECT_GT(path, 0.070 - 0.008);

  // Straight line through the part behind the first 10 mm.
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0;
  for (std::size_t i = 0; i < depth.size(); ++i) {
    if (depth[i] < 0.01) continue;
    n += 1;
    sx += depth[i];
    sy += force[i];
    sxx += depth[i] * depth[i];
    sxy += depth[i] * force[i];
    syy += force[i] * force[i];
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx);
  const double correlation = (n * sxy - sx * sy) / std::sqrt((n * sxx - sx * sx) * (n * syy - sy * sy));
  EXPECT_GT(correlation, 0.999);
  EXPECT_GT(slope, 0.9 * shaft_n_per_m);
  EXPECT_LT(slope, 1.1 * shaft_n_per_m);
  EXPECT_EQ(hand.phantom.counters().unconverged, 0u);
}

TEST(Phantom, FeelsNothingBeforeItTouches) {
  Hand hand;
  hand.move(0.0, 0.00499);
  EXPECT_EQ(hand.phantom.contacts(), 0u);
  EXPECT_EQ(hand.phantom.base_wrench(), (Phantom::Vector3{}));
  hand.move(0.0, 0.00004);
  EXPECT_EQ(hand.phantom.contacts(), 1u);
  EXPECT_GT(hand.phantom.base_wrench()[1], 0.0);
  EXPECT_LT(hand.phantom.base_wrench()[1], 68.0 * 0.00003);
}

// No contact may kick when it appears: what changes is the density over the length newly covered.
TEST(Phantom, ForceChangesByTheLengthNewlyCovered) {
  for (const double theta : {0.0, 0.15}) {
    Hand hand;
    hand.pose[2] += theta;
    double covered = 0.0;
    double before = 0.0;
    double worst_step = 0.0;
    for (int i = 0; i < 750; ++i) {
      hand.move(-1e-4 * std::sin(theta), 1e-4 * std::cos(theta), 0.0, 1e-3,
                [&](const auto& old, const auto& now) { worst_step = std::max(worst_step, std::hypot(now[0] - old[0], now[1] - old[1])); });
      const double force = -std::sin(theta) * hand.phantom.base_wrench()[0] + std::cos(theta) * hand.phantom.base_wrench()[1];
      const double path = hand.path_m();
      const double zone = std::min(path, 0.0025) - std::min(covered, 0.0025);
      EXPECT_NEAR(force - before, shaft_n_per_m * (path - covered) + 34.0 * zone, 0.002) << i;
      covered = path;
      before = force;
    }
    EXPECT_GT(hand.phantom.contacts(), 8u);
    EXPECT_LT(worst_step, 0.001);  // per 10 um
  }
}

TEST(Phantom, SticksOnReversalThenPullsBackThenLetsGo) {
  Hand hand;
  hand.move(0.0, 0.075);
  const double pushed = hand.phantom.base_wrench()[1];
  const double path = hand.path_m();

  // All contacts are stuck at once; the tip stays where it is in the tissue.
  hand.move(0.0, -0.0002);
  for (std::size_t i = 0; i + 2 < hand.phantom.contacts(); ++i)
    EXPECT_EQ(hand.phantom.insertion().contact(i).state, contact::State::Stuck) << i;
  EXPECT_LT(hand.phantom.base_wrench()[1], pushed);
  EXPECT_GT(hand.phantom.base_wrench()[1], 0.9 * pushed);
  EXPECT_NEAR(hand.path_m(), path, 0.0001);

  // Millimetres of tissue motion later everything slips the other way: shaft density without the tip's excess.
  double largest = 0.0;
  hand.move(0.0, -0.020, 0.0, 1e-3, [&](const auto& old, const auto& now) { largest = std::max(largest, std::abs(now[1] - old[1])); });
  EXPECT_LT(largest, 0.01);
  EXPECT_NEAR(hand.phantom.base_wrench()[1], -shaft_n_per_m * hand.path_m(), 1e-3);
  hand.move(0.0, -0.049);
  EXPECT_LT(hand.phantom.base_wrench()[1], 0.0);
  hand.move(0.0, -0.006);
  EXPECT_EQ(hand.phantom.contacts(), 0u);
  EXPECT_EQ(hand.path_m(), 0.0);
  EXPECT_EQ(hand.phantom.base_wrench(), (Phantom::Vector3{}));
}

TEST(Phantom, CutsAgainOnlyBeyondTheEndOfThePath) {
  Hand hand;
  hand.move(0.0, 0.055);
  const double end = hand.path_m();
  hand.move(0.0, -0.02);
  double short_of_end = 0.0;
  double at_end = 0.0;
  hand.move(0.0, 0.03, 0.0, 1e-3, [&](const auto&, const auto& now) {
    const double path = hand.path_m();
    const double excess = now[1] - shaft_n_per_m * path;
    if (path < end - 0.003 && path > end - 0.0035) short_of_end = excess;
    if (path > end + 0.001) at_end = excess;
  });
  EXPECT_LT(short_of_end, 0.01);
  EXPECT_NEAR(at_end, tip_excess_n, 1e-3);
}

TEST(Phantom, PushesBackWhenTheBaseMovesSideways) {
  Hand hand;
  hand.move(0.0, 0.055);
  const double before = hand.phantom.base_wrench()[0];
  hand.move(0.002, 0.0);
  const double right = hand.phantom.base_wrench()[0];
  hand.move(-0.004, 0.0);
  const double left = hand.phantom.base_wrench()[0];
  EXPECT_NEAR(before, 0.0, 1e-9);
  EXPECT_GT(right, 0.05);  // what the base must apply points the way it went
  EXPECT_LT(left, -0.05);

  // Turning about the base towards -x (theta grows) needs a positive moment.
  Hand turned;
  turned.move(0.0, 0.055);
  turned.move(0.0, 0.0, 0.02);
  EXPECT_GT(turned.phantom.base_wrench()[2], 0.001);
  EXPECT_LT(turned.phantom.base_wrench()[0], 0.0);
}

TEST(Phantom, MirrorsWithItsScene) {
  Hand left;
  Hand right;
  left.pose[0] = -0.012;
  right.pose[0] = 0.012;
  for (Hand* hand : {&left, &right}) hand->phantom.advance(hand->pose, 1e-3);
  left.move(0.0, 0.05);
  right.move(0.0, 0.05);
  left.move(0.003, 0.001, 0.05);
  right.move(-0.003, 0.001, -0.05);
  EXPECT_NEAR(left.phantom.base_wrench()[0], -right.phantom.base_wrench()[0], 1e-8);
  EXPECT_NEAR(left.phantom.base_wrench()[1], right.phantom.base_wrench()[1], 1e-8);
  EXPECT_NEAR(left.phantom.base_wrench()[2], -right.phantom.base_wrench()[2], 1e-9);
}

// A needle that is pulled out while it is bent out of its path lets go gently, contact by contact.
TEST(Phantom, LeavesALoadedPathWithoutKicks) {
  Hand hand;
  hand.move(0.0, 0.065);
  hand.move(0.0, 0.0, -0.08);
  EXPECT_GT(hand.phantom.base_wrench()[0], 0.5);
  double worst = 0.0;
  hand.move(0.0, -0.08, 0.0, 1e-3,
            [&](const auto& old, const auto& now) { worst = std::max(worst, std::hypot(now[0] - old[0], now[1] - old[1])); });
  EXPECT_LT(worst, 0.01);  // per 10 um
  EXPECT_EQ(hand.phantom.contacts(), 0u);
  EXPECT_EQ(hand.phantom.counters().unconverged, 0u);
}

TEST(Phantom, StartsAfreshAfterCompleteWithdrawal) {
  Hand used;
  used.move(0.002, 0.06, 0.03);
  used.move(0.0, -0.06);
  ASSERT_EQ(used.phantom.contacts(), 0u);
  Hand fresh;
  used.pose = fresh.pose = {-0.02, face_m - needle_m - 0.005, std::numbers::pi / 2 - 0.05};
  used.move(0.0, 0.04);
  fresh.move(0.0, 0.04);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(used.phantom.base_wrench()[k], fresh.phantom.base_wrench()[k], 1e-9);
}

TEST(Phantom, DensityFollowsTheSpeedAlongTheShaft) {
  scene::Scene config = demo_scene();
  config.contact->velocity = pvc();
  Hand hand(config);
  hand.move(0.0, 0.075, 0.0, 9e-3);
  const double total = hand.phantom.base_wrench()[1];
  EXPECT_NEAR(hand.phantom.insertion().shaft_n_per_m(), 60.0, 0.01);
  EXPECT_NEAR(total, 60.0 * hand.path_m() + 1.0 * 0.0025, 0.01);
  EXPECT_LT(total - 60.0 * hand.path_m(), 0.001 * total);  // the tip's peak has faded

  // At rest the lowest speed's density holds: the force falls with the filter's 20 ms.
  for (int i = 0; i < 20; ++i) hand.phantom.advance(hand.pose, 1e-3);
  EXPECT_NEAR(hand.phantom.insertion().speed_m_s(), 9e-3 * std::exp(-1.0), 3e-4);
  for (int i = 0; i < 500; ++i) hand.phantom.advance(hand.pose, 1e-3);
  EXPECT_DOUBLE_EQ(hand.phantom.insertion().shaft_n_per_m(), 34.0);
  const double rest = hand.phantom.base_wrench()[1];
  for (int i = 0; i < 500; ++i) hand.phantom.advance(hand.pose, 1e-3);
  EXPECT_EQ(hand.phantom.base_wrench()[1], rest);  // and nothing relaxes further
  EXPECT_LT(rest, 34.0 * hand.path_m() + tip_excess_n + 1e-6);

  // Sideways motion is no speed along the shaft.
  hand.move(0.0005, 0.0, 0.0, 9e-3);
  EXPECT_DOUBLE_EQ(hand.phantom.insertion().shaft_n_per_m(), 34.0);
}

TEST(Phantom, FrictionTakesEnergyOverAClosedLoop) {
  Hand hand;
  hand.move(0.0, 0.055);
  hand.move(0.0, -0.015);
  hand.move(0.0, 0.015);
  const auto work_of = [&](double stroke) {
    double work = 0.0;
    double slip_work = 0.0;
    std::array<double, 3> last = hand.pose;
    const auto add = [&](const auto& old, const auto& now) {
      work += 0.5 * (old[1] + now[1]) * (hand.pose[1] - last[1]);
      last = hand.pose;
      for (std::size_t i = 0; i < hand.phantom.contacts(); ++i) {
        const contact::Contact& f = hand.phantom.insertion().working_set().solver().contact(i);
        EXPECT_GE(f.axial_n * f.slip_m, -1e-15);
        slip_work += f.axial_n * f.slip_m;
      }
    };
    hand.move(0.0, -stroke, 0.0, 1e-3, add);
    hand.move(0.0, stroke, 0.0, 1e-3, add);
    return std::array<double, 2>{work, slip_work};
  };
  (void)work_of(0.02);
  const auto [work, slip_work] = work_of(0.02);
  EXPECT_GT(work, 0.01);
  // What the hand put in is what friction took, but for what little the moving end of the path stores.
  EXPECT_NEAR(work, slip_work, 0.001 * work);
  EXPECT_LT(work, 2 * 2.0 * 0.02);                           // no more than the thresholds along the whole stroke
  EXPECT_LT(std::abs(work_of(1e-4)[0]), 0.01 * 1e-4 * 2.0);  // within the stick phase: a spring
}

TEST(Phantom, SameInputsGiveTheSameBits) {
  const auto run = [] {
    scene::Scene config = demo_scene();
    config.contact->velocity = pvc();
    Hand hand(config);
    hand.move(0.001, 0.05, 0.04, 3e-3);
    hand.move(-0.002, -0.01, -0.02, 5e-3);
    return hand.phantom.base_wrench();
  };
  EXPECT_EQ(run(), run());
}

TEST(Phantom, RefusesPosesThatAreNotNumbers) {
  Hand hand;
  hand.move(0.0, 0.03);
  const Phantom::Vector3 wrench = hand.phantom.base_wrench();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(hand.phantom.advance({nan, 0.1, 1.5}, 1e-3), wrench);
  EXPECT_EQ(hand.phantom.advance({0.0, infinity, 1.5}, 1e-3), wrench);
  EXPECT_EQ(hand.phantom.advance(hand.pose, 0.0), wrench);
  EXPECT_EQ(hand.phantom.advance(hand.pose, nan), wrench);
  EXPECT_EQ(hand.phantom.counters().refused, 4u);
  hand.move(0.0, 0.01);
  EXPECT_NEAR(hand.phantom.base_wrench()[1], shaft_n_per_m * hand.path_m() + tip_excess_n, 1e-3);
}

TEST(Phantom, SurvivesJumpsAndWanderingOutOfTheTissue) {
  Hand hand;
  hand.move(0.0, 0.04);
  unsigned state = 1;
  const auto random = [&] {
    state = state * 1664525u + 1013904223u;
    return static_cast<double>(state >> 8) / 16777216.0 - 0.5;
  };
  for (int i = 0; i < 3000; ++i) {
    hand.pose = {0.2 * random(), 0.15 + 0.3 * random(), 10.0 * random()};
    for (const double value : hand.phantom.advance(hand.pose, 1e-3)) ASSERT_TRUE(std::isfinite(value)) << i;
  }
  hand.pose = {0.0, -1.0, 1.5};
  for (int i = 0; i < 3; ++i) hand.phantom.advance(hand.pose, 1e-3);
  EXPECT_EQ(hand.phantom.contacts(), 0u);
}

TEST(Phantom, PassesThroughTheFarFaceWithoutNewContacts) {
  scene::Scene config = demo_scene();
  config.needle->length_m = 0.15;
  Hand hand(config);
  hand.pose[1] = face_m - 0.15 - 0.005;
  hand.phantom.advance(hand.pose, 1e-3);
  hand.move(0.0, 0.13);
  EXPECT_NEAR(hand.path_m(), 0.1, 1e-9);
  EXPECT_LE(hand.phantom.contacts(), 21u);
  EXPECT_EQ(hand.phantom.counters().incomplete, 0u);
  EXPECT_NEAR(hand.phantom.base_wrench()[1], 3.4 + tip_excess_n, 0.02);
  hand.move(0.0, -0.05);
  EXPECT_LT(hand.phantom.base_wrench()[1], 0.0);
}

TEST(Phantom, NamesWhatIsWrongWithAScene) {
  const auto refusal = [](const scene::Scene& scene) {
    try {
      const Phantom phantom(scene);
    } catch (const config::UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  scene::Scene bad = demo_scene();
  bad.tissue.supports.clear();
  EXPECT_NE(refusal(bad).find("unsupported"), std::string::npos);
  bad = demo_scene();
  bad.needle.reset();
  EXPECT_NE(refusal(bad).find("needle"), std::string::npos);
}

TEST(Phantom, WithoutASceneThereIsNothing) {
  Phantom phantom{std::nullopt};
  EXPECT_TRUE(phantom.empty());
  for (int k = 0; k < 100; ++k) EXPECT_EQ(phantom.advance({0.0, 0.10 + 1e-3 * k, std::numbers::pi / 2}, 1e-3), Phantom::Vector3{});
  EXPECT_EQ(phantom.contacts(), 0u);
  EXPECT_EQ(phantom.counters().steps, 0u);
}

}  // namespace
}  // namespace trocar::sim_plant
