#include "common/mechanism/five_bar.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::pi;
using testing::published_five_bar;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinite = std::numeric_limits<double>::infinity();

FiveBarModel simple(double base, double proximal, double distal) {
  FiveBarModel model;
  model.base_m = base;
  for (Link& link : model.proximal) link.length_m = proximal;
  for (Link& link : model.distal) link.length_m = distal;
  return model;
}

// All joint angles at which the linkage is in both of its modes, on a regular grid.
template <class Visit>
int for_each_pose(const FiveBarModel& model, double least_distance, const Visit& visit) {
  int visited = 0;
  for (double a = -pi; a < pi; a += 0.13) {
    for (double b = -pi; b < pi; b += 0.13) {
      FiveBarPose pose;
      const Vec2 theta(a, b);
      if (forward(model, theta, pose) != Status::Ok || singularity_distance(model, theta, pose) < least_distance) continue;
      visit(theta, pose);
      ++visited;
    }
  }
  return visited;
}

TEST(FiveBar, ReproducesThePublishedPoseWithMotorZeroOnTheLeft) {
  FiveBarPose pose;
  ASSERT_EQ(forward(published_five_bar(), {pi - 0.5, 0.5}, pose), Status::Ok);
  EXPECT_NEAR(pose.end.x(), 0.0, 1e-15);
  EXPECT_NEAR(pose.end.y(), 0.149223285959824, 1e-15);
  EXPECT_LT(pose.elbow[0].x(), -0.0425);
  EXPECT_GT(pose.elbow[1].x(), 0.0425);
}

TEST(FiveBar, ClosesTheLoopInTheStatedAssemblyMode) {
  const FiveBarModel model = testing::uneven_twin().linkage[1];
  const int visited = for_each_pose(model, 0.0, [&](const Vec2& theta, const FiveBarPose& pose) {
    for (std::size_t i = 0; i < 2; ++i) {
      const Vec2 axis((i == 0 ? -0.5 : 0.5) * model.base_m, 0.0);
      const double angle = theta(static_cast<Eigen::Index>(i)), phi = pose.distal_angle_rad[i];
      const Vec2 end = axis + model.proximal[i].length_m * Vec2(std::cos(angle), std::sin(angle)) +
                       model.distal[i].length_m * Vec2(std::cos(phi), std::sin(phi));
      EXPECT_LT((end - pose.end).norm(), 1e-14);
    }
    const Vec2 across = pose.elbow[1] - pose.elbow[0], up = pose.end - pose.elbow[0];
    EXPECT_GT(across.x() * up.y() - across.y() * up.x(), 0.0);
  });
  EXPECT_GT(visited, 1000);
}

TEST(FiveBar, InverseReturnsTheAnglesOnTheTurnThatWasAskedFor) {
  const FiveBarModel model = testing::uneven_twin().linkage[0];
  const int visited = for_each_pose(model, 0.05, [&](const Vec2& theta, const FiveBarPose& pose) {
    Vec2 back;
    const Vec2 turned = theta + Vec2(6.0 * pi, -4.0 * pi);
    ASSERT_EQ(inverse(model, pose.end, turned + Vec2(3.0, -3.0), back), Status::Ok);
    EXPECT_LT((back - turned).norm(), 1e-12);
  });
  EXPECT_GT(visited, 300);
}

TEST(FiveBar, JacobianMatchesFiniteDifferences) {
  const FiveBarModel model = testing::uneven_twin().linkage[0];
  constexpr double step = 1e-6;
  const int visited = for_each_pose(model, 0.1, [&](const Vec2& theta, const FiveBarPose& pose) {
    Mat2 J;
    ASSERT_EQ(jacobian(model, theta, pose, J), Status::Ok);
    for (int k = 0; k < 2; ++k) {
      FiveBarPose ahead, behind;
      ASSERT_EQ(forward(model, theta + step * Vec2::Unit(k), ahead), Status::Ok);
      ASSERT_EQ(forward(model, theta - step * Vec2::Unit(k), behind), Status::Ok);
      EXPECT_LT((J.col(k) - (ahead.end - behind.end) / (2.0 * step)).norm(), 1e-8);
    }
  });
  EXPECT_GT(visited, 200);
}

