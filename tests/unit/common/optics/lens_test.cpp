#include "common/optics/lens.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace trocar::optics {
namespace {

// MODELS section 10 (2056 x 1544), and the published calibration of OpenCV's photographs (640 x 480).
constexpr Lens thesis{1884.0, 1884.0, 1044.0, 737.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}};
constexpr Lens published{
    535.91573396163199,
    535.91573396163199,
    342.28315473308373,
    235.57082909788173,
    {-0.26637260909660682, -0.038588898922304653, 0.0017831947042852964, -0.00028122100441115472, 0.23839153080878486}};
constexpr Lens barrel{500.0, 500.0, 320.0, 240.0, {-0.3, 0.0, 0.0, 0.0, 0.0}};  // folds at r = 1 / sqrt(0.9)

struct Trips {
  double worst_px{};
  int iterations{};
  int points{};
};

// Every `every`-th pixel of the image, the last row and column too: rectify, and distort again.
template <class Invert>
Trips round_trips(const Rectifier& rectifier, int width, int height, int every, Invert invert) {
  Trips trips;
  for (int v = 0; v < height; v = v == height - 1 ? height : std::min(v + every, height - 1)) {
    for (int u = 0; u < width; u = u == width - 1 ? width : std::min(u + every, width - 1)) {
      const Pixel seen{static_cast<double>(u), static_cast<double>(v)};
      const Mapped rectified = invert(seen);
      EXPECT_EQ(rectified.status, Status::Ok) << u << ' ' << v << ' ' << to_string(rectified.status);
      const Mapped back = rectifier.distort(rectified.pixel);
      trips.worst_px = std::max(trips.worst_px, std::hypot(back.pixel.u_px - seen.u_px, back.pixel.v_px - seen.v_px));
      trips.iterations = std::max(trips.iterations, rectified.iterations);
      ++trips.points;
    }
  }
  return trips;
}

void expect_round_trips(const Lens& lens, int width, int height, int fixed_point_iterations, int newton_iterations) {
  const Rectifier rectifier(lens);
  const Trips fixed = round_trips(rectifier, width, height, 8, [&](const Pixel& p) { return rectifier.fixed_point(p); });
  const Trips newton = round_trips(rectifier, width, height, 8, [&](const Pixel& p) { return rectifier.newton(p); });
  EXPECT_GT(fixed.points, width * height / 64);
  EXPECT_LT(fixed.worst_px, 1e-6);
  EXPECT_LT(newton.worst_px, 1e-6);
  EXPECT_EQ(fixed.iterations, fixed_point_iterations);
  EXPECT_EQ(newton.iterations, newton_iterations);
}

TEST(Lens, ComesBackOverTheWholeImageOfTheThesis) { expect_round_trips(thesis, 2056, 1544, 12, 4); }
TEST(Lens, ComesBackOverTheWholeImageOfTheCalibratedCamera) { expect_round_trips(published, 640, 480, 14, 5); }

TEST(Lens, BothInversesFindTheRayThatMadeThePixel) {
  const Rectifier rectifier(thesis);
  for (double v = -40.0; v < 1600.0; v += 61.0) {
    for (double u = -40.0; u < 2100.0; u += 61.0) {
      const Mapped seen = rectifier.distort({u, v});
      ASSERT_EQ(seen.status, Status::Ok);
      for (const Mapped& back : {rectifier.fixed_point(seen.pixel), rectifier.newton(seen.pixel)}) {
        ASSERT_EQ(back.status, Status::Ok) << u << ' ' << v;
        EXPECT_NEAR(back.pixel.u_px, u, 1e-7);
        EXPECT_NEAR(back.pixel.v_px, v, 1e-7);
      }
    }
  }
}

TEST(Lens, JacobianIsThatOfFiniteDifferences) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> number(-0.5, 0.5);
  for (int trial = 0; trial < 200; ++trial) {
    Lens lens{1.0, 1.0, 0.0, 0.0, {}};
    for (double& d : lens.distortion) d = number(random);
    const Ray at{2.0 * number(random), 2.0 * number(random)};
    const auto j = distortion_jacobian(lens, at);
    constexpr double h = 1e-5;
    const Ray right = distort(lens, {at.x + h, at.y}), left = distort(lens, {at.x - h, at.y});
    const Ray below = distort(lens, {at.x, at.y + h}), above = distort(lens, {at.x, at.y - h});
    EXPECT_NEAR(j[0], (right.x - left.x) / (2 * h), 1e-8);
    EXPECT_NEAR(j[1], (right.y - left.y) / (2 * h), 1e-8);
    EXPECT_NEAR(j[1], (below.x - above.x) / (2 * h), 1e-8);
    EXPECT_NEAR(j[2], (below.y - above.y) / (2 * h), 1e-8);
  }
}

TEST(Lens, WithoutDistortionNothingMoves) {
  const Rectifier rectifier({700.0, 650.0, 320.0, 240.0, {}});
  EXPECT_EQ(rectifier.invertible_radius(), Rectifier::widest);
  for (const Mapped& m : {rectifier.distort({3.0, 470.0}), rectifier.fixed_point({3.0, 470.0}), rectifier.newton({3.0, 470.0})}) {
    EXPECT_EQ(m.status, Status::Ok);
    EXPECT_NEAR(m.pixel.u_px, 3.0, 1e-12);
    EXPECT_NEAR(m.pixel.v_px, 470.0, 1e-12);
  }
}

