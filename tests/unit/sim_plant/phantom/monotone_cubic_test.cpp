#include "sim_plant/phantom/monotone_cubic.hpp"

#include <gtest/gtest.h>

#include "common/fem/tissue.hpp"

namespace trocar::sim_plant {
namespace {

TEST(MonotoneCubic, MeetsItsPointsAndRisesBetweenThem) {
  const std::vector<double> x{1, 3, 5, 7, 9};
  const std::vector<double> y{34.0, 44.8, 51.9, 56.5, 60.0};
  const MonotoneCubic law("law", x, y);
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_DOUBLE_EQ(law(x[i]), y[i]);
  for (double v = 1.0; v < 8.995; v += 0.01) EXPECT_LT(law(v), law(v + 0.01));
  EXPECT_EQ(law(0.0), 34.0);
  EXPECT_EQ(law(-5.0), 34.0);
  EXPECT_EQ(law(100.0), 60.0);
}

TEST(MonotoneCubic, DoesNotOvershootASteep) {
  const MonotoneCubic law("law", {0, 1, 2, 3}, {0, 0, 1, 1});
  for (double v = 0.0; v <= 3.0; v += 0.01) {
    EXPECT_GE(law(v), 0.0);
    EXPECT_LE(law(v), 1.0);
  }
}

TEST(MonotoneCubic, HasNoKinksInside) {
  const MonotoneCubic law("law", {0, 1, 3, 4}, {0, 2, 3, 7});
  const double h = 1e-6;
  for (const double knot : {1.0, 3.0}) EXPECT_NEAR((law(knot) - law(knot - h)) / h, (law(knot + h) - law(knot)) / h, 1e-4);
}

TEST(MonotoneCubic, ReproducesAStraightLine) {
  const MonotoneCubic law("law", {0, 1, 4}, {1, 3, 9});
  for (double v = 0.0; v <= 4.0; v += 0.1) EXPECT_NEAR(law(v), 1 + 2 * v, 1e-14);
}

TEST(MonotoneCubic, RefusesDataWithoutOrder) {
  EXPECT_THROW(MonotoneCubic("law", {0, 2, 1}, {0, 1, 2}), fem::Error);
  EXPECT_THROW(MonotoneCubic("law", {0, 1}, {0}), fem::Error);
  EXPECT_THROW(MonotoneCubic("law", {}, {}), fem::Error);
}

}  // namespace
}  // namespace trocar::sim_plant
