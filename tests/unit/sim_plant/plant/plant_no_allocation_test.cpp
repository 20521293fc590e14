// A program of its own, because it replaces the allocator: once built, the plant allocates nothing.
#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "machine.hpp"

namespace {
std::size_t allocations = 0;
}

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  std::abort();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace trocar::sim_plant {
namespace {

TEST(PlantNoAllocation, ThroughMotionContactAndStops) {
  Machine m;
  const std::size_t before = allocations;
  ASSERT_GT(before, 0u);  // the counter works
  m.follow(2.0, [](double t) { return std::array<double, 3>{0.0, 0.11 + 0.02 * t, 1.57}; });
  const std::size_t contacts = m.plant.phantom().contacts();
  m.plant.set_hand_wrench({20.0, 0.0, 0.0});
  m.plant.advance_to(m.plant.time_ns() + 1'000'000'000, {});
  const std::uint64_t stopped = m.plant.body().counters().stopped;
  const std::size_t after = allocations;
  EXPECT_EQ(after, before);
  EXPECT_GT(contacts, 3u);
  EXPECT_GT(stopped, 0u);
}

}  // namespace
}  // namespace trocar::sim_plant
