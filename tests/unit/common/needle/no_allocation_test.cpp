// A program of its own, because it replaces the allocator: no operation of the needle allocates.
#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "common/needle/beam.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::needle {
namespace {

using reference::allocations;

TEST(NeedleNoAllocation, ThroughEveryOperationOfTheBeam) {
  const auto beam = std::make_unique<Beam>();
  std::vector<Load> loads(Beam::most_loads);
  for (std::size_t i = 0; i < loads.size(); ++i) loads[i] = {0.0025 * static_cast<double>(i), {-0.01, 0.02}, 1e-4};
  std::vector<Load> pulled = loads;
  for (Load& load : pulled) load.force_n = {0.01, -0.01};
  const std::size_t before = allocations();
  ASSERT_GT(before, 0u);  // the counter works
  double sum = 0.0;
  ASSERT_EQ(beam->open({0.15, 5.4e-3, 7e4, 1.0, capacity::needle_elements}), Status::Ok);
  for (int k = 0; k < 20; ++k) {
    const Pose base{0.001 * k, 0.0, 0.1 * k};
    ASSERT_EQ(beam->solve(base, loads).status, Status::Ok);
    ASSERT_EQ(beam->place(base, loads).status, Status::Ok);
    ASSERT_EQ(beam->linearise(Tangent::Convex).status, Status::Ok);
    ASSERT_EQ(beam->linearise().status, Status::Ok);
    sum += beam->compliance(3, 60)[3] + beam->rotation(2, 1)[0] + beam->tip_rotation(5)[1] + beam->by_base_angle(1)[0];
    ASSERT_EQ(beam->apply(pulled).status, Status::Ok);
    beam->correct();
    ASSERT_EQ(beam->apply(loads).status, Status::Ok);
    sum += beam->at(0.07).theta_rad + beam->reaction().tau_nm;
    beam->reset();
  }
  EXPECT_EQ(allocations(), before);
  EXPECT_NE(sum, 0.0);
}

}  // namespace
}  // namespace trocar::needle