TEST(Lens, KnowsWhereItFolds) {
  EXPECT_NEAR(Rectifier(barrel).invertible_radius(), 1.0 / std::sqrt(0.9), 1e-6);
  // Tangential terms alone: 1 = 6 P r.
  EXPECT_NEAR(Rectifier({1, 1, 0, 0, {0, 0, 0.03, -0.04, 0}}).invertible_radius(), 1.0 / 0.3, 1e-6);
  // A fold narrower than a thousandth, of g = 1 - 3 k s + 7 k3 s^3 about its double root at s = 1: not stepped over.
  EXPECT_NEAR(Rectifier({1, 1, 0, 0, {-0.5 * (1 + 1e-7), 0, 0, 0, 0.5 / 7.0}}).invertible_radius(), 1.0, 2e-3);
  EXPECT_EQ(Rectifier({1, 1, 0, 0, {-0.5 * (1 - 1e-3), 0, 0, 0, 0.5 / 7.0}}).invertible_radius(), Rectifier::widest);
}

TEST(Lens, NamesWhatLiesBeyondTheFold) {
  const Rectifier rectifier(barrel);
  const double r = rectifier.invertible_radius();
  const double edge_px = 500.0 * r * (1.0 - 0.3 * r * r);  // the image ends here, 351 px off the axis
  for (int k = 0; k < 16; ++k) {
    const double c = std::cos(0.4 * k), s = std::sin(0.4 * k);
    const auto at = [&](double off_px) { return Pixel{320.0 + off_px * c, 240.0 + off_px * s}; };
    EXPECT_EQ(rectifier.newton(at(0.999 * edge_px)).status, Status::Ok);
    for (const double factor : {1.0001, 1.1, 2.0, 100.0}) {
      const Mapped newton = rectifier.newton(at(factor * edge_px));
      EXPECT_EQ(newton.status, Status::BeyondFold) << k << ' ' << factor;
      EXPECT_TRUE(std::isnan(newton.pixel.u_px) && std::isnan(newton.pixel.v_px));
      EXPECT_NE(rectifier.fixed_point(at(factor * edge_px)).status, Status::Ok) << k << ' ' << factor;
    }
    // A ray beyond the fold has an image on the polynomial, which another ray owns.
    EXPECT_EQ(rectifier.distort(at(500.0 * 1.001 * r)).status, Status::BeyondFold);
    EXPECT_EQ(rectifier.distort(at(500.0 * 0.999 * r)).status, Status::Ok);
  }
}

// Whatever the lens: a pixel that a ray within the radius made is inverted to that ray, or refused by name near the fold; never another
// ray.
TEST(Lens, NeverGivesAnotherRay) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  int good = 0, all = 0, fixed_good = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    Lens lens{1000.0,
              900.0,
              500.0,
              400.0,
              {0.5 * number(random), 0.5 * number(random), 0.02 * number(random), 0.02 * number(random), 0.5 * number(random)}};
    const Rectifier rectifier(lens);
    for (int k = 0; k < 20; ++k) {
      const double r = std::min(rectifier.invertible_radius(), 2.0) * 0.999 * std::sqrt(0.5 + 0.5 * number(random));
      const double angle = 3.1415926 * number(random);
      const Pixel truth = to_pixel(lens, {r * std::cos(angle), r * std::sin(angle)});
      const Mapped seen = rectifier.distort(truth);
      ASSERT_EQ(seen.status, Status::Ok);
      ++all;
      const auto is_truth = [&](const Mapped& m) { return std::hypot(m.pixel.u_px - truth.u_px, m.pixel.v_px - truth.v_px) < 1e-6; };
      const Mapped newton = rectifier.newton(seen.pixel);
      if (newton.status == Status::Ok) {
        EXPECT_TRUE(is_truth(newton));
        ++good;
      }
      const Mapped fixed = rectifier.fixed_point(seen.pixel);
      if (fixed.status == Status::Ok) {
        EXPECT_TRUE(is_truth(fixed));
        ++fixed_good;
      }
    }
  }
  EXPECT_EQ(good, all);
  EXPECT_GT(fixed_good, all / 2);
  EXPECT_LT(fixed_good, all);  // Newton's method is there for a reason
}

TEST(Lens, RefusesWhatIsNotFinite) {
  const Rectifier rectifier(thesis);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinite = std::numeric_limits<double>::infinity();
  for (const Pixel& p : {Pixel{nan, 0.0}, Pixel{0.0, infinite}}) {
    EXPECT_EQ(rectifier.distort(p).status, Status::NotFinite);
    EXPECT_EQ(rectifier.fixed_point(p).status, Status::NotFinite);
    EXPECT_EQ(rectifier.newton(p).status, Status::NotFinite);
  }
  for (const double huge : {1e100, 1e300}) {
    EXPECT_NE(rectifier.newton({huge, huge}).status, Status::Ok);
    EXPECT_NE(rectifier.fixed_point({huge, huge}).status, Status::Ok);
  }
}

}  // namespace
}  // namespace trocar::optics
