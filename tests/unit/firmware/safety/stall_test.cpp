#include "firmware/safety/stall.hpp"

#include <gtest/gtest.h>

namespace trocar::safety {
namespace {

TEST(Stall, IsSeenOnlyBeyondItsLimit) {
  Stall stall(200, 20);
  EXPECT_FALSE(stall.look(7, 1000));
  for (std::int64_t now = 1020; now <= 1200; now += 20) EXPECT_FALSE(stall.look(7, now)) << now;
  EXPECT_TRUE(stall.look(7, 1201));
  EXPECT_TRUE(stall.look(7, 1221));
}

TEST(Stall, EndsWithAPass) {
  Stall stall(40, 20);
  (void)stall.look(1, 0);
  (void)stall.look(1, 20);
  (void)stall.look(1, 40);
  EXPECT_FALSE(stall.look(2, 60));
  EXPECT_FALSE(stall.look(2, 80));
  EXPECT_FALSE(stall.look(2, 100));
  EXPECT_TRUE(stall.look(2, 101));
}

TEST(Stall, IsNoneBeforeTheLoopHasBegun) {
  Stall stall(40, 20);
  for (std::int64_t now = 0; now < 1000; now += 20) EXPECT_FALSE(stall.look(0, now)) << now;
  EXPECT_FALSE(stall.look(1, 1000));
}

// Stopped as a whole and continued: the loop is due its own time before it is said to have stalled.
TEST(Stall, CountsALookThatCameLateAsOne) {
  Stall stall(40, 20);
  (void)stall.look(5, 0);
  EXPECT_FALSE(stall.look(5, 1'000'000));
  EXPECT_FALSE(stall.look(5, 1'000'020));
  EXPECT_TRUE(stall.look(5, 1'000'040));
}

TEST(Stall, IsNotHurriedByAClockThatWentBack) {
  Stall stall(40, 20);
  (void)stall.look(5, 1000);
  EXPECT_FALSE(stall.look(5, 0));
  EXPECT_FALSE(stall.look(5, 20));
  EXPECT_FALSE(stall.look(5, 40));
  EXPECT_TRUE(stall.look(5, 41));
}

}  // namespace
}  // namespace trocar::safety
