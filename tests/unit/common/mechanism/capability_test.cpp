#include "common/mechanism/capability.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>

#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::even_twin;
using testing::pi;
using testing::RandomPoses;
using testing::uneven_twin;

// Largest force along `direction` at zero moment, by bisection over its size and the interval of internal torques that
// keeps all four joints within their limits.
double force_by_bisection(const Mat43& H, const Vec4& limit, const Vec2& direction) {
  const Vec3 wrench(direction.x(), direction.y(), 0.0);
  const Vec4 particular = H * (H.transpose() * H).inverse() * wrench;
  const Vec4 null = Eigen::FullPivLU<Mat34>(H.transpose()).kernel().col(0);
  const auto possible = [&](double size) {
    double lo = -1e9, hi = 1e9;
    for (int i = 0; i < 4; ++i) {
      const double a = (-limit(i) - size * particular(i)) / null(i), b = (limit(i) - size * particular(i)) / null(i);
      lo = std::max(lo, std::min(a, b));
      hi = std::min(hi, std::max(a, b));
    }
    return lo <= hi;
  };
  double lo = 0.0, hi = 1e4;
  for (int i = 0; i < 60; ++i) (possible(0.5 * (lo + hi)) ? lo : hi) = 0.5 * (lo + hi);
  return lo;
}

TEST(Capability, ForceInWeakestAndBestDirectionMatchASearchOverDirectionsAndInternalTorques) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  const Vec4 limit(0.7, 0.5, 0.9, 0.6);
  for (int i = 0; i < 20; ++i) {
    Mat43 H;
    ASSERT_EQ(velocity_map(model, poses.next(), H), Status::Ok);
    double least = 1e9, most = 0.0;
    for (int k = 0; k < 720; ++k) {
      const double force = force_by_bisection(H, limit, Vec2(std::cos(pi * k / 720.0), std::sin(pi * k / 720.0)));
      least = std::min(least, force);
      most = std::max(most, force);
    }
    const double weakest = weakest_force(H, limit), strongest = strongest_force(H, limit);
    EXPECT_LE(weakest, least * (1.0 + 1e-9));
    EXPECT_GE(weakest, least * (1.0 - 1e-3));
    EXPECT_GE(strongest, most * (1.0 - 1e-9));
    EXPECT_LE(strongest, most * (1.0 + 0.02));  // a corner lies between two of the directions
  }
}

TEST(Capability, ForceOfOneLinkageMatchesASearchOverDirections) {
  const FiveBarModel model = testing::published_five_bar();
  const Vec2 limit(0.1, 0.15);
  FiveBarPose pose;
  Mat2 J;
  ASSERT_EQ(forward(model, {2.4, 0.7}, pose), Status::Ok);
  ASSERT_EQ(jacobian(model, {2.4, 0.7}, pose, J), Status::Ok);
  double least = 1e9, most = 0.0;
  for (int k = 0; k < 3600; ++k) {
    const Vec2 torque = J.transpose() * Vec2(std::cos(pi * k / 3600.0), std::sin(pi * k / 3600.0));
    const double force = std::min(limit(0) / std::abs(torque(0)), limit(1) / std::abs(torque(1)));
    least = std::min(least, force);
    most = std::max(most, force);
  }
  EXPECT_NEAR(weakest_force(J, limit), least, 1e-5 * least);
  EXPECT_NEAR(strongest_force(J, limit), most, 1e-2 * most);
}

TEST(Capability, ResolutionIsWhatOneCountOfOneEncoderDoesToTheComputedPose) {
  const TwinModel model = uneven_twin();
  DriveLimits drives;
  drives.encoder_counts_per_turn = 16000;
  const Vec2 at(0.01, 0.15);
  const Capability result = capability(model, drives, {{at.x(), at.x()}, {at.y(), at.y()}}, {2, 1});
  ASSERT_EQ(result.status, Status::Ok);
  TwinState state;
  ASSERT_EQ(at_pose(model, {at.x(), at.y(), 0.0}, Vec4::Zero(), state), Status::Ok);
  double position = 0.0, angle = 0.0, position_squares = 0.0, angle_squares = 0.0;
  for (int k = 0; k < 4; ++k) {
    TwinState moved;
    ASSERT_EQ(forward(model, state.q + 2.0 * pi / 16000.0 * Vec4::Unit(k), 0.0, moved), Status::Ok);
    const double shift = (moved.x - state.x).head<2>().norm(), turn = std::abs(moved.x(2) - state.x(2));
    position = std::max(position, shift);
    angle = std::max(angle, turn);
    position_squares += shift * shift;
    angle_squares += turn * turn;
  }
  EXPECT_NEAR(result.centre.position_step_m, position, 1e-3 * position);
  EXPECT_NEAR(result.centre.angle_step_rad, angle, 1e-2 * angle);
  EXPECT_NEAR(result.centre.position_rms_m, std::sqrt(position_squares / 12.0), 1e-3 * position);
  EXPECT_NEAR(result.centre.angle_rms_rad, std::sqrt(angle_squares / 12.0), 1e-2 * angle);
}

