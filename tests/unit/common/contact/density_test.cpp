#include "common/contact/density.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <initializer_list>
#include <limits>

namespace trocar::contact {
namespace {

Density density(std::initializer_list<double> speed, std::initializer_list<double> value) {
  Law law;
  law.velocity.rows = static_cast<std::uint32_t>(speed.size());
  std::copy(speed.begin(), speed.end(), law.velocity.speed_m_s.begin());
  std::copy(value.begin(), value.end(), law.velocity.shaft_n_per_m.begin());
  // The tip's curve: the same, three times as high.
  for (std::size_t i = 0; i < value.size(); ++i) law.velocity.tip_n_per_m[i] = 3 * law.velocity.shaft_n_per_m[i];
  Density d;
  d.open(law);
  return d;
}

TEST(Density, MeetsItsPointsAndRisesBetweenThem) {
  const std::array<double, 5> x{1, 3, 5, 7, 9};
  const std::array<double, 5> y{34.0, 44.8, 51.9, 56.5, 60.0};
  const Density law = density({1, 3, 5, 7, 9}, {34.0, 44.8, 51.9, 56.5, 60.0});
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_DOUBLE_EQ(law.shaft_n_per_m(x[i]), y[i]);
  for (double v = 1.0; v < 8.995; v += 0.01) EXPECT_LT(law.shaft_n_per_m(v), law.shaft_n_per_m(v + 0.01));
  for (double v = 0.0; v < 10.0; v += 0.37) EXPECT_NEAR(law.tip_n_per_m(v), 3 * law.shaft_n_per_m(v), 1e-12);
  EXPECT_TRUE(law.depends_on_speed());
}

TEST(Density, IsConstantBeyondItsEnds) {
  const Density law = density({1, 3, 5}, {34.0, 44.8, 51.9});
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double v : {0.0, -5.0, 0.999999, -infinity}) EXPECT_EQ(law.shaft_n_per_m(v), 34.0);
  for (const double v : {5.0, 100.0, infinity}) EXPECT_EQ(law.shaft_n_per_m(v), 51.9);
}

TEST(Density, DoesNotOvershootAStep) {
  const Density law = density({0, 1, 2, 3}, {0, 0, 1, 1});
  for (double v = 0.0; v <= 3.0; v += 0.01) {
    EXPECT_GE(law.shaft_n_per_m(v), 0.0);
    EXPECT_LE(law.shaft_n_per_m(v), 1.0);
  }
}

TEST(Density, StaysMonotoneWithStepsOfAnyRatio) {
  const Density law = density({0, 0.001, 1, 1.01, 5}, {10, 9, 3, 2.9999, 0});
  for (double v = 0.0; v < 5.0; v += 0.0007) EXPECT_GE(law.shaft_n_per_m(v), law.shaft_n_per_m(v + 0.0007)) << v;
}

TEST(Density, HasNoKinksInside) {
  const Density law = density({0, 1, 3, 4}, {0, 2, 3, 7});
  const double h = 1e-6;
  for (const double knot : {1.0, 3.0}) {
    const double left = (law.shaft_n_per_m(knot) - law.shaft_n_per_m(knot - h)) / h;
    const double right = (law.shaft_n_per_m(knot + h) - law.shaft_n_per_m(knot)) / h;
    EXPECT_NEAR(left, right, 1e-4);
  }
}

TEST(Density, ReproducesAStraightLine) {
  const Density law = density({0, 1, 4}, {1, 3, 9});
  for (double v = 0.0; v <= 4.0; v += 0.1) EXPECT_NEAR(law.shaft_n_per_m(v), 1 + 2 * v, 1e-14);
}

TEST(Density, WithoutAVelocityLawIgnoresSpeed) {
  Law law;
  law.shaft_n_per_m = 34.0;
  law.tip_n_per_m = 68.0;
  Density d;
  d.open(law);
  EXPECT_FALSE(d.depends_on_speed());
  for (const double v : {-1.0, 0.0, 0.005, 1.0}) {
    EXPECT_EQ(d.shaft_n_per_m(v), 34.0);
    EXPECT_EQ(d.tip_n_per_m(v), 68.0);
  }
}

// The steepest law that the file format can hold: as many rows as there are, and one.
TEST(Density, TakesOneRowAndAllRows) {
  const Density one = density({0.003}, {40.0});
  EXPECT_EQ(one.shaft_n_per_m(0.0), 40.0);
  EXPECT_EQ(one.shaft_n_per_m(1.0), 40.0);
  Law law;
  law.velocity.rows = capacity::velocity_law_rows;
  for (std::size_t i = 0; i < capacity::velocity_law_rows; ++i) {
    law.velocity.speed_m_s[i] = static_cast<double>(i);
    law.velocity.shaft_n_per_m[i] = law.velocity.tip_n_per_m[i] = static_cast<double>(i * i);
  }
  Density all;
  all.open(law);
  for (std::size_t i = 0; i < capacity::velocity_law_rows; ++i)
    EXPECT_DOUBLE_EQ(all.shaft_n_per_m(static_cast<double>(i)), static_cast<double>(i * i));
}

}  // namespace
}  // namespace trocar::contact
