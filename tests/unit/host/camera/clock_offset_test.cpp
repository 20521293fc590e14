#include "host/camera/clock_offset.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

namespace trocar::camera {
namespace {

// A remote clock that drifts, frames 30 times a second, delays of 0.3 ms at least: mostly little more, now and then 20 ms.
struct Link {
  double drift{};
  std::int64_t offset_ns{};
  std::mt19937 random{5};
  std::int64_t least_ns{300'000};

  [[nodiscard]] std::int64_t local(std::int64_t remote_ns) const {
    return remote_ns + offset_ns + std::llround(drift * static_cast<double>(remote_ns));
  }
  std::int64_t arrival(std::int64_t remote_ns) {
    const double jitter = std::exponential_distribution<double>(1.0 / 2e5)(random);
    const bool late = std::uniform_int_distribution<int>(0, 19)(random) == 0;
    return local(remote_ns) + least_ns + std::llround(jitter) + (late ? 20'000'000 : 0);
  }
};
constexpr std::int64_t frame_ns = 33'333'333;

TEST(ClockOffset, FollowsADriftingClockThroughJitter) {
  for (const double drift : {-5e-5, 0.0, 5e-5}) {
    Link link{drift, 7'000'000'000};
    ClockOffset clock;
    double worst_ns = 0.0;
    for (int k = 0; k < 1800; ++k) {
      const std::int64_t remote = k * frame_ns;
      EXPECT_TRUE(clock.see(remote, link.arrival(remote))) << k;
      if (k < 150) continue;
      const auto local = clock.to_local(remote);
      ASSERT_TRUE(local);
      EXPECT_NEAR(static_cast<double>(*clock.to_remote(*local) - remote), 0.0, 2.0);
      worst_ns = std::max(worst_ns, std::abs(static_cast<double>(*local - link.local(remote) - link.least_ns)));
    }
    EXPECT_LT(worst_ns, 60'000.0) << drift;  // jitter of 200 us, late ones of 20 ms
    const auto e = clock.estimate();
    ASSERT_TRUE(e);
    EXPECT_NEAR(e->drift, drift, 3e-6);
    EXPECT_GT(e->uncertainty_ns, 1'000);
    EXPECT_LT(e->uncertainty_ns, 60'000);
    EXPECT_EQ(clock.steps(), 0u);
  }
}

TEST(ClockOffset, NoticesAClockThatBeginsAnew) {
  Link link{2e-5, 1'000'000'000};
  ClockOffset clock;
  for (int k = 0; k < 300; ++k) (void)clock.see(k * frame_ns, link.arrival(k * frame_ns));
  const std::int64_t restart = link.local(300 * frame_ns);
  Link anew{2e-5, restart};
  EXPECT_FALSE(clock.see(0, anew.arrival(0)));
  EXPECT_EQ(clock.steps(), 1u);
  for (int k = 1; k < 100; ++k) EXPECT_TRUE(clock.see(k * frame_ns, anew.arrival(k * frame_ns)));
  EXPECT_NEAR(static_cast<double>(*clock.to_local(99 * frame_ns)), static_cast<double>(anew.local(99 * frame_ns) + 300'000), 100'000.0);
}

TEST(ClockOffset, NoticesAClockThatIsSetForward) {
  Link link{0.0, 1'000'000'000};
  ClockOffset clock;
  for (int k = 0; k < 100; ++k) (void)clock.see(k * frame_ns, link.arrival(k * frame_ns));
  const std::int64_t ahead = 100 * frame_ns + 5'000'000'000;  // five seconds more than went by
  EXPECT_FALSE(clock.see(ahead, link.arrival(100 * frame_ns)));
}

TEST(ClockOffset, OneLateArrivalIsNoStep) {
  Link link{0.0, 1'000'000'000};
  ClockOffset clock;
  for (int k = 0; k < 100; ++k) (void)clock.see(k * frame_ns, link.arrival(k * frame_ns));
  EXPECT_TRUE(clock.see(100 * frame_ns, link.arrival(100 * frame_ns) + 2'000'000'000));
  EXPECT_NEAR(static_cast<double>(*clock.to_local(100 * frame_ns)), static_cast<double>(link.local(100 * frame_ns) + 300'000), 100'000.0);
}

TEST(ClockOffset, SaysNothingBeforeItKnows) {
  ClockOffset clock;
  EXPECT_FALSE(clock.estimate());
  EXPECT_FALSE(clock.to_local(0));
  EXPECT_TRUE(clock.see(0, 10));
  EXPECT_FALSE(clock.estimate());
}

}  // namespace
}  // namespace trocar::camera
