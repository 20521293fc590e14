#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "common/needle/beam.hpp"

namespace trocar::needle {
namespace {

constexpr Properties properties{0.15, 5.375e-3, 2e3, 1.5, 12};  // stretches so much that it shows

// Before the base, on it, within elements, two in one place, on a node, on the tip and beyond; not in order. Thrust beyond buckling's, held
// up by a lateral force so that the bent needle is stable.
std::vector<Load> some_loads() {
  return {{0.1, {-0.2, 0.3}, 0.0},  {0.15, {-0.4, 0.1}, 0.002}, {0.031, {0.1, -0.6}, 0.0},
          {0.17, {-0.1, 0.2}, 0.0}, {-0.01, {0.3, 0.3}, 0.01},  {0.1, {0.0, 0.0}, 0.0},
          {0.0, {1.0, 1.0}, 0.0},   {0.0125, {0.05, 0.2}, 0.0}, {0.032, {0.2, 0.1}, -0.001}};
}

const Pose base{0.02, 0.15, 0.7};

std::unique_ptr<Beam> solved(const Pose& at, const std::vector<Load>& loads) {
  auto beam = std::make_unique<Beam>();
  EXPECT_EQ(beam->open(properties), Status::Ok);
  EXPECT_EQ(beam->solve(at, loads).status, Status::Ok);
  return beam;
}

TEST(Flexibility, IsTheDerivativeOfTheSolution) {
  const std::vector<Load> loads = some_loads();
  const auto beam = solved(base, loads);
  ASSERT_EQ(beam->linearise().status, Status::Ok);
  constexpr double step = 1e-4;
  constexpr double tolerance = 3e-8;  // of 0.1 m/N
  for (std::size_t j = 0; j < loads.size(); ++j)
    for (std::size_t axis = 0; axis < 2; ++axis) {
      std::vector<Load> more = loads, less = loads;
      more[j].force_n[axis] += step;
      less[j].force_n[axis] -= step;
      const auto up = solved(base, more), down = solved(base, less);
      for (std::size_t i = 0; i < loads.size(); ++i) {
        const Block b = beam->compliance(i, j);
        for (std::size_t row = 0; row < 2; ++row)
          EXPECT_NEAR((up->position_m(i)[row] - down->position_m(i)[row]) / (2.0 * step), b[2 * row + axis], tolerance) << i << j;
        EXPECT_NEAR((up->theta_rad(i) - down->theta_rad(i)) / (2.0 * step), beam->rotation(i, j)[axis], 20.0 * tolerance) << i << j;
      }
      EXPECT_NEAR((up->tip().theta_rad - down->tip().theta_rad) / (2.0 * step), beam->tip_rotation(j)[axis], 20.0 * tolerance);
      // Castigliano: the energy's derivative is minus where the force acts.
      const double from_base = beam->position_m(j)[axis] - (axis == 0 ? base.x_m : base.y_m);
      EXPECT_NEAR((up->energy_j() - down->energy_j()) / (2.0 * step), -from_base, 1e-8);
    }
}

TEST(Flexibility, FollowsTheBase) {
  const std::vector<Load> loads = some_loads();
  const auto beam = solved(base, loads);
  ASSERT_EQ(beam->linearise().status, Status::Ok);
  constexpr double step = 1e-5;
  const auto up = solved({base.x_m, base.y_m, base.theta_rad + step}, loads);
  const auto down = solved({base.x_m, base.y_m, base.theta_rad - step}, loads);
  for (std::size_t i = 0; i < loads.size(); ++i) {
    for (std::size_t row = 0; row < 2; ++row)
      EXPECT_NEAR((up->position_m(i)[row] - down->position_m(i)[row]) / (2.0 * step), beam->by_base_angle(i)[row], 1e-9) << i;
    EXPECT_NEAR((up->theta_rad(i) - down->theta_rad(i)) / (2.0 * step), beam->rotation_by_base_angle(i), 1e-8);
    EXPECT_LT(std::hypot(beam->correction_m(i)[0], beam->correction_m(i)[1]), 1e-15);  // in equilibrium
  }
  EXPECT_NEAR((up->tip().theta_rad - down->tip().theta_rad) / (2.0 * step), beam->tip_rotation_by_base_angle(), 1e-8);
}

TEST(Flexibility, IsSymmetricToTheBit) {
  const auto beam = solved(base, some_loads());
  for (const Tangent tangent : {Tangent::Exact, Tangent::Convex}) {
    ASSERT_EQ(beam->linearise(tangent).status, Status::Ok);
    for (std::size_t i = 0; i < beam->loads(); ++i)
      for (std::size_t j = 0; j < beam->loads(); ++j) {
        const Block a = beam->compliance(i, j), b = beam->compliance(j, i);
        EXPECT_EQ(a, (Block{b[0], b[2], b[1], b[3]})) << i << j;
      }
  }
  // The needle moves nothing on or before its base.
  EXPECT_EQ(beam->compliance(4, 1), Block{});
  EXPECT_EQ(beam->compliance(6, 6), Block{});
}

// Betti, by numbers that are computed apart: what a moment at i moves j by, a force at j turns i by.
TEST(Flexibility, IsReciprocal) {
  const std::vector<Load> loads = some_loads();
  const auto beam = solved(base, loads);
  ASSERT_EQ(beam->linearise().status, Status::Ok);
  constexpr double step = 1e-6;
  for (std::size_t i = 0; i < loads.size(); ++i) {
    std::vector<Load> more = loads, less = loads;
    more[i].moment_nm += step;
    less[i].moment_nm -= step;
    const auto up = solved(base, more), down = solved(base, less);
    for (std::size_t j = 0; j < loads.size(); ++j)
      for (std::size_t axis = 0; axis < 2; ++axis)
        EXPECT_NEAR((up->position_m(j)[axis] - down->position_m(j)[axis]) / (2.0 * step), beam->rotation(i, j)[axis], 1e-7) << i << j;
  }
}

// The closed form of a straight cantilever: s^2 (3 S - s) / (6 EI) across, s / EA along.
TEST(Flexibility, IsTheClosedFormOfAStraightNeedle) {
  auto beam = std::make_unique<Beam>();
  ASSERT_EQ(beam->open({0.15, 5.375e-3, 7.24e4, 0.0, 24}), Status::Ok);
  const std::vector<Load> points{{0.15, {}, 0.0}, {0.04, {}, 0.0}, {0.0937, {}, 0.0}};
  ASSERT_EQ(beam->place({}, points).status, Status::Ok);
  ASSERT_EQ(beam->linearise().status, Status::Ok);
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double s = std::min(points[i].arclength_m, points[j].arclength_m);
      const double far = std::max(points[i].arclength_m, points[j].arclength_m);
      // Quadratic elements carry a linear moment: exact for points on nodes, and 1e-6 of the tip's compliance for these.
      EXPECT_NEAR(beam->compliance(i, j)[3], s * s * (3.0 * far - s) / (6.0 * 5.375e-3), 4e-7);
      EXPECT_NEAR(beam->compliance(i, j)[0], s / 7.24e4, 1e-20);
      EXPECT_EQ(beam->compliance(i, j)[1], 0.0);
    }
  const double tip = beam->compliance(0, 0)[3] * 3.0 * 5.375e-3 / (0.15 * 0.15 * 0.15);
  EXPECT_NEAR(tip, 1.0, 1e-12);
}

// Also where K is indefinite, straight under more thrust than buckles it: where the step goes is what the linear model says, up to its
// square.
TEST(Flexibility, PredictsTheStepItTakes) {
  for (const double thrust : {0.0, 2.0}) {
    const auto error = [&](double size) {
      const Vector2 push{-thrust * std::cos(base.theta_rad), -thrust * std::sin(base.theta_rad)};
      const std::vector<Load> loads{{0.06, push, 0.0}, {0.11, push, 0.0}, {0.15, push, 0.0}, {0.16, {}, 0.0}};
      auto beam = std::make_unique<Beam>();
      EXPECT_EQ(beam->open({0.15, 5.375e-3, 2e3, 0.0, 16}), Status::Ok);
      EXPECT_EQ(beam->place(base, loads).status, Status::Ok);
      const std::vector<Vector2> change{{size, size}, {0.0, -2.0 * size}, {0.5 * size, size}, {size, -size}};
      EXPECT_EQ(beam->linearise().negative_pivots > 0, thrust > 0.0);
      std::vector<Vector2> expected(4);
      std::vector<Load> changed = loads;
      for (std::size_t i = 0; i < 4; ++i) {
        changed[i].force_n = {loads[i].force_n[0] + change[i][0], loads[i].force_n[1] + change[i][1]};
        expected[i] = {beam->position_m(i)[0] + beam->correction_m(i)[0], beam->position_m(i)[1] + beam->correction_m(i)[1]};
        for (std::size_t j = 0; j < 4; ++j) {
          const Block b = beam->compliance(i, j);
          const Vector2& d = change[j];
          expected[i] = {expected[i][0] + b[0] * d[0] + b[1] * d[1], expected[i][1] + b[2] * d[0] + b[3] * d[1]};
        }
      }
      EXPECT_EQ(beam->apply(changed).status, Status::Ok);
      double worst = 0.0;
      for (std::size_t i = 0; i < 4; ++i)
        worst = std::max(worst, std::hypot(beam->position_m(i)[0] - expected[i][0], beam->position_m(i)[1] - expected[i][1]));
      return worst;
    };
    EXPECT_NEAR(error(1e-3) / error(5e-4), 4.0, 0.2) << thrust;
    EXPECT_LT(error(1e-4), 1e-6) << thrust;
  }
}

TEST(Flexibility, NewtonByHandConvergesWithTheSquare) {
  const std::vector<Load> loads = some_loads();
  const auto exact = solved(base, loads);
  auto beam = std::make_unique<Beam>();
  ASSERT_EQ(beam->open(properties), Status::Ok);
  std::vector<double> residual{beam->place(base, loads).residual_nm};
  for (int k = 0; k < 7; ++k) {
    EXPECT_EQ(beam->linearise().status, Status::Ok);
    residual.push_back(beam->apply(loads).residual_nm);
  }
  EXPECT_LT(residual.back(), 1e-13);
  // Each residual at most a constant times the last one's square, until rounding.
  for (std::size_t k = 2; k + 1 < residual.size(); ++k)
    if (residual[k + 1] > 1e-13) {
      EXPECT_LT(residual[k + 1], 100.0 * residual[k] * residual[k]) << k;
    }
  for (std::size_t i = 0; i < loads.size(); ++i) EXPECT_NEAR(beam->position_m(i)[0], exact->position_m(i)[0], 1e-12);
}

// The chord method: with K and P of another place its own step still ends in the equilibrium, loads that move and change order included.
TEST(Flexibility, CorrectsWithTheFactorOfAnotherPlace) {
  std::vector<Load> loads = some_loads();
  auto beam = solved(base, loads);
  ASSERT_EQ(beam->linearise().status, Status::Ok);
  for (std::size_t i = 0; i < loads.size(); ++i) loads[i].arclength_m += i % 2 == 0 ? 2e-3 : -1e-3;
  loads[1].force_n[1] += 0.01;
  const auto exact = solved(base, loads);
  ASSERT_EQ(beam->apply(loads).status, Status::Ok);
  double last = beam->residual_nm();
  EXPECT_GT(last, 1e-6);
  for (int k = 0; k < 30 && last > 1e-13; ++k) {
    beam->correct();
    const Vector2 expected{beam->position_m(1)[0] + beam->correction_m(1)[0], beam->position_m(1)[1] + beam->correction_m(1)[1]};
    ASSERT_EQ(beam->apply(loads).status, Status::Ok);
    EXPECT_LT(std::hypot(beam->position_m(1)[0] - expected[0], beam->position_m(1)[1] - expected[1]), 10.0 * last) << k;
    EXPECT_LT(beam->residual_nm(), std::max(0.3 * last, 1e-13)) << k;
    last = beam->residual_nm();
  }
  for (std::size_t i = 0; i < loads.size(); ++i) {
    EXPECT_NEAR(beam->position_m(i)[0], exact->position_m(i)[0], 1e-12);
    EXPECT_NEAR(beam->position_m(i)[1], exact->position_m(i)[1], 1e-12);
  }
}

}  // namespace
}  // namespace trocar::needle
