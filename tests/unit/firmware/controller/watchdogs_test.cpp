// Every watchdog of the controller just below, at and above its limit, on a clock that is a number, and that what it latched stays when
// its cause has gone. (The wire's: hal/master_test, hal/arming_gate_test. The drives' own: sim_plant/nodes/drive_node_test.)
#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "fake_rig.hpp"

namespace trocar::controller {
namespace {

struct Dog {
  const char* name;
  Fault fault;  // None: Hold without a fault
  int limit_ticks;
  std::function<void(FakeRig&, bool silent)> silence;
};

struct Watchdog : ::testing::TestWithParam<Dog> {};

TEST_P(Watchdog, BarksAboveItsLimitOnlyAndWhatItDidStays) {
  const Dog& dog = GetParam();
  for (const int past : {-1, 0, 1}) {
    SCOPED_TRACE(past);
    FakeRig f;
    f.positioned();
    dog.silence(f, true);
    f.tick(dog.limit_ticks + past);
    dog.silence(f, false);
    f.tick(500);
    const bool barks = past > 0;
    EXPECT_EQ(f.fault(), barks ? dog.fault : Fault::None) << to_string(f.fault());
    EXPECT_EQ(f.mode(), !barks ? Mode::Position : dog.fault == Fault::None ? Mode::Hold : Mode::Fault);
    EXPECT_EQ(f.count(EventKind::FaultLatched), barks && dog.fault != Fault::None ? 1u : 0u);
    EXPECT_EQ(f.count(EventKind::HostLost), barks && dog.fault == Fault::None ? 1u : 0u);
  }
}

INSTANTIATE_TEST_SUITE_P(
    All, Watchdog,
    ::testing::Values(Dog{"Host", Fault::None, 80, [](FakeRig& f, bool silent) { f.host_talks = !silent; }},
                      Dog{"Feedback", Fault::FeedbackLost, 20, [](FakeRig& f, bool silent) { f.drives_answer = !silent; }},
                      Dog{"Sensor", Fault::SensorLost, 50, [](FakeRig& f, bool silent) { f.sensor_answers = !silent; }},
                      Dog{"Torque", Fault::TorqueMismatch, 20,
                          [](FakeRig& f, bool silent) { f.torque_error_nm = silent ? 1.001 * f.rig.limits.torque_error_nm : 0.0; }}),
    [](const auto& d) { return std::string(d.param.name); });

TEST(Watchdogs, LateTickBarksAboveItsLimitOnlyAndStays) {
  for (const std::int64_t past_ns : {-1, 0, 1}) {
    FakeRig f;
    f.positioned();
    f.late_ns = 2 * FakeRig::ms + past_ns;
    f.tick();
    f.late_ns = 0;
    f.tick(500);
    EXPECT_EQ(f.fault(), past_ns > 0 ? Fault::LateTick : Fault::None) << past_ns;
    EXPECT_EQ(f.controller->status().ticks_late, past_ns > 0 ? 1u : 0u);
  }
}

TEST(Watchdogs, EnablingBarksAboveItsLimitOnlyAndStays) {
  for (const int past : {-1, 0, 1}) {
    FakeRig f;
    f.homed();
    f.drives_enable = false;
    ASSERT_EQ(f.send(CommandKind::Arm), ReplyCode::Accepted);
    f.tick(1000 + past);
    f.drives_enable = true;
    f.tick(500);
    const bool barks = past > 0;
    EXPECT_EQ(f.fault(), barks ? Fault::DriveFault : Fault::None) << past;
    EXPECT_EQ(f.mode(), barks ? Mode::Fault : Mode::Armed) << past;
    EXPECT_EQ(f.torque_free(), barks);
  }
}

}  // namespace
}  // namespace trocar::controller
