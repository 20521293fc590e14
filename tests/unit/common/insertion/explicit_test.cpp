// Explicit contacts: points and slip forces as given, against an independent solution with the compliance of the whole sparse system.
#include <gtest/gtest.h>

#include <numbers>

#include "hand.hpp"
#include "tests/reference/rigid_needle.hpp"

namespace trocar::insertion {
namespace {

using namespace testing;

struct Scene {
  std::vector<Vector2> point;
  std::vector<double> slip_force_n;
};

void set(Hand& hand, const Scene& scene) {
  hand.law().explicit_count = static_cast<std::uint32_t>(scene.point.size());
  for (std::size_t i = 0; i < scene.point.size(); ++i) {
    hand.law().explicit_point_m[i] = scene.point[i];
    hand.law().explicit_slip_force_n[i] = scene.slip_force_n[i];
  }
}

// H A H^T of points in the whole mesh, each column by a sparse solve.
Eigen::MatrixXd full_compliance(const reference::GridImage& grid, const std::vector<Vector2>& point) {
  const fem::Locator locator(grid.mesh());
  const auto s = static_cast<Eigen::Index>(point.size());
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(grid.statics().degrees_of_freedom(), 2 * s);
  for (Eigen::Index i = 0; i < s; ++i) {
    const Vector2& x = point[static_cast<std::size_t>(i)];
    const auto at = locator.locate({x[0], x[1], 0.0});
    EXPECT_TRUE(at.has_value());
    for (std::size_t k = 0; k < static_cast<std::size_t>(at->count); ++k)
      for (Eigen::Index c = 0; c < 2; ++c) h(2 * at->node[k] + c, 2 * i + c) += at->weight[k];
  }
  const Eigen::MatrixXd g = h.transpose() * grid.statics().solve(h);
  return 0.5 * (g + g.transpose());
}

// On the shaft of a needle whose base stands at the origin below the block, at angles that are no round numbers.
Scene along(const Pose& base, std::initializer_list<double> arclength_m, std::initializer_list<double> slip_force_n) {
  Scene scene;
  for (const double s : arclength_m)
    scene.point.push_back({base.x_m + s * std::cos(base.theta_rad), base.y_m + s * std::sin(base.theta_rad)});
  scene.slip_force_n = slip_force_n;
  return scene;
}

TEST(Explicit, MeetsAnIndependentSolutionOverAPathWithRotation) {
  for (const fem::Type type : {fem::Type::Tri3, fem::Type::Quad4}) {
    const reference::GridImage& grid = grid_of(type, 0.2);
    Hand hand(grid);
    const Pose start{0.003, -0.04, std::numbers::pi / 2 + 0.07};
    // The last one lies beyond the tip: the shaft is continued.
    const Scene scene = along(start, {0.042, 0.055, 0.0683, 0.08, 0.097, 0.115}, {0.085, 0.085, 0.0, 0.17, 0.04, 0.06});
    set(hand, scene);
    hand.pose = start;
    hand.open();

    const Eigen::MatrixXd g = full_compliance(grid, scene.point);
    reference::RigidNeedle needle;
    for (std::size_t i = 0; i < scene.point.size(); ++i)
      needle.add(scene.point[i], {start.x_m, start.y_m, start.theta_rad}, -scene.slip_force_n[i], scene.slip_force_n[i]);

    EXPECT_EQ(hand.result().status, Status::Ok);
    EXPECT_EQ(hand.model().contacts(), scene.point.size());
    for (const double value : wrench_of(hand.result())) EXPECT_NEAR(value, 0.0, 1e-9);  // present and force-free

    int reversals = 0;
    Pose pose = start;
    for (int k = 0; k < 400; ++k) {
      const double phase = 2 * std::numbers::pi * k / 150.0;
      pose.x_m += 4e-5 * std::sin(phase);
      pose.y_m += 1.5e-4 * std::cos(0.7 * phase);
      pose.theta_rad += 1.5e-3 * std::cos(1.3 * phase);
      const reference::BoxQp qp{g, needle.move_to({pose.x_m, pose.y_m, pose.theta_rad})};
      const reference::Solution known = reference::enumerate(qp);
      ASSERT_TRUE(known.solved) << k << ' ' << known.residual_n;
      hand.pose = pose;
      hand.step();
      ASSERT_EQ(hand.result().status, Status::Ok) << k;
      ASSERT_EQ(hand.model().contacts(), scene.point.size());

      const Eigen::VectorXd u = g * known.force_n;
      Wrench sum;
      for (std::size_t i = 0; i < scene.point.size(); ++i) {
        const auto r = static_cast<Eigen::Index>(2 * i);
        const double fx = known.force_n(r);
        const double fy = known.force_n(r + 1);
        const Vector2 x{scene.point[i][0] + u(r), scene.point[i][1] + u(r + 1)};
        sum.fx_n += fx;
        sum.fy_n += fy;
        sum.tau_nm += (x[0] - pose.x_m) * fy - (x[1] - pose.y_m) * fx;
        const Insertion::ContactReport report = hand.model().contact(i);
        EXPECT_NEAR(report.position_m[0], x[0], 1e-10) << k;
        EXPECT_NEAR(report.position_m[1], x[1], 1e-10) << k;
        const Vector2 t{std::cos(pose.theta_rad), std::sin(pose.theta_rad)};
        EXPECT_NEAR(report.axial_n, t[0] * fx + t[1] * fy, 1e-7) << k;
        EXPECT_LE(std::abs(report.axial_n), scene.slip_force_n[i] + 1e-10);
        const reference::Contact& at = needle.target()[i];
        const double slip = t[0] * (at.gap_m[0] - u(r)) + t[1] * (at.gap_m[1] - u(r + 1));
        if (known.state[i] == reference::Axial::Stuck)
          ++reversals;
        else
          needle.slipped(i, slip);
      }
      EXPECT_NEAR(hand.base().fx_n, sum.fx_n, 1e-7) << k;
      EXPECT_NEAR(hand.base().fy_n, sum.fy_n, 1e-7) << k;
      EXPECT_NEAR(hand.base().tau_nm, sum.tau_nm, 1e-8) << k;
      if (HasFailure()) FAIL() << "step " << k;
    }
    EXPECT_GT(reversals, 100);
    EXPECT_LT(reversals, 2000);  // both states are met
  }
}

TEST(Explicit, BeginsWhereItsPointsLieOnTheShaft) {
  Hand hand(grid_of(fem::Type::Quad4));
  const Pose start{0.0, -0.05, std::numbers::pi / 2};
  set(hand, along(start, {0.06, 0.075}, {0.1, 0.1}));
  hand.pose = start;
  hand.open();
  EXPECT_NEAR(hand.model().contact(0).arclength_m, 0.06, 1e-15);
  EXPECT_NEAR(hand.model().contact(1).arclength_m, 0.075, 1e-15);
  EXPECT_EQ(wrench_of(hand.result()), (std::array<double, 3>{}));
}

TEST(Explicit, RefusesPointsOffTheShaft) {
  const Pose start{0.0, -0.05, std::numbers::pi / 2};
  for (const double off : {0.5e-9, -0.5e-9, 2e-9, -2e-9, 1e-3}) {
    Hand hand(grid_of(fem::Type::Quad4));
    Scene scene = along(start, {0.06, 0.075}, {0.1, 0.1});
    scene.point[1][0] += off;
    set(hand, scene);
    hand.pose = start;
    hand.open();
    if (std::abs(off) < 1e-9) {
      EXPECT_EQ(hand.result().status, Status::Ok) << off;
      EXPECT_EQ(hand.model().contacts(), 2u);
    } else {
      EXPECT_EQ(hand.result().status, Status::OffShaft) << off;
      EXPECT_EQ(hand.model().contacts(), 0u);
      EXPECT_EQ(wrench_of(hand.result()), (std::array<double, 3>{}));
      // Nothing begins until the shaft runs through the points.
      hand.pose.x_m += 1e-3;
      hand.step();
      EXPECT_EQ(hand.result().status, Status::OffShaft);
    }
  }
}

TEST(Explicit, NeitherAddsNorRemovesContacts) {
  Hand hand(grid_of(fem::Type::Tri3));
  const Pose start{0.001, -0.07, std::numbers::pi / 2};
  set(hand, along(start, {0.075, 0.09}, {0.05, 0.05}));
  hand.pose = start;
  hand.open();
  for (const double to : {0.06, -0.2, 0.1}) {
    hand.move(0.0, to);
    EXPECT_EQ(hand.model().contacts(), 2u);
    EXPECT_EQ(hand.result().status, Status::Ok);
    EXPECT_NEAR(hand.base().fy_n, to > 0.0 ? 0.1 : -0.1, 1e-9);
  }
}

TEST(Explicit, WithoutSlipForceOnlyHoldsAcross) {
  Hand hand(grid_of(fem::Type::Quad4));
  const Pose start{0.0, -0.05, std::numbers::pi / 2};
  set(hand, along(start, {0.06, 0.07, 0.09}, {0.0, 0.0, 0.0}));
  hand.pose = start;
  hand.open();
  hand.move(0.0, 0.02);
  EXPECT_NEAR(hand.base().fy_n, 0.0, 1e-12);
  hand.move(0.003, -0.01);
  EXPECT_GT(hand.base().fx_n, 0.05);
  EXPECT_NEAR(hand.base().fy_n, 0.0, 1e-12);
}

// Slip forces are literal: neither the tip's excess nor the speed changes them.
TEST(Explicit, IgnoresDensitiesAndSpeed) {
  const auto run = [](double shaft, bool with_law) {
    Hand hand(grid_of(fem::Type::Quad4));
    const Pose start{0.0, -0.05, std::numbers::pi / 2};
    set(hand, along(start, {0.06, 0.08}, {0.07, 0.09}));
    hand.law().shaft_n_per_m = shaft;
    hand.law().tip_n_per_m = 2 * shaft;
    if (with_law) hand.law().velocity = rising_law();
    hand.pose = start;
    hand.open();
    hand.move(0.001, 0.02, 0.01, 9e-3);
    return wrench_of(hand.result());
  };
  EXPECT_EQ(run(34.0, true), run(0.0, false));
}

TEST(Explicit, TakesTwoContactsAtOnePoint) {
  Hand hand(grid_of(fem::Type::Quad4));
  const Pose start{0.0, -0.05, std::numbers::pi / 2};
  for (const double apart : {0.0, 1e-9}) {
    set(hand, along(start, {0.06, 0.0752, 0.0752 + apart}, {0.1, 0.05, 0.05}));
    hand.pose = start;
    hand.open();
    hand.move(0.001, 0.02, 0.02);
    EXPECT_EQ(hand.result().status, Status::Ok) << apart;
    EXPECT_LE(hand.worst_residual_n(), 1e-9);
    EXPECT_TRUE(std::isfinite(hand.base().tau_nm));
    const Vector2 t = hand.axis();
    EXPECT_LE(std::abs(t[0] * hand.base().fx_n + t[1] * hand.base().fy_n), 0.2 + 1e-9);
  }
}

}  // namespace
}  // namespace trocar::insertion
