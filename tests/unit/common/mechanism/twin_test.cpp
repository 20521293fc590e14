#include "common/mechanism/twin.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::pi;
using testing::RandomPoses;
using testing::uneven_twin;

TEST(Twin, TenThousandPosesSurviveInverseAndForward) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model, 0.1);
  double worst_pose = 0.0, worst_joint = 0.0, worst_residual = 0.0;
  for (int i = 0; i < 10000; ++i) {
    const Vec3 x = poses.next().x;
    const Vec4 q_near = poses.vector<Vec4>(20.0);
    Vec4 q, again;
    TwinState state;
    ASSERT_EQ(inverse(model, x, q_near, q), Status::Ok);
    ASSERT_LE((q - q_near).cwiseAbs().maxCoeff(), pi + 1e-12);
    ASSERT_EQ(forward(model, q, x(2) + poses.uniform(-3.1, 3.1), state), Status::Ok);
    ASSERT_EQ(inverse(model, state.x, q, again), Status::Ok);
    worst_pose = std::max(worst_pose, (state.x - x).cwiseAbs().maxCoeff());
    worst_joint = std::max(worst_joint, (again - q).cwiseAbs().maxCoeff());
    worst_residual = std::max(worst_residual, std::abs(state.residual_m));
  }
  EXPECT_LT(worst_pose, 1e-12);
  EXPECT_LT(worst_joint, 1e-12);
  EXPECT_LT(worst_residual, 1e-13);
}

TEST(Twin, HandleLiesOnTheCouplingInTheStatedDirection) {
  const TwinModel model = uneven_twin();
  TwinState state;
  ASSERT_EQ(at_pose(model, {0.01, 0.15, 0.5 * pi}, Vec4::Zero(), state), Status::Ok);
  EXPECT_LT((state.linkage[0].end - Vec2(0.01, 0.13)).norm(), 1e-14);
  EXPECT_LT((state.linkage[1].end - Vec2(0.01, 0.18)).norm(), 1e-14);
}

TEST(Twin, TurnsWithoutEndAndWithoutJumps) {
  const TwinModel model = uneven_twin();
  constexpr int steps_a_turn = 200, turns = 5;
  TwinState start, state;
  ASSERT_EQ(at_pose(model, {0.01, 0.15, 0.3}, Vec4::Constant(0.5 * pi), start), Status::Ok);
  for (const double sense : {1.0, -1.0}) {
    state = start;
    for (int i = 1; i <= turns * steps_a_turn; ++i) {
      const double angle = 0.3 + sense * 2.0 * pi * i / steps_a_turn;
      Vec4 q;
      ASSERT_EQ(inverse(model, {0.01, 0.15, angle}, state.q, q), Status::Ok);
      ASSERT_LT((q - state.q).cwiseAbs().maxCoeff(), 0.05);
      ASSERT_EQ(forward(model, q, state.x(2), state), Status::Ok);  // the last angle is the neighbour
      ASSERT_NEAR(state.x(2), angle, 1e-12);
    }
    EXPECT_NEAR(state.x(2), 0.3 + sense * 2.0 * pi * turns, 1e-12);
    EXPECT_LT((state.q - start.q).norm(), 1e-12);  // the joints themselves do not wind up
  }
}

TEST(Twin, VelocityMapMatchesFiniteDifferencesOfTheInverse) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  constexpr double step = 1e-6;
  for (int i = 0; i < 200; ++i) {
    const TwinState state = poses.next();
    Mat43 H;
    ASSERT_EQ(velocity_map(model, state, H), Status::Ok);
    for (int k = 0; k < 3; ++k) {
      Vec4 ahead, behind;
      ASSERT_EQ(inverse(model, state.x + step * Vec3::Unit(k), state.q, ahead), Status::Ok);
      ASSERT_EQ(inverse(model, state.x - step * Vec3::Unit(k), state.q, behind), Status::Ok);
      EXPECT_LT((H.col(k) - (ahead - behind) / (2.0 * step)).norm(), 1e-6 * H.col(k).norm());
    }
  }
}