TEST(FiveBar, SingularityDistanceIsOneWhereAllThreeAnglesAreRight) {
  const double diagonal = std::sqrt(0.5);
  const FiveBarModel model = simple(0.2, 1.0, 1.0 + 0.1 / diagonal);
  FiveBarPose pose;
  const Vec2 theta(0.75 * pi, 0.25 * pi);
  ASSERT_EQ(forward(model, theta, pose), Status::Ok);
  EXPECT_NEAR(singularity_distance(model, theta, pose), 1.0, 1e-12);
}

TEST(FiveBar, SingularityDistanceFallsToZeroAtStretchedArmsAndAtDistalLinksInLine) {
  const FiveBarModel model = published_five_bar();
  // Up the middle the arms stretch where |P - A| = l + r; the distance there is the sine of the elbow by the cosine rule.
  const double reach = std::sqrt(0.265 * 0.265 - 0.0425 * 0.0425);
  for (const double below : {1e-2, 1e-4, 1e-6}) {
    const double y = reach - below, squared = y * y + 0.0425 * 0.0425;
    const double cosine = (squared - 0.1 * 0.1 - 0.165 * 0.165) / (2.0 * 0.1 * 0.165);
    Vec2 theta;
    FiveBarPose pose;
    ASSERT_EQ(inverse(model, {0.0, y}, {2.0, 1.0}, theta), Status::Ok);
    ASSERT_EQ(forward(model, theta, pose), Status::Ok);
    const double serial = std::sqrt(1.0 - cosine * cosine);
    const double parallel = std::sin(pose.distal_angle_rad[1] - pose.distal_angle_rad[0]);
    EXPECT_NEAR(singularity_distance(model, theta, pose), std::min(serial, parallel), 1e-9);
  }
  // Elbows spread to almost r_0 + r_1: the distal links make an isosceles triangle, almost flat.
  const double angle = 2.2, half = 0.08 - 0.1 * std::cos(angle);
  for (const double slack : {1e-2, 1e-4, 1e-6}) {
    const FiveBarModel wide = simple(0.16, 0.1, half * (1.0 + slack));
    FiveBarPose pose;
    ASSERT_EQ(forward(wide, {angle, pi - angle}, pose), Status::Ok);
    EXPECT_NEAR(singularity_distance(wide, {angle, pi - angle}, pose), std::sin(2.0 * std::acos(1.0 / (1.0 + slack))), 1e-9);
  }
}

TEST(FiveBar, ForeignWorkingModeHasNoDistanceLeftAndIsNotWhatInverseReturns) {
  const FiveBarModel model = published_five_bar();
  const Vec2 outward(pi - 0.5, 0.5);
  FiveBarPose pose, same;
  ASSERT_EQ(forward(model, outward, pose), Status::Ok);
  const double direction = std::atan2(pose.end.y(), pose.end.x() + 0.5 * model.base_m);
  const Vec2 folded_in(2.0 * direction - outward(0), outward(1));
  ASSERT_EQ(forward(model, folded_in, same), Status::Ok);
  EXPECT_LT((same.end - pose.end).norm(), 1e-14);
  EXPECT_GT(singularity_distance(model, outward, pose), 0.5);
  EXPECT_EQ(singularity_distance(model, folded_in, same), 0.0);
  Vec2 theta;
  ASSERT_EQ(inverse(model, pose.end, folded_in, theta), Status::Ok);
  EXPECT_LT((theta - outward).norm(), 1e-12);
}

