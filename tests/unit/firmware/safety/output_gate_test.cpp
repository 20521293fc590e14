#include "firmware/safety/output_gate.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace trocar::safety {
namespace {

constexpr double dt = 0.001;

// Peak at the joint: 0.05 * 10 * ratio * 0.8 = 2 N m for drives 0 and 1, 4 N m for 2 and 3. Slew: 0.1 N m a tick.
rig::Rig test_rig() {
  rig::Rig rig;
  rig.kind = rig::Kind::Twin;
  rig.actuation.torque_constant_nm_per_a = 0.05;
  rig.actuation.peak_current_a = 10.0;
  rig.actuation.gear_ratio = {5, 5, 10, 10};
  rig.actuation.gear_efficiency = 0.8;
  rig.limits.torque_slew_nm_per_s = 100.0;
  return rig;
}

struct SafetyGate : ::testing::Test {
  rig::Rig rig = test_rig();
  GateState state;
  JointTorques out{9, 9, 9, 9};
};

TEST_F(SafetyGate, LetsPassWhatIsWithinTheLimits) {
  const JointTorques wanted{0.1, -0.1, 0.05, 0.0};
  EXPECT_TRUE(pass(rig, state, wanted, dt, out));
  EXPECT_EQ(out, wanted);
  EXPECT_EQ(state.limited, 0u);
}

TEST_F(SafetyGate, OneValueThatIsNotFiniteZeroesAll) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()})
    for (std::size_t at = 0; at < 4; ++at) {
      JointTorques wanted{0.1, 0.1, 0.1, 0.1};
      ASSERT_TRUE(pass(rig, state, wanted, dt, out));
      wanted[at] = bad;
      EXPECT_FALSE(pass(rig, state, wanted, dt, out));
      EXPECT_EQ(out, JointTorques{});
      EXPECT_EQ(state.last_nm, JointTorques{});
    }
  EXPECT_EQ(state.not_finite, 12u);
}

TEST_F(SafetyGate, ReachesThePeakAndNotMore) {
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(pass(rig, state, {50.0, -50.0, 50.0, -3.0}, dt, out));
  EXPECT_DOUBLE_EQ(out[0], 2.0);
  EXPECT_DOUBLE_EQ(out[1], -2.0);
  EXPECT_DOUBLE_EQ(out[2], 4.0);
  EXPECT_DOUBLE_EQ(out[3], -3.0);
}

TEST_F(SafetyGate, ChangesNoFasterThanTheSlewLimit) {
  JointTorques before{};
  const double values[] = {5.0, -5.0, 0.3, -0.2, 100.0, 0.0};
  for (const double wanted : values)
    for (int i = 0; i < 25; ++i) {
      ASSERT_TRUE(pass(rig, state, {wanted, -wanted, 0.5 * wanted, wanted}, dt, out));
      for (std::size_t k = 0; k < 4; ++k) EXPECT_LE(std::abs(out[k] - before[k]), 0.1 + 1e-12);
      before = out;
    }
  EXPECT_GT(state.limited, 50u);
}

TEST_F(SafetyGate, ValuesOfDrivesThatTheRigDoesNotHaveCannotMatter) {
  rig.kind = rig::Kind::Single;
  out = {};
  EXPECT_TRUE(pass(rig, state, {0.1, 0.1, std::numeric_limits<double>::quiet_NaN(), 7.0}, dt, out));
  EXPECT_EQ(out, (JointTorques{0.1, 0.1, 0.0, 0.0}));
}

}  // namespace
}  // namespace trocar::safety
