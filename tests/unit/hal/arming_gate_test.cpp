// The link says Operational, without which the controller arms nobody, only once each drive has shown that it is as it must be: its first
// heartbeat is there, and what it shall do when it loses its master or is asked to stop reads back as written.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "wired_rig.hpp"

namespace trocar::hal {
namespace {

constexpr int bring_up_ticks = 1000;  // twice what it takes

bool comes_up(WiredRig& w) {
  return w.run_until([&] { return w.operational(); }, bring_up_ticks);
}

TEST(ArmingGate, StaysClosedUntilEachDrivesFirstHeartbeat) {
  for (std::size_t silent = 0; silent < 4; ++silent) {
    auto w = std::make_unique<WiredRig>();
    w->from_drive = [&](std::size_t i, CanFrame& frame) { return !(i == silent && frame.id == 0x701 + silent && frame.data[0] == 5); };
    w->command.request = DriveRequest::Enable;
    EXPECT_FALSE(comes_up(*w)) << silent;
    for (const sim_plant::DriveNode& node : w->drive) EXPECT_NE(node.state(), canopen::DriveState::OperationEnabled);
    EXPECT_NE(std::string(w->link.bring_up_step()).find("drive " + std::to_string(silent)), std::string::npos) << w->link.bring_up_step();
    w->from_drive = nullptr;
    EXPECT_TRUE(comes_up(*w)) << silent;
  }
}

struct Setting {
  std::uint16_t index;
  std::uint8_t sub;
  const char* name;
};

TEST(ArmingGate, StaysClosedWhileHeartbeatAbortOrStopSettingsReadBackWrong) {
  std::size_t at = 0;
  for (const Setting& s : {Setting{0x1016, 1, "1016h:01"}, Setting{0x1017, 0, "1017h:00"}, Setting{0x6007, 0, "6007h:00"},
                           Setting{0x605A, 0, "605Ah:00"}, Setting{0x605E, 0, "605Eh:00"}, Setting{0x1400, 5, "1400h:05"}}) {
    const std::size_t wrong = at++ % 4;  // another drive each time
    auto w = std::make_unique<WiredRig>();
    bool met = false;
    w->from_drive = [&](std::size_t i, CanFrame& frame) {
      const bool upload = frame.id == 0x581 + wrong && (frame.data[0] & 0xE0) == 0x40;
      if (i != wrong || !upload || load<std::uint16_t>(frame, 1) != s.index || frame.data[3] != s.sub) return true;
      met = true;
      frame.data[4] ^= 1;
      return true;
    };
    w->command.request = DriveRequest::Enable;
    EXPECT_FALSE(comes_up(*w)) << s.name;
    EXPECT_TRUE(met) << s.name << " is never read back";
    const std::string text = w->link.bring_up_step();
    EXPECT_NE(text.find(s.name), std::string::npos) << text;
    EXPECT_NE(text.find("drive " + std::to_string(wrong)), std::string::npos) << text;
    for (const sim_plant::DriveNode& node : w->drive) EXPECT_EQ(node.motor_torque_nm(), 0.0);
    w->from_drive = nullptr;
    EXPECT_TRUE(comes_up(*w)) << s.name;
  }
}

}  // namespace
}  // namespace trocar::hal
