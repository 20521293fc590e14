#include "common/needle/beam.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <vector>

#include "common/needle/directions.hpp"
#include "elastica.hpp"

namespace trocar::needle {
namespace {

constexpr double length = 0.15;
constexpr double bending = 5.375e-3;  // 20G steel
constexpr double axial = 7.24e4;

std::unique_ptr<Beam> beam_of(const Properties& properties) {
  auto beam = std::make_unique<Beam>();
  EXPECT_EQ(beam->open(properties), Status::Ok);
  return beam;
}

// Moment of the loads about the base, at the positions where the beam has them.
double moment_of(const Beam& beam, const Pose& base, const std::vector<Load>& loads) {
  double moment = 0.0;
  for (std::size_t i = 0; i < loads.size(); ++i) {
    const Vector2 r = beam.position_m(i);
    moment += (r[0] - base.x_m) * loads[i].force_n[1] - (r[1] - base.y_m) * loads[i].force_n[0] + loads[i].moment_nm;
  }
  return moment;
}

double tip_error(std::size_t elements, double load) {
  const auto beam = beam_of({length, bending, 1e12, 0.0, elements});
  const double force = load * bending / (length * length);
  const std::vector<Load> loads{{length, {0.0, force}, 0.0}};
  EXPECT_EQ(beam->solve({}, loads).status, Status::Ok);
  const testing::Elastica exact = testing::elastica({length, bending, 1e12}, 0.0, force);
  const Vector2 tip = beam->tip().position_m;
  return std::hypot(tip[0] - exact.x_m, tip[1] - exact.y_m) / length;
}

// Bisshopp and Drucker 1945 print deflections for P L^2 / EI = 1 and 10: 0.3017 and 0.8106 of the length.
TEST(Elastica, TheYardstickAgreesWithThePrintedOne) {
  EXPECT_NEAR(testing::elastica({}, 0.0, 1.0).y_m, 0.30172, 1e-5);
  EXPECT_NEAR(testing::elastica({}, 0.0, 10.0).y_m, 0.81061, 1e-5);
  EXPECT_NEAR(testing::elastica({}, 0.0, 10.0).x_m, testing::elastica({}, 0.0, 10.0, 1.5707, 2000).x_m, 1e-11);
}

TEST(Beam, IsTheElasticaWithFourthOrder) {
  for (const double load : {0.1, 1.0, 3.0, 10.0}) {
    EXPECT_LT(tip_error(16, load), 1e-5) << load;  // wanted: 1e-3
    const double ratio = tip_error(8, load) / tip_error(16, load);
    EXPECT_GT(ratio, 13.0) << load;
    EXPECT_LT(ratio, 19.0) << load;
  }
  // Stretching too, at a strain of some 7 % so that it shows.
  const auto beam = beam_of({1.0, 1.0, 100.0, 0.0, 32});
  const std::vector<Load> loads{{1.0, {3.0, 7.0}, 0.0}};
  ASSERT_EQ(beam->solve({}, loads).status, Status::Ok);
  const testing::Elastica exact = testing::elastica({1.0, 1.0, 100.0}, 3.0, 7.0);
  EXPECT_NEAR(beam->tip().position_m[0], exact.x_m, 1e-6);
  EXPECT_NEAR(beam->tip().position_m[1], exact.y_m, 1e-6);
  EXPECT_NEAR(beam->tip().theta_rad, exact.theta_rad, 1e-5);
}

TEST(Beam, BendsToACircleUnderAMoment) {
  const auto beam = beam_of({length, bending, axial, 0.0, 16});
  const double curvature = 0.9 * 2.0 * std::numbers::pi / length;
  const std::vector<Load> loads{{length, {}, bending * curvature}};
  ASSERT_EQ(beam->solve({}, loads).status, Status::Ok);
  for (const double part : {0.0, 0.1, 0.37, 0.5, 1.0}) {
    const double s = part * length;
    const Station at = beam->at(s);
    EXPECT_NEAR(at.theta_rad, curvature * s, 1e-12);
    EXPECT_NEAR(at.position_m[0], std::sin(curvature * s) / curvature, 1e-9 * length);
    EXPECT_NEAR(at.position_m[1], (1.0 - std::cos(curvature * s)) / curvature, 1e-9 * length);
  }
  EXPECT_NEAR(beam->reaction().tau_nm, -bending * curvature, 1e-12);
}

TEST(Beam, RestsInItsOwnCurvature) {
  const auto beam = beam_of({length, bending, axial, 4.0, 7});
  const Result result = beam->solve({}, {});
  EXPECT_EQ(result.status, Status::Ok);
  EXPECT_EQ(result.iterations, 1);
  for (const double s : {0.0, 0.05, 0.15}) EXPECT_NEAR(beam->at(s).theta_rad, 4.0 * s, 1e-14);
  EXPECT_NEAR(beam->reaction().tau_nm, 0.0, 1e-14);
  // Straightened by the moment that undoes it.
  const std::vector<Load> loads{{length, {}, -4.0 * bending}};
  ASSERT_EQ(beam->solve({}, loads).status, Status::Ok);
  EXPECT_NEAR(beam->tip().position_m[0], length, 1e-14);
  EXPECT_NEAR(beam->tip().position_m[1], 0.0, 1e-14);
}

TEST(Beam, StretchesByTheIntegralOfItsForce) {
  const auto beam = beam_of({length, bending, 2e3, 0.0, 24});
  const std::vector<Load> loads{{length, {1.0, 0.7}, 0.0}, {0.4 * length, {-4.0, 0.5}, 0.0}, {0.71 * length, {0.3, -1.0}, 0.0}};
  ASSERT_EQ(beam->solve({}, loads).status, Status::Ok);
  // Both sides by fine sums between the loads: chords with Richardson's correction, Simpson's rule for N.t / EA.
  double grown = 0.0;
  double stretched = 0.0;
  const double ends[] = {0.0, 0.4 * length, 0.71 * length, length};
  const Vector2 section[] = {{-2.7, 0.2}, {1.3, -0.3}, {1.0, 0.7}};
  for (std::size_t piece = 0; piece < 3; ++piece) {
    constexpr int n = 8000;
    const double h = (ends[piece + 1] - ends[piece]) / n;
    const auto chords = [&](int stride) {
      double sum = 0.0;
      for (int k = 0; k < n; k += stride) {
        const Vector2 a = beam->at(ends[piece] + k * h).position_m;
        const Vector2 b = beam->at(ends[piece] + (k + stride) * h).position_m;
        sum += std::hypot(b[0] - a[0], b[1] - a[1]);
      }
      return sum;
    };
    grown += (4.0 * chords(1) - chords(2)) / 3.0 - (ends[piece + 1] - ends[piece]);
    for (int k = 0; k <= n; ++k) {
      const double theta = beam->at(ends[piece] + k * h).theta_rad;
      const double weight = k == 0 || k == n ? 1.0 : k % 2 == 1 ? 4.0 : 2.0;
      stretched += weight * h / 3.0 * (section[piece][0] * std::cos(theta) + section[piece][1] * std::sin(theta)) / 2e3;
    }
  }
  EXPECT_GT(std::abs(stretched), 1e-5 * length);
  EXPECT_NEAR(grown, stretched, 1e-9 * length);
}

TEST(Beam, HoldsItsLoadsAtTheClamp) {
  const auto beam = beam_of({length, bending, axial, 2.0, 24});
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  for (int k = 0; k < 100; ++k) {
    std::vector<Load> loads;
    Vector2 sum{};
    for (int i = 0; i < 20; ++i) {
      // Before the base, on it, along the shaft, on the tip and beyond.
      const double s = i == 0 ? -0.01 : i == 1 ? 0.0 : i == 2 ? length : (0.5 + 0.6 * unit(random)) * length;
      loads.push_back({s, {unit(random), unit(random)}, 0.01 * unit(random)});
      sum = {sum[0] + loads.back().force_n[0], sum[1] + loads.back().force_n[1]};
    }
    const Pose base{0.3, -0.2, 10.0 * unit(random)};
    beam->reset();
    const Result result = beam->solve(base, loads);
    if (result.status != Status::Ok) continue;
    const double moment = moment_of(*beam, base, loads);
    double scale = 0.0;
    for (const Load& load : loads) scale += std::abs(load.moment_nm) + length * std::hypot(load.force_n[0], load.force_n[1]);
    EXPECT_NEAR(beam->reaction().tau_nm, -moment, 1e-11 * scale);
    EXPECT_NEAR(beam->reaction().fx_n, -sum[0], 1e-13);
    EXPECT_NEAR(beam->reaction().fy_n, -sum[1], 1e-13);
  }
  const std::vector<Load> small{{length, {0.0, 1e-7}, 0.0}};
  beam->reset();
  ASSERT_EQ(beam->solve({}, small).status, Status::Ok);
  EXPECT_NEAR(beam->reaction().tau_nm / -moment_of(*beam, {}, small), 1.0, 1e-8);  // 1e-8 of a moment of 1e-8 N m
}

TEST(Beam, IsTheSameInEveryFrame) {
  const auto beam = beam_of({length, bending, axial, 0.0, 24});
  const std::vector<Load> loads{{0.05, {0.1, 0.6}, 0.001}, {length, {-0.3, 0.2}, 0.0}, {0.17, {0.1, -0.1}, 0.0}};
  ASSERT_EQ(beam->solve({}, loads).status, Status::Ok);
  const auto turned = beam_of({length, bending, axial, 0.0, 24});
  const double angle = 2.1;
  const double c = std::cos(angle), s = std::sin(angle);
  std::vector<Load> there = loads;
  for (Load& load : there) load.force_n = {c * load.force_n[0] - s * load.force_n[1], s * load.force_n[0] + c * load.force_n[1]};
  ASSERT_EQ(turned->solve({0.1, 0.2, angle}, there).status, Status::Ok);
  for (std::size_t i = 0; i < loads.size(); ++i) {
    const Vector2 r = beam->position_m(i);
    EXPECT_NEAR(turned->position_m(i)[0], 0.1 + c * r[0] - s * r[1], 1e-12);
    EXPECT_NEAR(turned->position_m(i)[1], 0.2 + s * r[0] + c * r[1], 1e-12);
    EXPECT_NEAR(turned->theta_rad(i), beam->theta_rad(i) + angle, 1e-12);
  }
  EXPECT_NEAR(turned->reaction().tau_nm, beam->reaction().tau_nm, 1e-13);
}

TEST(Beam, ContinuesStraightAndRigidBeyondBothEnds) {
  const auto beam = beam_of({length, bending, axial, 0.0, 24});
  const double over = 0.02;
  const std::vector<Load> beyond{{length + over, {-0.1, 0.4}, 0.0}, {-0.01, {5.0, 7.0}, 0.0}};
  const Pose base{0.0, 0.0, 0.4};
  ASSERT_EQ(beam->solve(base, beyond).status, Status::Ok);
  const Station tip = beam->tip();
  EXPECT_NEAR(beam->position_m(0)[0], tip.position_m[0] + over * tip.tangent[0], 1e-15);
  EXPECT_NEAR(beam->position_m(1)[1], -0.01 * std::sin(0.4), 1e-17);
  const Station far = beam->at(length + over);
  EXPECT_EQ(far.position_m, beam->position_m(0));
  EXPECT_EQ(far.theta_rad, tip.theta_rad);
  // The same force on the tip with its moment there.
  const double moment = over * (tip.tangent[0] * 0.4 + tip.tangent[1] * 0.1);
  const auto other = beam_of({length, bending, axial, 0.0, 24});
  const std::vector<Load> moved{{length, {-0.1, 0.4}, moment}};
  ASSERT_EQ(other->solve(base, moved).status, Status::Ok);
  EXPECT_NEAR(other->tip().position_m[0], tip.position_m[0], 1e-12);
  EXPECT_NEAR(other->tip().position_m[1], tip.position_m[1], 1e-12);
}

TEST(Beam, BucklesAtEulersLoad) {
  const double euler = std::numbers::pi * std::numbers::pi * bending / (4.0 * length * length);
  const auto beam = beam_of({length, bending, 1e9, 0.0, 16});
  double holds = 0.5 * euler, buckles = 2.0 * euler;
  for (int k = 0; k < 40; ++k) {
    const double thrust = 0.5 * (holds + buckles);
    const std::vector<Load> loads{{length, {-thrust, 0.0}, 0.0}};
    ASSERT_EQ(beam->place({}, loads).status, Status::Ok);
    (beam->linearise().negative_pivots > 0 ? buckles : holds) = thrust;
  }
  EXPECT_NEAR(holds / euler, 1.0, 1e-5);
  const auto pushed = [&](double thrust, double side) { return std::vector<Load>{{length, {-thrust * euler, side}, 0.0}}; };
  EXPECT_EQ(beam->solve({}, pushed(0.99, 0.0)).status, Status::Ok);
  EXPECT_EQ(beam->solve({}, pushed(1.01, 0.0)).status, Status::Unstable);
  EXPECT_EQ(beam->solve({}, pushed(9.1, 0.0)).status, Status::Unstable);
  EXPECT_EQ(beam->linearise().negative_pivots, 2);
  EXPECT_EQ(beam->linearise(Tangent::Convex).negative_pivots, 0);
  for (const double side : {1e-9, -1e-6, 1e-3}) {
    beam->reset();
    ASSERT_EQ(beam->solve({}, pushed(1.5, side)).status, Status::Ok) << side;
    EXPECT_GT(beam->tip().position_m[1] * side, 0.0);
    EXPECT_GT(std::abs(beam->tip().position_m[1]), 0.3 * length);
    EXPECT_EQ(beam->linearise().negative_pivots, 0);
  }
  const testing::Elastica exact = testing::elastica({length, bending, 1e9}, -1.5 * euler, 1e-3, 3.0);
  EXPECT_NEAR(beam->tip().position_m[0], exact.x_m, 1e-5 * length);
  EXPECT_NEAR(beam->tip().position_m[1], exact.y_m, 1e-5 * length);
}

TEST(Beam, RefusesWhatIsNotFiniteAndKeepsItsShape) {
  const auto beam = beam_of({length, bending, axial, 0.0, 24});
  const std::vector<Load> good{{length, {0.0, 0.3}, 0.0}};
  ASSERT_EQ(beam->solve({}, good).status, Status::Ok);
  const Vector2 tip = beam->tip().position_m;
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    for (const Load& load : {Load{bad, {}, 0.0}, Load{0.1, {bad, 0.0}, 0.0}, Load{0.1, {0.0, -bad}, 0.0}, Load{0.1, {}, bad}}) {
      EXPECT_EQ(beam->solve({}, {&load, 1}).status, Status::NotFinite);
      EXPECT_EQ(beam->place({}, {&load, 1}).status, Status::NotFinite);
    }
    for (const Pose& pose : {Pose{bad, 0.0, 0.0}, Pose{0.0, bad, 0.0}, Pose{0.0, 0.0, bad}})
      EXPECT_EQ(beam->solve(pose, good).status, Status::NotFinite);
    const std::vector<Load> pulled{{length, {bad, 0.0}, 0.0}};
    EXPECT_EQ(beam->apply(pulled).status, Status::NotFinite);
    EXPECT_EQ(beam->tip().position_m, tip);
    Beam* const unusable = beam_of({length, bending, axial, 0.0, 24}).release();
    EXPECT_EQ(unusable->open({length, bad, axial, 0.0, 24}), Status::NotOpen);
    EXPECT_EQ(unusable->solve({}, good).status, Status::NotOpen);
    EXPECT_EQ(unusable->linearise().status, Status::NotOpen);
    delete unusable;
  }
  EXPECT_EQ(beam->solve({}, std::vector<Load>(Beam::most_loads + 1)).status, Status::CapacityReached);
  EXPECT_EQ(beam->tip().position_m, tip);
  const std::vector<Load> huge{{length, {1e300, 1e300}, 0.0}};
  EXPECT_EQ(beam->solve({}, huge).status, Status::NotFinite);
  EXPECT_TRUE(std::isfinite(beam->tip().position_m[0]));
  const double tiny = std::numeric_limits<double>::denorm_min();
  const std::vector<Load> small{{tiny, {tiny, -tiny}, tiny}, {length, {tiny, tiny}, 0.0}, {std::nextafter(length, 1.0), {}, 0.0}};
  ASSERT_EQ(beam->solve({}, small).status, Status::Ok);
  EXPECT_NEAR(beam->tip().position_m[0], length, 1e-15);
  EXPECT_EQ(beam->linearise().status, Status::Ok);
  for (const Properties& p : {Properties{0.0, 1.0, 1.0, 0.0, 4}, Properties{1.0, -1.0, 1.0, 0.0, 4}, Properties{1.0, 1.0, 0.0, 0.0, 4},
                              Properties{1.0, 1.0, 1.0, 0.0, 0}, Properties{1.0, 1.0, 1.0, 0.0, capacity::needle_elements + 1}})
    EXPECT_EQ(std::make_unique<Beam>()->open(p), Status::NotOpen);
}

TEST(Beam, FindsAStableEquilibriumUnderRandomLoads) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  int solved = 0;
  int most = 0;
  constexpr int cases = 10000;
  auto beam = std::make_unique<Beam>();
  for (int k = 0; k < cases; ++k) {
    if (k % 50 == 0) {
      ASSERT_EQ(beam->open({length, bending, axial, 5.0 * unit(random), 1 + static_cast<std::size_t>(k / 50) % 64}), Status::Ok);
    }
    if (k % 3 == 0) beam->reset();
    std::vector<Load> loads(static_cast<std::size_t>(k) % 12);
    const double size = std::pow(10.0, 2.0 * unit(random)) / static_cast<double>(loads.size() + 1);  // 0.01 … 100 N
    for (Load& load : loads)
      load = {0.5 * length * (1.0 + 1.2 * unit(random)), {size * unit(random), size * unit(random)}, 0.02 * size * unit(random)};
    const Result result = beam->solve({0.0, 0.0, 3.0 * unit(random)}, loads);
    most = std::max(most, result.iterations);
    EXPECT_TRUE(std::isfinite(beam->tip().position_m[0]) && std::isfinite(result.residual_nm));
    if (result.status != Status::Ok) {
      EXPECT_TRUE(result.status == Status::NotConverged || result.status == Status::Unstable) << to_string(result.status);
      continue;
    }
    ++solved;
    EXPECT_LE(result.residual_nm, 1e-10 * (size + bending / length));
    EXPECT_EQ(beam->linearise().negative_pivots, 0);
  }
  // All of them, with this seed, in at most 32 iterations.
  EXPECT_GT(solved, cases * 99 / 100);
  EXPECT_LT(most, 60);
}

TEST(Directions, AreTheLibrarysCosinesAndSines) {
  std::mt19937_64 random(3);
  for (const double range : {1e-3, 1.0, 100.0, 0.999e5, 1e9}) {
    std::uniform_real_distribution<double> angle(-range, range);
    std::vector<double> a(1003), c(1003), s(1003);
    for (double& value : a) value = angle(random);
    a[0] = 0.0;
    a[1] = std::min(range, std::numbers::pi / 4);
    directions(a.data(), c.data(), s.data(), a.size());
    EXPECT_EQ(c[0], 1.0);
    EXPECT_EQ(s[0], 0.0);
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_NEAR(c[i], std::cos(a[i]), 3e-16) << a[i];
      EXPECT_NEAR(s[i], std::sin(a[i]), 3e-16) << a[i];
    }
  }
  const double a = std::numeric_limits<double>::quiet_NaN();
  double c = 0.0, s = 0.0;
  directions(&a, &c, &s, 1);
  EXPECT_TRUE(std::isnan(c) && std::isnan(s));
}

}  // namespace
}  // namespace trocar::needle
