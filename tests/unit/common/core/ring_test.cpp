#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "common/core/ring.hpp"

namespace {

TEST(Ring, KeepsOrderAndCountsWhatItDropsWhenFull) {
  trocar::Ring<int, 4> ring;
  for (int i = 0; i < 6; ++i) EXPECT_EQ(ring.push(i), i < 4);
  EXPECT_EQ(ring.dropped(), 2u);
  int value = -1;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(ring.pop(value));
    EXPECT_EQ(value, i);
  }
  EXPECT_FALSE(ring.pop(value));
}

TEST(Ring, HandsEveryElementFromOneThreadToAnother) {
  auto ring = std::make_unique<trocar::Ring<std::uint64_t, 64>>();
  constexpr std::uint64_t count = 200000;
  std::thread producer([&] {
    for (std::uint64_t i = 0; i < count;) {
      if (ring->push(i)) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint64_t expected = 0;
  while (expected < count) {
    std::uint64_t value = 0;
    if (ring->pop(value)) {
      ASSERT_EQ(value, expected);
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
}

}  // namespace