TEST(Capability, MovingMassIsTheSpectrumOfTheTranslationalInertia) {
  const TwinModel model = uneven_twin();
  const Capability result = capability(model, {}, {{0.02, 0.02}, {0.14, 0.14}}, {2, 1});
  ASSERT_EQ(result.status, Status::Ok);
  TwinState state;
  Mat3 M, C;
  ASSERT_EQ(at_pose(model, {0.02, 0.14, 0.0}, Vec4::Zero(), state), Status::Ok);
  ASSERT_EQ(dynamics(model, state, Vec3::Zero(), M, C), Status::Ok);
  const Eigen::SelfAdjointEigenSolver<Mat2> spectrum(M.topLeftCorner<2, 2>());
  EXPECT_NEAR(result.centre.mass_least_kg, spectrum.eigenvalues()(0), 1e-12);
  EXPECT_NEAR(result.centre.mass_most_kg, spectrum.eigenvalues()(1), 1e-12);
  EXPECT_EQ(result.centre.inertia_kg_m2, M(2, 2));
}

TEST(Capability, WorstOfARectangleIsNoBetterThanAnyPoseInIt) {
  const TwinModel model = even_twin();
  DriveLimits drives;
  drives.encoder_counts_per_turn = 16000;
  drives.continuous_torque_nm.setConstant(0.7);
  drives.peak_torque_nm.setConstant(3.5);
  const Rectangle area{{-0.05, 0.05}, {0.1, 0.2}};
  const Capability all = capability(model, drives, area, {11, 24});
  ASSERT_EQ(all.status, Status::Ok);
  for (const double x_m : {-0.05, 0.0, 0.03}) {
    for (const double y_m : {0.1, 0.15, 0.2}) {
      const Capability one = capability(model, drives, {{x_m, x_m}, {y_m, y_m}}, {2, 24});
      ASSERT_EQ(one.status, Status::Ok);
      EXPECT_LE(all.worst.singularity, one.worst.singularity + 1e-12);
      EXPECT_LE(all.worst.continuous_force_n, one.worst.continuous_force_n + 1e-9);
      EXPECT_GE(all.worst.position_step_m, one.worst.position_step_m - 1e-15);
      EXPECT_GE(all.worst.mass_most_kg, one.worst.mass_most_kg - 1e-12);
    }
  }
  EXPECT_NEAR(all.worst.peak_force_n, 5.0 * all.worst.continuous_force_n, 1e-9);  // limits in that ratio
}

TEST(Capability, SaysWhenARectangleCannotBeReached) {
  EXPECT_EQ(capability(even_twin(), {}, {{-0.05, 0.05}, {0.1, 0.4}}).status, Status::Unreachable);
  EXPECT_EQ(capability(testing::published_five_bar(), {}, {{-0.05, 0.05}, {0.1, 0.4}}).status, Status::Unreachable);
}

template <class Usable>
bool all_usable(const Vec2& centre, double side, double step, const Usable& usable) {
  const int nodes = static_cast<int>(std::lround(side / step));
  for (int i = 0; i <= nodes; ++i) {
    for (int j = 0; j <= nodes; ++j) {
      if (!usable(Vec2(centre.x() - 0.5 * side + i * step, centre.y() - 0.5 * side + j * step))) return false;
    }
  }
  return true;
}

TEST(Capability, LargestSquareHoldsAndNoLargerOneNearbyDoes) {
  const TwinModel model = even_twin();
  constexpr double step = 0.005, least = 0.3;
  constexpr int orientations = 24;
  const auto usable = [&](const Vec2& handle) {
    for (int k = 0; k < orientations; ++k) {
      TwinState state;
      if (at_pose(model, {handle.x(), handle.y(), 2.0 * pi * k / orientations}, Vec4::Zero(), state) != Status::Ok) return false;
      if (singularity_distance(model, state) < least) return false;
    }
    return true;
  };
  const Square square = largest_square(model, least, step, orientations);
  ASSERT_GT(square.side_m, 0.08);
  EXPECT_LE(std::abs(square.centre_m.x()), 0.5 * step + 1e-12);
  EXPECT_TRUE(all_usable(square.centre_m, square.side_m, step, usable));
  for (const double dx : {-0.5, 0.5}) {
    for (double dy = -8.5; dy <= 8.5; dy += 1.0) {
      EXPECT_FALSE(all_usable(square.centre_m + step * Vec2(dx, dy), square.side_m + step, step, usable)) << dx << " " << dy;
    }
  }
}

TEST(Capability, LargestSquareOfOneLinkageShrinksAsMoreDistanceIsAsked) {
  const FiveBarModel model = testing::published_five_bar();
  double last = 1.0;
  for (const double least : {0.1, 0.3, 0.5, 0.7}) {
    const Square square = largest_square(model, least, 0.002);
    EXPECT_LT(square.side_m, last);
    EXPECT_GT(square.side_m, 0.0);
    last = square.side_m;
  }
  EXPECT_EQ(largest_square(model, 1.1, 0.002).side_m, 0.0);  // nothing is further from singular than 1
  EXPECT_EQ(largest_square(model, 0.1, 0.0).side_m, 0.0);
}

}  // namespace
}  // namespace trocar::mechanism