TEST(FiveBar, RefusesWhatCannotBeReached) {
  const FiveBarModel model = published_five_bar();
  Vec2 theta(7.0, 8.0);
  EXPECT_EQ(inverse(model, {0.0, 0.3}, {2.0, 1.0}, theta), Status::Unreachable);       // beyond both arms
  EXPECT_EQ(inverse(model, {-0.0425, 0.05}, {2.0, 1.0}, theta), Status::Unreachable);  // inside of |r - l| about a motor
  EXPECT_EQ(inverse(model, {0.0, -0.15}, {2.0, 1.0}, theta), Status::Unreachable);     // elbows would have to cross
  EXPECT_EQ(theta, Vec2(7.0, 8.0));
  FiveBarPose pose;
  pose.end = Vec2(7.0, 8.0);
  EXPECT_EQ(forward(simple(0.1, 0.1, 0.149), {pi, 0.0}, pose), Status::Unreachable);  // elbows too far apart
  FiveBarModel lopsided = simple(0.01, 0.1, 0.2);
  lopsided.distal[1].length_m = 0.5;
  EXPECT_EQ(forward(lopsided, {1.0, 1.0}, pose), Status::Unreachable);  // one circle inside of the other
  EXPECT_EQ(pose.end, Vec2(7.0, 8.0));
}

TEST(FiveBar, NamesSingularPoses) {
  FiveBarPose pose;
  EXPECT_EQ(forward(simple(0.0, 0.1, 0.2), {1.0, 1.0}, pose), Status::Singular);  // elbows on top of each other
  const FiveBarModel wide = simple(0.1, 0.1, 0.15 + 1e-15);
  EXPECT_EQ(forward(wide, {pi, 0.0}, pose), Status::Singular);  // distal links in line
  Vec2 theta;
  const FiveBarModel equal = simple(0.1, 0.1, 0.1);
  EXPECT_EQ(inverse(equal, {-0.05, 0.0}, {2.0, 1.0}, theta), Status::Singular);  // end point on a motor axis
  const double stretched = std::sqrt(0.2 * 0.2 - 0.05 * 0.05) * (1.0 - 1e-14);
  EXPECT_EQ(inverse(equal, {0.0, stretched}, {2.0, 1.0}, theta), Status::Singular);

  pose.elbow = {Vec2(-0.15, 0.0), Vec2(0.15, 0.0)};
  pose.end.setZero();
  Mat2 J;
  EXPECT_EQ(jacobian(simple(0.1, 0.1, 0.15), {pi, 0.0}, pose, J), Status::Singular);
}

TEST(FiveBar, RefusesNumbersThatAreNotFinite) {
  const FiveBarModel model = published_five_bar();
  FiveBarPose pose;
  ASSERT_EQ(forward(model, {pi - 0.5, 0.5}, pose), Status::Ok);
  for (const double bad : {nan, infinite, -infinite}) {
    FiveBarPose untouched;
    Vec2 theta;
    Mat2 J, D, C;
    EXPECT_EQ(forward(model, {bad, 0.5}, untouched), Status::NotFinite);
    EXPECT_EQ(forward(model, {0.5, bad}, untouched), Status::NotFinite);
    EXPECT_EQ(inverse(model, {bad, 0.15}, {2.0, 1.0}, theta), Status::NotFinite);
    EXPECT_EQ(inverse(model, {0.0, 0.15}, {2.0, bad}, theta), Status::NotFinite);
    EXPECT_EQ(jacobian(model, {bad, 0.5}, pose, J), Status::NotFinite);
    EXPECT_EQ(dynamics(model, {pi - 0.5, bad}, {0.0, 0.0}, D, C), Status::NotFinite);
    EXPECT_EQ(dynamics(model, {pi - 0.5, 0.5}, {bad, 0.0}, D, C), Status::NotFinite);
    FiveBarPose broken = pose;
    broken.end.x() = bad;
    EXPECT_EQ(jacobian(model, {pi - 0.5, 0.5}, broken, J), Status::NotFinite);
    EXPECT_EQ(singularity_distance(model, {bad, 0.5}, pose), 0.0);
  }
}

}  // namespace
}  // namespace trocar::mechanism
