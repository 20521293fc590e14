// A program of its own, because it replaces the allocator: no operation of the solver allocates.
#include <gtest/gtest.h>

#include "problem.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::contact {
namespace {

using reference::allocations;

using namespace testing;

TEST(ContactNoAllocation, ThroughEveryOperationOfTheSolver) {
  constexpr std::size_t s = 20;
  reference::Random random(1);
  const Eigen::MatrixXd g = reference::random_compliance(random, s, 1e4);
  std::vector<std::vector<Block>> row;
  for (std::size_t i = 0; i < s; ++i) row.push_back(row_of(g, i));
  std::vector<std::vector<Target>> target;
  for (int k = 0; k < 50; ++k) target.push_back(targets_of(random_contacts(random, s)));
  const auto solver = std::make_unique<Solver>();
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);  // the counter works
  int pivots = 0;
  for (const std::vector<Target>& t : target) {
    while (solver->size() < s) solver->push(row[solver->size()]);
    pivots += solver->solve(t).pivots;
    solver->replace(3, row[3]);
    solver->replace_own(7, row[7][7]);
    solver->start_from(2, State::SlipBackward);
    solver->forget_factor();
    pivots += solver->solve(t).pivots;
    solver->pop();
    pivots += solver->solve({t.data(), solver->size()}).pivots;
  }
  (void)solver->factor_drift();
  solver->clear();
  const std::size_t after = allocations();
  EXPECT_EQ(after, before);
  EXPECT_GT(pivots, 100);
}

}  // namespace
}  // namespace trocar::contact
