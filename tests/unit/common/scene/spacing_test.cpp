#include "common/scene/spacing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trocar::scene {
namespace {

double size_at(const std::vector<double>& axis, std::size_t i) { return axis[i + 1] - axis[i]; }

// Ends, count, order, a node at `towards`, and one factor on each side of it.
void expect_graded(const std::vector<double>& axis, double from, double to, double towards, int nodes) {
  ASSERT_EQ(axis.size(), static_cast<std::size_t>(nodes));
  EXPECT_EQ(axis.front(), from);
  EXPECT_EQ(axis.back(), to);
  EXPECT_EQ(std::adjacent_find(axis.begin(), axis.end(), std::greater_equal<>()), axis.end());
  const auto at = std::find(axis.begin(), axis.end(), towards);
  ASSERT_NE(at, axis.end());
  const auto node = static_cast<std::size_t>(at - axis.begin());
  for (std::size_t i = node; i + 2 < axis.size(); ++i)
    EXPECT_NEAR(size_at(axis, i + 1) / size_at(axis, i), size_at(axis, axis.size() - 2) / size_at(axis, axis.size() - 3), 1e-6);
  for (std::size_t i = 1; i < node; ++i) EXPECT_NEAR(size_at(axis, i - 1) / size_at(axis, i), size_at(axis, 0) / size_at(axis, 1), 1e-6);
}

TEST(Spacing, SmallestElementsHaveTheAskedSize) {
  const auto inner = axis_with_smallest(-0.05, 0.05, 0.0, 21, 0.001);
  expect_graded(inner, -0.05, 0.05, 0.0, 21);
  EXPECT_NEAR(size_at(inner, 10), 0.001, 1e-12);
  EXPECT_NEAR(size_at(inner, 9), 0.001, 1e-12);
  const auto aside = axis_with_smallest(0.0, 1.0, 0.2, 12, 0.02);
  expect_graded(aside, 0.0, 1.0, 0.2, 12);
  EXPECT_NEAR(steepest(aside), 1.6608, 1e-4);  // four elements fill ten smallest: r^3 + r^2 + r = 9
  const auto left = axis_with_smallest(0.0, 1.0, 0.0, 11, 0.01);
  expect_graded(left, 0.0, 1.0, 0.0, 11);
  EXPECT_NEAR(size_at(left, 0), 0.01, 1e-12);
  const auto right = axis_with_smallest(0.0, 1.0, 1.0, 11, 0.01);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(size_at(right, i), size_at(left, 9 - i), 1e-12);
  const auto equal = axis_with_smallest(0.0, 1.0, 0.5, 11, 0.1);
  for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(size_at(equal, i), 0.1, 1e-9);
}

TEST(Spacing, ElementsGrowByTheAskedRatio) {
  const auto axis = axis_with_ratio(-0.02, 0.02, 0.005, 15, 1.25);
  expect_graded(axis, -0.02, 0.02, 0.005, 15);
  EXPECT_NEAR(size_at(axis, 0) / size_at(axis, 1), 1.25, 1e-9);
  EXPECT_NEAR(size_at(axis, 13) / size_at(axis, 12), 1.25, 1e-9);
  EXPECT_LT(steepest(axis), 1.4);  // where the two sides meet as well
  const auto uniform = axis_with_ratio(0.0, 1.0, 0.0, 5, 1.0);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(size_at(uniform, i), 0.25, 1e-15);
}

TEST(Spacing, KnowsWhatCannotBe) {
  EXPECT_TRUE(axis_with_smallest(0.0, 1.0, 0.0, 11, 0.11).empty());
  EXPECT_TRUE(axis_with_smallest(0.0, 1.0, 0.0, 2, 0.5).empty());
  EXPECT_TRUE(axis_with_smallest(0.0, 1.0, 0.5, 2, 0.5).empty());
  EXPECT_EQ(axis_with_smallest(0.0, 1.0, 0.5, 3, 0.5), (std::vector{0.0, 0.5, 1.0}));
}

}  // namespace
}  // namespace trocar::scene
