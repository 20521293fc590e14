// Lines as candump -L of can-utils writes them; that can-utils reads ours is tried in tests/vcan.
#include "hal/can/candump.hpp"

#include <gtest/gtest.h>

#include <string>

namespace trocar::hal {
namespace {

std::string line(const CanFrame& frame, std::int64_t time_ns = 1'436'509'052'249'713'999) {
  return candump_line(frame, time_ns, "vcan0").data();
}

TEST(Candump, WritesEveryKindOfFrame) {
  CanFrame frame{.id = 0x181, .length = 8};
  frame.data = {0x01, 0xA2, 3, 4, 5, 6, 7, 0xFF};
  EXPECT_EQ(line(frame), "(1436509052.249713) vcan0 181#01A20304050607FF\n");
  EXPECT_EQ(line(CanFrame{.id = 0x080}), "(1436509052.249713) vcan0 080#\n");
  CanFrame extended{.id = 0x1234567, .length = 1};
  extended.extended = true;
  EXPECT_EQ(line(extended), "(1436509052.249713) vcan0 01234567#00\n");
  CanFrame remote{.id = 0x702, .length = 1};
  remote.remote = true;
  EXPECT_EQ(line(remote), "(1436509052.249713) vcan0 702#R1\n");
  remote.length = 0;
  EXPECT_EQ(line(remote, 5'000), "(0000000000.000005) vcan0 702#R\n");
  CanFrame report{.id = 0x40, .length = 8};
  report.error = true;
  EXPECT_EQ(line(report), "(1436509052.249713) vcan0 20000040#0000000000000000\n");
}

TEST(Candump, KeepsTheLongestLineWhole) {
  CanFrame frame{.id = 0x1FFFFFFF, .length = 8};
  frame.extended = true;
  frame.data.fill(0xEE);
  EXPECT_EQ(std::string(candump_line(frame, 4'999'999'999'999'999'999, "fifteen_letters").data()),
            "(4999999999.999999) fifteen_letters 1FFFFFFF#EEEEEEEEEEEEEEEE\n");
}

}  // namespace
}  // namespace trocar::hal
