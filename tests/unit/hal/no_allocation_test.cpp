// A program of its own, because it replaces the allocator: from the first tick on, bring-up, operation, a fault and the shut-down
// of the link and of the simulated nodes allocate nothing.
#include <gtest/gtest.h>

#include <memory>

#include "tests/reference/allocations/allocations.hpp"
#include "wired_rig.hpp"

namespace trocar::hal {
namespace {

using reference::allocations;

TEST(NoAllocation, FromBringUpToShutDown) {
  const auto w = std::make_unique<WiredRig>();
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);  // the counter works
  w->command.request = DriveRequest::Enable;
  w->command.joint_torque_nm.fill(0.2);
  for (int i = 0; i < 1000; ++i) w->tick();
  const bool enabled = w->all_enabled();
  w->drive[0].trigger_fault(0x2310);
  for (int i = 0; i < 100; ++i) w->tick();
  const char* step = w->link.bring_up_step();
  const bool named = step[0] != '\0';
  w->link.shut_down(w->now_ns);
  w->tick();
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_TRUE(enabled);
  EXPECT_TRUE(named);
}

}  // namespace
}  // namespace trocar::hal
