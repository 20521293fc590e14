#include "sim_plant/plant/random.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace trocar::sim_plant {
namespace {

// First outputs of SplitMix64 for seed 1234567, as published with the algorithm's reference implementations.
TEST(Random, IsSplitMix64) {
  Random random(1234567);
  EXPECT_EQ(random.bits(), 6457827717110365317u);
  EXPECT_EQ(random.bits(), 3203168211198807973u);
  EXPECT_EQ(random.bits(), 9817491932198370423u);
}

TEST(Random, NormalHasItsMoments) {
  Random random(5);
  const int n = 1000000;
  double sum = 0, square = 0, third = 0, fourth = 0, lagged = 0, last = 0;
  for (int i = 0; i < n; ++i) {
    const double value = random.normal();
    sum += value;
    square += value * value;
    third += value * value * value;
    fourth += value * value * value * value;
    lagged += value * last;
    last = value;
  }
  EXPECT_NEAR(sum / n, 0.0, 0.004);
  EXPECT_NEAR(square / n, 1.0, 0.006);
  EXPECT_NEAR(third / n, 0.0, 0.015);
  EXPECT_NEAR(fourth / n, 2.9, 0.05);
  EXPECT_NEAR(lagged / n, 0.0, 0.004);
}

}  // namespace
}  // namespace trocar::sim_plant
