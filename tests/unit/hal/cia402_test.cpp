#include "hal/canopen/cia402.hpp"

#include <gtest/gtest.h>

#include <array>
#include <utility>

namespace trocar::hal::canopen {
namespace {

TEST(Cia402, DecodesStatuswordsOfRealDrives) {
  // As drives send them, with voltage, remote and manufacturer bits set.
  constexpr std::array<std::pair<std::uint16_t, DriveState>, 10> words{{{0x0000, DriveState::NotReady},
                                                                        {0x0250, DriveState::SwitchOnDisabled},
                                                                        {0x0270, DriveState::SwitchOnDisabled},
                                                                        {0x0231, DriveState::ReadyToSwitchOn},
                                                                        {0x0233, DriveState::SwitchedOn},
                                                                        {0x1637, DriveState::OperationEnabled},
                                                                        {0x0217, DriveState::QuickStopActive},
                                                                        {0x021F, DriveState::FaultReaction},
                                                                        {0x0218, DriveState::Fault},
                                                                        {0x0238, DriveState::Fault}}};
  for (const auto& [word, state] : words) EXPECT_EQ(decode_statusword(word), state) << std::hex << word;
  EXPECT_EQ(decode_statusword(0x0201), DriveState::Unknown);
}

TEST(Cia402, WalksToOperationEnabled) {
  const auto word = [](DriveState state) { return next_controlword(state, DriveRequest::Enable, false, 0).word; };
  EXPECT_EQ(word(DriveState::SwitchOnDisabled), 0x06);
  EXPECT_EQ(word(DriveState::ReadyToSwitchOn), 0x07);
  EXPECT_EQ(word(DriveState::SwitchedOn), 0x0F);
  EXPECT_TRUE(next_controlword(DriveState::OperationEnabled, DriveRequest::Enable, false, 0x0F).reached);
  EXPECT_EQ(word(DriveState::QuickStopActive), 0x00);
}

TEST(Cia402, TakesTorqueAwayFromEveryStateThatHasOrMayHaveIt) {
  for (const DriveState state : {DriveState::ReadyToSwitchOn, DriveState::SwitchedOn, DriveState::OperationEnabled}) {
    EXPECT_EQ(next_controlword(state, DriveRequest::Disable, false, 0x0F).word & 0x02, 0x00);  // enable voltage off
    EXPECT_FALSE(next_controlword(state, DriveRequest::Disable, false, 0x0F).reached);
    EXPECT_EQ(next_controlword(state, DriveRequest::QuickStop, false, 0x0F).word & 0x06, 0x02);  // quick stop is active low
    EXPECT_FALSE(next_controlword(state, DriveRequest::QuickStop, false, 0x0F).reached);
  }
  EXPECT_TRUE(next_controlword(DriveState::SwitchOnDisabled, DriveRequest::Disable, false, 0).reached);
  EXPECT_TRUE(next_controlword(DriveState::QuickStopActive, DriveRequest::QuickStop, false, 0).reached);
}

TEST(Cia402, ResetsAFaultOnlyWhenAskedAndWithARisingEdge) {
  EXPECT_TRUE(next_controlword(DriveState::Fault, DriveRequest::Enable, false, 0x0F).reached);
  EXPECT_EQ(next_controlword(DriveState::Fault, DriveRequest::Enable, true, 0x0F).word, 0x80);
  EXPECT_EQ(next_controlword(DriveState::Fault, DriveRequest::Enable, true, 0x80).word & 0x80, 0);
}

}  // namespace
}  // namespace trocar::hal::canopen
