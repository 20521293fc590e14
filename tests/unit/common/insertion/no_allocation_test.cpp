// A program of its own, because it replaces the allocator: once opened, a step allocates nothing.
#include <gtest/gtest.h>

#include "hand.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::insertion {
namespace {

using reference::allocations;

using namespace testing;

TEST(InsertionNoAllocation, ThroughInsertionTurnAdaptationAndWithdrawal) {
  const reference::GridImage grid({.element = fem::Type::Tri3, .nodes_x = 13, .nodes_y = 13});
  for (const contact::Method method : {contact::Method::Embedded, contact::Method::Snap, contact::Method::Adapt}) {
    Hand hand(grid, method);
    hand.law().velocity = rising_law();
    hand.open();
    const std::size_t before = allocations();
    ASSERT_GT(before, 0u);  // the counter works
    hand.move(0.001, 0.07, 0.05);
    const std::size_t most_contacts = hand.model().contacts();
    const std::size_t moved = hand.model().working_set().geometry().moved();
    hand.move(0.001, 0.0, -0.05);
    hand.move(0.0, -0.09);
    hand.pose.x_m = std::nan("");
    hand.step();
    hand.model().reset();
    const std::size_t after = allocations();
    EXPECT_EQ(after, before);
    EXPECT_GT(most_contacts, 6u);
    EXPECT_EQ(moved > 0, method == contact::Method::Adapt);
    EXPECT_EQ(hand.model().contacts(), 0u);
  }
}

TEST(InsertionNoAllocation, OfANeedleThatBends) {
  const reference::GridImage grid({.element = fem::Type::Tri3, .nodes_x = 13, .nodes_y = 13});
  Hand hand(grid);
  hand.image().needle.elements = 24;
  hand.image().needle.bending_nm2 = 2.3e-3;
  hand.image().needle.axial_n = 5e4;
  hand.image().needle.face_rad = 0.5;
  hand.image().needle.tip_lateral = 0.5;
  hand.open();
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);
  hand.move(0.001, 0.05, 0.03);
  const int newton = hand.result().newton;
  Jacobian jacobian{};
  ASSERT_TRUE(hand.model().jacobian(jacobian));
  hand.pose.x_m += 0.05;  // far out of what it can follow
  hand.step();
  hand.pose.x_m -= 0.05;
  hand.move(0.0, -0.07);
  hand.model().reset();
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_GT(newton, 0);
}

}  // namespace
}  // namespace trocar::insertion
