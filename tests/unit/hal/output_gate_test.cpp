#include "hal/output_gate.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "rig_fixture.hpp"

namespace trocar::hal {
namespace {

// Rated 0.105 N m at the motor; at the joint times 5 * 0.8 = 0.42 N m for drives 0 and 1, 0.84 N m for 2 and 3. Peak: five times that.
struct OutputGateTest : ::testing::Test {
  OutputGate gate{make_test_rig()};
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  static constexpr double infinity = std::numeric_limits<double>::infinity();
};

TEST_F(OutputGateTest, ConvertsToPermilleOfTheMotorsRatedTorque) {
  EXPECT_EQ(gate.pass({0.42, -0.42, 0.42, 0.0}, true), (TorqueWords{1000, -1000, 500, 0}));
  EXPECT_NEAR(gate.joint_torque_nm(2, 500), 0.42, 1e-12);
  EXPECT_EQ(gate.counters().clamped, 0u);
}

TEST_F(OutputGateTest, ClampsAtThePeakAndCounts) {
  EXPECT_EQ(gate.pass({2.1, -2.1, 4.2, 0.0}, true), (TorqueWords{5000, -5000, 5000, 0}));
  EXPECT_EQ(gate.counters().clamped, 0u);
  EXPECT_EQ(gate.pass({2.2, -1e300, 1e300, 0.0}, true), (TorqueWords{5000, -5000, 5000, 0}));
  EXPECT_EQ(gate.counters().clamped, 3u);
}

TEST_F(OutputGateTest, OneValueThatIsNotFiniteZeroesAll) {
  for (const double bad : {nan, infinity, -infinity}) EXPECT_EQ(gate.pass({0.42, 0.42, bad, 0.42}, true), TorqueWords{});
  EXPECT_EQ(gate.counters().not_finite, 3u);
}

TEST_F(OutputGateTest, PassesNothingWhileClosed) {
  EXPECT_EQ(gate.pass({0.42, 0, 0, 0}, false), TorqueWords{});
  EXPECT_EQ(gate.pass({}, false), TorqueWords{});
  EXPECT_EQ(gate.counters().closed, 1u);
}

TEST_F(OutputGateTest, IgnoresWordsOfDrivesThatTheRigDoesNotHave) {
  OutputGate single{make_test_rig(rig::Kind::Single)};
  EXPECT_EQ(single.pass({0.42, 0.42, 0.42, nan}, true), (TorqueWords{1000, 1000, 0, 0}));
}

TEST_F(OutputGateTest, WordNeverOverflowsWhateverThePeak) {
  rig::Rig rig = make_test_rig();
  rig.actuation.peak_current_a = 1e6;
  OutputGate wide{rig};
  EXPECT_EQ(wide.pass({1e9, -1e9, 0, 0}, true), (TorqueWords{32767, -32767, 0, 0}));
}

TEST_F(OutputGateTest, FrameHasOneLittleEndianWordADrive) {
  const CanFrame frame = torque_frame({1, -2, 0x1234, -32768});
  EXPECT_EQ(frame.id, 0x200u);
  EXPECT_EQ(frame.length, 8);
  EXPECT_EQ(frame.data, (std::array<std::uint8_t, 8>{0x01, 0x00, 0xFE, 0xFF, 0x34, 0x12, 0x00, 0x80}));
}

}  // namespace
}  // namespace trocar::hal