TEST(Twin, PoseMapMatchesFiniteDifferencesOfTheForwardFitEvenWhereTheAnglesDisagree) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  constexpr double step = 1e-6;
  for (int i = 0; i < 200; ++i) {
    const TwinState exact = poses.next();
    TwinState state;
    ASSERT_EQ(forward(model, exact.q + poses.vector<Vec4>(0.02), exact.x(2), state), Status::Ok);
    Mat34 F;
    ASSERT_EQ(pose_map(model, state, F), Status::Ok);
    for (int k = 0; k < 4; ++k) {
      TwinState ahead, behind;
      ASSERT_EQ(forward(model, state.q + step * Vec4::Unit(k), state.x(2), ahead), Status::Ok);
      ASSERT_EQ(forward(model, state.q - step * Vec4::Unit(k), state.x(2), behind), Status::Ok);
      EXPECT_LT((F.col(k) - (ahead.x - behind.x) / (2.0 * step)).norm(), 1e-6 * (1.0 + F.col(k).norm()));
    }
  }
}

TEST(Twin, PoseMapUndoesVelocityMap) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  for (int i = 0; i < 200; ++i) {
    const TwinState state = poses.next();
    Mat43 H;
    Mat34 F;
    ASSERT_EQ(velocity_map(model, state, H), Status::Ok);
    ASSERT_EQ(pose_map(model, state, F), Status::Ok);
    EXPECT_LT((F * H - Mat3::Identity()).norm(), 1e-11);
  }
}

TEST(Twin, PoseIsTheBestFitOfARigidCouplingToBothEndPoints) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  const auto misfit = [&](const TwinState& state, const Vec3& x) {
    const Vec2 d(std::cos(x(2)), std::sin(x(2)));
    const Vec2 p0 = x.head<2>() - model.handle_m * d, p1 = x.head<2>() + (model.coupling_m - model.handle_m) * d;
    return (state.linkage[0].end - p0).squaredNorm() + (state.linkage[1].end - p1).squaredNorm();
  };
  for (int i = 0; i < 100; ++i) {
    const TwinState exact = poses.next();
    TwinState state;
    ASSERT_EQ(forward(model, exact.q + poses.vector<Vec4>(0.02), exact.x(2), state), Status::Ok);
    const double best = misfit(state, state.x);
    EXPECT_NEAR(best, 0.5 * state.residual_m * state.residual_m, 1e-15);
    for (int k = 0; k < 20; ++k) EXPECT_GE(misfit(state, state.x + poses.vector<Vec3>(1e-4)), best);
  }
}

TEST(Twin, ResidualShowsOneEncoderThatIsWrong) {
  const TwinModel model = uneven_twin();
  constexpr double error_rad = 50.0 * 2.0 * pi / 16000.0;
  for (int drive = 0; drive < 4; ++drive) {
    double most = 0.0;
    for (int k = 0; k < 24; ++k) {
      TwinState state, wrong;
      Mat2 J;
      ASSERT_EQ(at_pose(model, {0.01, 0.15, 2.0 * pi * k / 24.0}, Vec4::Zero(), state), Status::Ok);
      ASSERT_EQ(forward(model, state.q + error_rad * Vec4::Unit(drive), state.x(2), wrong), Status::Ok);
      // To first order the end point of that linkage moves by J e, and the residual sees the part along the coupling.
      const std::size_t linkage = drive < 2 ? 0 : 1;
      ASSERT_EQ(
          jacobian(model.linkage[linkage], linkage == 0 ? Vec2(state.q.head<2>()) : Vec2(state.q.tail<2>()), state.linkage[linkage], J),
          Status::Ok);
      const Vec2 d(std::cos(state.x(2)), std::sin(state.x(2)));
      EXPECT_NEAR(wrong.residual_m, (linkage == 0 ? -1.0 : 1.0) * error_rad * d.dot(J.col(drive % 2)), 1e-4);
      most = std::max(most, std::abs(wrong.residual_m));
    }
    EXPECT_GT(most, 0.0015) << "drive " << drive;
  }
}

TEST(Twin, RefusesPosesInWhichEitherLinkageFails) {
  const TwinModel model = uneven_twin();
  Vec4 q = Vec4::Constant(9.0);
  EXPECT_EQ(inverse(model, {0.0, 0.5, 0.0}, Vec4::Zero(), q), Status::Unreachable);
  // Only the far end of the coupling is out of reach, first of linkage 1, then of linkage 0.
  EXPECT_EQ(inverse(model, {0.0, 0.232, 0.5 * pi}, Vec4::Zero(), q), Status::Unreachable);
  EXPECT_EQ(inverse(model, {0.0, 0.240, -0.5 * pi}, Vec4::Zero(), q), Status::Unreachable);
  EXPECT_EQ(q, Vec4(Vec4::Constant(9.0)));
}

