// A program of its own, because it replaces the allocator.
#include <gtest/gtest.h>

#include <limits>
#include <new>

#include "firmware/control/force_observer.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::control {
namespace {

rig::Rig example() {
  rig::Rig rig;
  for (mechanism::FiveBarModel& linkage : rig.twin.linkage) {
    linkage.base_m = 0.08;
    for (mechanism::Link& link : linkage.proximal) link = {0.105, 0.024, 0.048, 5.4e-5};
    for (mechanism::Link& link : linkage.distal) link = {0.155, 0.020, 0.074, 8.3e-5};
    linkage.end_point_mass_kg = 0.02;
  }
  rig.twin.coupling_m = 0.05;
  rig.twin.handle_m = 0.025;
  rig.twin.handle_mass_kg = 0.15;
  rig.twin.handle_com_m = 0.025;
  rig.twin.handle_inertia_kg_m2 = 1e-4;
  rig.actuation.friction_coulomb_nm = 1.5e-3;
  rig.actuation.encoder_counts_per_turn = 16000;
  rig.timing.tick_hz = 1000.0;
  rig.limits.workspace_x_m = {-0.05, 0.05};
  rig.limits.workspace_y_m = {0.1, 0.2};
  rig.limits.fault_speed_m_s = 1.0;
  rig.limits.fault_angular_speed_rad_s = 20.0;
  return rig;
}

TEST(ForceObserverAllocations, AreNone) {
  const rig::Rig rig = example();
  std::size_t before = reference::allocations();
  ::operator delete(::operator new(8));
  ASSERT_GT(reference::allocations(), before);  // the trap works
  mechanism::TwinState at;
  ASSERT_EQ(mechanism::at_pose(rig.twin, {0.0, 0.15, 1.57}, mechanism::Vec4::Zero(), at), mechanism::Status::Ok);
  before = reference::allocations();
  bool good = true;
  for (const ObserverKind kind : {ObserverKind::Nicosia, ObserverKind::Momentum}) {
    const ForceObserverConfig config = force_observer_config(rig, kind, 390.0);
    good = good && admit(config, rig, 10.0).verdict == Admissible::Yes;
    ForceObserverState state;
    for (int n = 0; n < 100; ++n) {
      mechanism::Vec4 q = at.q + mechanism::Vec4::Constant(1e-4 * n);
      good = good && update(config, state, q, mechanism::Vec4::Constant(0.01), 1e-3) == mechanism::Status::Ok;
      q(0) = std::numeric_limits<double>::quiet_NaN();
      good = good && update(config, state, q, mechanism::Vec4::Zero(), 1e-3) == mechanism::Status::NotFinite;
    }
  }
  EXPECT_EQ(reference::allocations(), before);
  EXPECT_TRUE(good);
}

}  // namespace
}  // namespace trocar::control
