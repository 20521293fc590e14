// A program of its own, because it replaces the allocator: once built, the plant allocates nothing.
#include <gtest/gtest.h>

#include "machine.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::sim_plant {
namespace {

using reference::allocations;

TEST(PlantNoAllocation, ThroughMotionContactAndStops) {
  Machine m;
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);  // the counter works
  m.follow(2.0, [](double t) { return std::array<double, 3>{0.0, 0.11 + 0.02 * t, 1.57}; });
  const std::size_t contacts = m.plant.phantom().contacts();
  m.plant.set_hand_wrench({20.0, 0.0, 0.0});
  m.plant.advance_to(m.plant.time_ns() + 1'000'000'000, {});
  const std::uint64_t stopped = m.plant.body().counters().stopped;
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_GT(contacts, 3u);
  EXPECT_GT(stopped, 0u);
}

}  // namespace
}  // namespace trocar::sim_plant
