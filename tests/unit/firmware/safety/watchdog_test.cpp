#include "firmware/safety/watchdog.hpp"

#include <gtest/gtest.h>

namespace trocar::safety {
namespace {

TEST(Watchdog, ExpiresOnlyBeyondItsLimit) {
  Watchdog dog(80);
  dog.feed(1000);
  EXPECT_FALSE(dog.expired(1000));
  EXPECT_FALSE(dog.expired(1079));
  EXPECT_FALSE(dog.expired(1080));
  EXPECT_TRUE(dog.expired(1081));
  EXPECT_EQ(dog.age_ns(1081), 81);
}

TEST(Watchdog, FeedingStartsItAgain) {
  Watchdog dog(80);
  dog.feed(0);
  EXPECT_TRUE(dog.expired(100));
  dog.feed(100);
  EXPECT_FALSE(dog.expired(180));
  EXPECT_TRUE(dog.expired(181));
}

}  // namespace
}  // namespace trocar::safety