TEST(Twin, NamesSingularStates) {
  const TwinModel model = uneven_twin();
  TwinState state;
  ASSERT_EQ(at_pose(model, {0.0, 0.15, 1.0}, Vec4::Zero(), state), Status::Ok);
  Mat43 H;
  Mat34 F;
  Mat3 M, C;

  TwinState stretched = state;  // an arm of linkage 1 in one line
  stretched.linkage[1].elbow[0] = Vec2(-0.5 * model.linkage[1].base_m + 0.1, 0.0);
  stretched.linkage[1].end = stretched.linkage[1].elbow[0] + Vec2(0.16, 0.0);
  EXPECT_EQ(velocity_map(model, stretched, H), Status::Singular);
  EXPECT_EQ(dynamics(model, stretched, Vec3::Zero(), M, C), Status::Singular);

  TwinState in_line = state;  // distal links of linkage 0 opposed
  in_line.linkage[0].elbow[0] = in_line.linkage[0].end - Vec2(0.155, 0.0);
  in_line.linkage[0].elbow[1] = in_line.linkage[0].end + Vec2(0.150, 0.0);
  EXPECT_EQ(pose_map(model, in_line, F), Status::Singular);
  EXPECT_EQ(singularity_distance(model, in_line), 0.0);

  TwinState folded = state;  // both end points in one place: no direction
  folded.linkage[1] = folded.linkage[0];
  EXPECT_EQ(pose_map(model, folded, F), Status::Singular);

  // Linkages alike and joints alike put both end points in one place.
  EXPECT_EQ(forward(testing::even_twin(), {2.5, 0.6, 2.5, 0.6}, 0.0, state), Status::Singular);
}

TEST(Twin, VelocityMapIsRegularAtAParallelSingularity) {
  // Elbows of linkage 0 spread until its distal links are in line: forward kinematics is lost there, q' = H x' is not.
  const TwinModel model = testing::even_twin();
  TwinState state;
  ASSERT_EQ(at_pose(model, {0.0, 0.15, 0.0}, Vec4::Zero(), state), Status::Ok);
  FiveBarPose& linkage = state.linkage[0];
  const double lean = 0.02, up = std::sqrt(0.105 * 0.105 - lean * lean), r = 0.155;
  linkage.elbow = {Vec2(-0.04 - lean, up), Vec2(-0.04 - lean + 2.0 * r, up)};
  linkage.end = Vec2(-0.04 - lean + r, up);
  Mat43 H;
  Mat34 F;
  EXPECT_EQ(pose_map(model, state, F), Status::Singular);
  ASSERT_EQ(velocity_map(model, state, H), Status::Ok);
  EXPECT_TRUE(H.allFinite());
}

TEST(Twin, RefusesNumbersThatAreNotFinite) {
  const TwinModel model = uneven_twin();
  TwinState good;
  ASSERT_EQ(at_pose(model, {0.0, 0.15, 1.0}, Vec4::Zero(), good), Status::Ok);
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    TwinState state;
    Vec4 q;
    Mat43 H;
    Mat34 F;
    Mat3 M, C;
    for (int k = 0; k < 4; ++k) {
      Vec4 angles = good.q;
      angles(k) = bad;
      EXPECT_EQ(forward(model, angles, 1.0, state), Status::NotFinite);
      EXPECT_EQ(inverse(model, good.x, angles, q), Status::NotFinite);
    }
    for (int k = 0; k < 3; ++k) {
      Vec3 x = good.x;
      x(k) = bad;
      EXPECT_EQ(inverse(model, x, good.q, q), Status::NotFinite);
      EXPECT_EQ(dynamics(model, good, x, M, C), Status::NotFinite);
    }
    EXPECT_EQ(forward(model, good.q, bad, state), Status::NotFinite);
    TwinState broken = good;
    broken.linkage[1].end.y() = bad;
    EXPECT_EQ(velocity_map(model, broken, H), Status::NotFinite);
    EXPECT_EQ(pose_map(model, broken, F), Status::NotFinite);
    EXPECT_EQ(singularity_distance(model, broken), 0.0);
  }
}

}  // namespace
}  // namespace trocar::mechanism
