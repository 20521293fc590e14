// A program of its own, because it replaces the allocator: once built, the phantom allocates nothing.
#include <gtest/gtest.h>

#include "scene.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::sim_plant {
namespace {

using reference::allocations;

TEST(PhantomNoAllocation, ThroughInsertionTurnAndWithdrawal) {
  scene::Scene config = demo_scene();
  config.contact->velocity = pvc();
  Hand hand(config);
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);  // the counter works
  hand.move(0.001, 0.07, 0.05);
  const std::size_t most_contacts = hand.phantom.contacts();
  hand.move(0.001, 0.0, -0.05);
  hand.move(0.0, -0.09);
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_GT(most_contacts, 8u);
  EXPECT_EQ(hand.phantom.contacts(), 0u);
}

}  // namespace
}  // namespace trocar::sim_plant
