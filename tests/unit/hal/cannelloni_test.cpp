#include "hal/can/cannelloni.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

namespace trocar::hal::cannelloni {
namespace {

using Bytes = std::vector<std::uint8_t>;

// Written by hand from the format's description: 181h with 3 bytes, a remote 702h of length 1, an extended 12345678h.
const Bytes three_frames{0x02, 0x00, 0x2A, 0x00, 0x03,                    //
                         0x00, 0x00, 0x01, 0x81, 0x03, 0xDE, 0xAD, 0xBE,  //
                         0x40, 0x00, 0x07, 0x02, 0x01,                    //
                         0x92, 0x34, 0x56, 0x78, 0x02, 0x11, 0x22};

std::vector<CanFrame> frames_of_three() {
  CanFrame data{.id = 0x181, .length = 3};
  data.data = {0xDE, 0xAD, 0xBE};
  CanFrame remote{.id = 0x702, .length = 1};
  remote.remote = true;
  CanFrame extended{.id = 0x12345678, .length = 2};
  extended.extended = true;
  extended.data = {0x11, 0x22};
  return {data, remote, extended};
}

TEST(Cannelloni, WritesTheBytesOfTheFormat) {
  Writer writer;
  for (const CanFrame& frame : frames_of_three()) ASSERT_TRUE(writer.append(frame));
  const auto datagram = writer.finish(0x2A);
  EXPECT_EQ(Bytes(datagram.begin(), datagram.end()), three_frames);
}

TEST(Cannelloni, ReadsTheBytesOfTheFormat) {
  Reader reader;
  ASSERT_TRUE(reader.open(three_frames));
  EXPECT_EQ(reader.sequence(), 0x2A);
  CanFrame frame;
  for (const CanFrame& expected : frames_of_three()) {
    ASSERT_TRUE(reader.next(frame));
    EXPECT_EQ(frame, expected);
  }
  EXPECT_FALSE(reader.next(frame));
}

TEST(Cannelloni, KeepsErrorReports) {
  Reader reader;
  const Bytes bus_off{0x02, 0x00, 0x00, 0x00, 0x01, 0x20, 0x00, 0x00, 0x40, 0x08, 0, 0, 0, 0, 0, 0, 0, 0};
  ASSERT_TRUE(reader.open(bus_off));
  CanFrame frame;
  ASSERT_TRUE(reader.next(frame));
  EXPECT_TRUE(frame.error);
  EXPECT_EQ(frame.id, 0x40u);
}

TEST(Cannelloni, LeavesOutCanFdFramesAndTellsSo) {
  // CAN FD: length with bit 7, then a flags byte; 12 data bytes. A classic frame follows.
  Bytes bytes{0x02, 0x00, 0x00, 0x00, 0x02, 0x00, 0x00, 0x01, 0x00, 0x8C, 0x01};
  bytes.resize(bytes.size() + 12, 0xEE);
  bytes.insert(bytes.end(), {0x00, 0x00, 0x00, 0x80, 0x00});
  Reader reader;
  ASSERT_TRUE(reader.open(bytes));
  EXPECT_EQ(reader.unsupported(), 1u);
  CanFrame frame;
  ASSERT_TRUE(reader.next(frame));
  EXPECT_EQ(frame, CanFrame{.id = 0x80});
  EXPECT_FALSE(reader.next(frame));
}

TEST(Cannelloni, RefusesDamagedDatagramsAsAWhole) {
  Reader reader;
  CanFrame frame;
  const auto refused = [&](const Bytes& bytes) { return !reader.open(bytes) && !reader.next(frame); };
  for (std::size_t size = 0; size < three_frames.size(); ++size)
    EXPECT_TRUE(refused(Bytes(three_frames.begin(), three_frames.begin() + static_cast<std::ptrdiff_t>(size)))) << "cut to " << size;
  Bytes bytes = three_frames;
  bytes.push_back(0);
  EXPECT_TRUE(refused(bytes)) << "bytes left over";
  bytes = three_frames;
  bytes[0] = 1;
  EXPECT_TRUE(refused(bytes)) << "foreign version";
  bytes = three_frames;
  bytes[1] = 1;
  EXPECT_TRUE(refused(bytes)) << "not data";
  bytes = three_frames;
  bytes[9] = 9;
  EXPECT_TRUE(refused(bytes)) << "no classic frame has nine bytes";
  bytes = three_frames;
  bytes[7] = 0x08;
  EXPECT_TRUE(refused(bytes)) << "12-bit identifier without the extended flag";
}

TEST(Cannelloni, SurvivesNoise) {
  std::mt19937 random{3};
  Reader reader;
  CanFrame frame;
  std::size_t accepted = 0;
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes = three_frames;
    const std::size_t flips = 1 + random() % 3;
    for (std::size_t k = 0; k < flips; ++k) bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    if (!reader.open(bytes)) continue;
    ++accepted;
    while (reader.next(frame)) ASSERT_LE(frame.length, 8);
  }
  EXPECT_GT(accepted, 0u);
}

TEST(Cannelloni, RefusesMoreThanOneDatagramHolds) {
  Writer writer;
  CanFrame frame{.id = 1, .length = 8};
  std::size_t fitted = 0;
  while (writer.append(frame)) ++fitted;
  EXPECT_EQ(fitted, (max_datagram_bytes - header_bytes) / 13);
  EXPECT_EQ(writer.finish(0).size(), header_bytes + 13 * fitted);
}

}  // namespace
}  // namespace trocar::hal::cannelloni
