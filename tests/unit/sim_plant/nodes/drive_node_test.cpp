// The simulated drive alone, spoken to with frames written by hand from CiA 301 and CiA 402.
#include "sim_plant/nodes/drive_node.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

namespace trocar::sim_plant {
namespace {

using hal::CanFrame;
using hal::canopen::DriveState;
using hal::canopen::NmtState;
constexpr std::int64_t ms = 1'000'000;

CanFrame make(std::uint32_t id, std::initializer_list<std::uint8_t> bytes) {
  CanFrame frame{.id = id, .length = static_cast<std::uint8_t>(bytes.size())};
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  return frame;
}

struct DriveNodeTest : ::testing::Test {
  // Node 2; rated 0.1 N m and peak 0.3 N m at the motor, gear 10, efficiency 0.8.
  DriveNode node{{.node = 2,
                  .encoder_counts_per_turn = 16000,
                  .position_offset_counts = 500,
                  .rated_torque_nm = 0.1,
                  .peak_torque_nm = 0.3,
                  .gear_ratio = 10,
                  .gear_efficiency = 0.8}};
  std::int64_t now_ns{};
  CanFrame frame;

  std::optional<CanFrame> answer() {
    CanFrame out;
    return node.transmit(out) ? std::optional{out} : std::nullopt;
  }
  std::optional<CanFrame> ask(const CanFrame& request) {
    node.receive(request, now_ns);
    return answer();
  }
  std::optional<CanFrame> sdo(std::initializer_list<std::uint8_t> bytes) { return ask(make(0x602, bytes)); }
  void expect_ok(std::initializer_list<std::uint8_t> bytes) {
    const auto a = sdo(bytes);
    ASSERT_TRUE(a);
    EXPECT_EQ(a->id, 0x582u);
    EXPECT_EQ(a->data[0], 0x60) << std::hex << hal::load<std::uint32_t>(*a, 4);
  }
  std::uint32_t abort_code(std::initializer_list<std::uint8_t> bytes) {
    const auto a = sdo(bytes);
    return a && a->data[0] == 0x80 ? hal::load<std::uint32_t>(*a, 4) : 0;
  }
  void boot() {
    node.advance(now_ns);
    ASSERT_EQ(answer(), make(0x702, {0x00}));
  }
  // As a master would, by hand: own torque word is the second, feedback of position, torque, statusword.
  void configure() {
    boot();
    expect_ok({0x23, 0x16, 0x10, 0x01, 60, 0, 127, 0});
    expect_ok({0x2B, 0x07, 0x60, 0, 1, 0, 0, 0});
    expect_ok({0x2F, 0x60, 0x60, 0, 10, 0, 0, 0});
    expect_ok({0x23, 0x00, 0x14, 1, 0x00, 0x02, 0, 0x80});
    expect_ok({0x2F, 0x00, 0x14, 2, 1, 0, 0, 0});
    expect_ok({0x2B, 0x00, 0x14, 5, 20, 0, 0, 0});
    expect_ok({0x2F, 0x00, 0x16, 0, 0, 0, 0, 0});
    expect_ok({0x23, 0x00, 0x16, 1, 0x10, 0, 0x03, 0});
    expect_ok({0x23, 0x00, 0x16, 2, 0x10, 0, 0x71, 0x60});
    expect_ok({0x2F, 0x00, 0x16, 0, 2, 0, 0, 0});
    expect_ok({0x23, 0x00, 0x14, 1, 0x00, 0x02, 0, 0});
    expect_ok({0x23, 0x01, 0x16, 1, 0x10, 0, 0x40, 0x60});
    expect_ok({0x2F, 0x01, 0x16, 0, 1, 0, 0, 0});
    expect_ok({0x23, 0x01, 0x14, 1, 0x02, 0x03, 0, 0});
    expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0xC0});
    expect_ok({0x2F, 0x00, 0x18, 2, 1, 0, 0, 0});
    expect_ok({0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0});
    expect_ok({0x23, 0x00, 0x1A, 1, 0x20, 0, 0x64, 0x60});
    expect_ok({0x23, 0x00, 0x1A, 2, 0x10, 0, 0x77, 0x60});
    expect_ok({0x23, 0x00, 0x1A, 3, 0x10, 0, 0x41, 0x60});
    expect_ok({0x2F, 0x00, 0x1A, 0, 3, 0, 0, 0});
    expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0x40});
    node.receive(make(0x000, {0x01, 2}), now_ns);
    ASSERT_EQ(node.nmt_state(), NmtState::Operational);
  }
  void control(std::uint8_t word) { node.receive(make(0x302, {word, 0}), now_ns); }
  std::optional<CanFrame> sync() { return ask(make(0x080, {})); }
  void torque(std::int16_t permille) {
    const auto bits = static_cast<std::uint16_t>(permille);
    node.receive(make(0x200, {0x11, 0x11, static_cast<std::uint8_t>(bits), static_cast<std::uint8_t>(bits >> 8), 0, 0, 0, 0}), now_ns);
  }
  void enable() {
    configure();
    for (const int word : {0x06, 0x07, 0x0F}) control(static_cast<std::uint8_t>(word));
    ASSERT_EQ(node.state(), DriveState::OperationEnabled);
  }
};

TEST_F(DriveNodeTest, SaysThatItHasBootedAndAnswersOnlyThen) {
  EXPECT_FALSE(sdo({0x40, 0x00, 0x10, 0, 0, 0, 0, 0}));
  boot();
  EXPECT_EQ(node.nmt_state(), NmtState::PreOperational);
  EXPECT_EQ(sdo({0x40, 0x00, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x43, 0x00, 0x10, 0, 0x92, 0x01, 0x02, 0x00}));
  EXPECT_EQ(sdo({0x40, 0x76, 0x60, 0, 0, 0, 0, 0}), make(0x582, {0x43, 0x76, 0x60, 0, 100, 0, 0, 0}));
}

TEST_F(DriveNodeTest, RefusesWithTheStandardsAbortCodes) {
  boot();
  EXPECT_EQ(abort_code({0x40, 0x34, 0x12, 0, 0, 0, 0, 0}), 0x06020000u);           // no such object
  EXPECT_EQ(abort_code({0x40, 0x18, 0x10, 9, 0, 0, 0, 0}), 0x06090011u);           // no such subindex
  EXPECT_EQ(abort_code({0x23, 0x00, 0x10, 0, 0, 0, 0, 0}), 0x06010002u);           // read-only
  EXPECT_EQ(abort_code({0x2F, 0x17, 0x10, 0, 10, 0, 0, 0}), 0x06070010u);          // one byte for two
  EXPECT_EQ(abort_code({0x21, 0x17, 0x10, 0, 9, 0, 0, 0}), 0x06070010u);           // nine bytes for two, in segments
  EXPECT_EQ(abort_code({0x2F, 0x60, 0x60, 0, 8, 0, 0, 0}), 0x06090030u);           // a mode that it does not have
  EXPECT_EQ(abort_code({0x2B, 0x72, 0x60, 0, 0xB9, 0x0B, 0, 0}), 0x06090030u);     // 3001 permille, beyond its peak
  EXPECT_EQ(abort_code({0x2F, 0x00, 0x14, 2, 241, 0, 0, 0}), 0x06090030u);         // reserved transmission type
  EXPECT_EQ(abort_code({0x23, 0x01, 0x14, 1, 0x02, 0x06, 0, 0}), 0x06090030u);     // an SDO's identifier
  EXPECT_EQ(abort_code({0x23, 0x01, 0x14, 1, 0x02, 0x03, 0, 0x20}), 0x06090030u);  // 29 bits
  EXPECT_EQ(abort_code({0x23, 0x05, 0x10, 0, 0x80, 0, 0, 0x40}), 0x06090030u);     // no SYNC producer
  EXPECT_EQ(abort_code({0xA0, 0x08, 0x10, 0, 0x20, 0, 0, 0}), 0x05040001u);        // block upload
  EXPECT_EQ(abort_code({0xC6, 0x03, 0x64, 0, 0x20, 0, 0, 0}), 0x05040001u);        // block download
  EXPECT_EQ(abort_code({0xE0, 0, 0, 0, 0, 0, 0, 0}), 0x05040001u);                 // no such command
  EXPECT_EQ(abort_code({0x60, 0, 0, 0, 0, 0, 0, 0}), 0x05040001u);                 // a segment of nothing
  EXPECT_EQ(node.counters().sdo_aborts, 15u);
}

TEST_F(DriveNodeTest, MapsByTheStandardsProcedureOnly) {
  boot();
  EXPECT_EQ(sdo({0x40, 0x00, 0x1A, 0, 0, 0, 0, 0}), make(0x582, {0x4F, 0x00, 0x1A, 0, 1, 0, 0, 0}));  // CiA 402: statusword at power-on
  EXPECT_EQ(sdo({0x40, 0x00, 0x1A, 1, 0, 0, 0, 0}), make(0x582, {0x43, 0x00, 0x1A, 1, 0x10, 0x00, 0x41, 0x60}));
  EXPECT_EQ(abort_code({0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0}), 0x08000022u);     // switch the PDO off first
  EXPECT_EQ(abort_code({0x23, 0x00, 0x18, 1, 0x83, 1, 0, 0}), 0x08000022u);  // another identifier: the same
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0x80});
  EXPECT_EQ(abort_code({0x23, 0x00, 0x1A, 1, 0x20, 0, 0x64, 0x60}), 0x08000022u);  // empty the mapping first
  expect_ok({0x2F, 0x00, 0x1A, 0, 0, 0, 0, 0});
  EXPECT_EQ(abort_code({0x23, 0x00, 0x1A, 1, 0x20, 0, 0x00, 0x50}), 0x06020000u);  // no such object
  EXPECT_EQ(abort_code({0x23, 0x00, 0x1A, 1, 0x20, 0, 0x00, 0x10}), 0x06040041u);  // not mappable
  EXPECT_EQ(abort_code({0x23, 0x00, 0x1A, 1, 0x08, 0, 0x64, 0x60}), 0x06040041u);  // a part of it
  EXPECT_EQ(abort_code({0x23, 0x01, 0x16, 1, 0x10, 0, 0x41, 0x60}), 0x06040041u);  // a statusword cannot be commanded
  EXPECT_EQ(abort_code({0x23, 0x01, 0x1A, 1, 0x10, 0, 0x03, 0x00}), 0x06020000u);  // nor a place holder be sent
  expect_ok({0x23, 0x00, 0x1A, 1, 0x20, 0, 0x64, 0x60});
  expect_ok({0x23, 0x00, 0x1A, 2, 0x20, 0, 0x64, 0x60});
  expect_ok({0x23, 0x00, 0x1A, 3, 0x10, 0, 0x41, 0x60});
  EXPECT_EQ(abort_code({0x2F, 0x00, 0x1A, 0, 3, 0, 0, 0}), 0x06040042u);  // ten bytes
  expect_ok({0x2F, 0x00, 0x1A, 0, 2, 0, 0, 0});
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0});
}

TEST_F(DriveNodeTest, GivesATextInSegments) {
  boot();
  // 1008h: "trocar simulated drive", 22 characters in four segments
  EXPECT_EQ(sdo({0x40, 0x08, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x41, 0x08, 0x10, 0, 22, 0, 0, 0}));
  EXPECT_EQ(sdo({0x60, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x00, 't', 'r', 'o', 'c', 'a', 'r', ' '}));
  EXPECT_EQ(sdo({0x70, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x10, 's', 'i', 'm', 'u', 'l', 'a', 't'}));
  EXPECT_EQ(sdo({0x60, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x00, 'e', 'd', ' ', 'd', 'r', 'i', 'v'}));
  EXPECT_EQ(sdo({0x70, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x1D, 'e', 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(abort_code({0x60, 0, 0, 0, 0, 0, 0, 0}), 0x05040001u);                                      // it has ended
  EXPECT_EQ(sdo({0x40, 0x0A, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x4F, 0x0A, 0x10, 0, '1', 0, 0, 0}));  // short enough for one frame
}

TEST_F(DriveNodeTest, TakesSegmentsOfAnyLength) {
  boot();
  EXPECT_EQ(sdo({0x21, 0x03, 0x64, 0, 9, 0, 0, 0}), make(0x582, {0x60, 0x03, 0x64, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x00, 'E', 'C', '-', 'm', 'a', 'x', ' '}), make(0x582, {0x20, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x1B, '4', '0', 0, 0, 0, 0, 0}), make(0x582, {0x30, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x40, 0x03, 0x64, 0, 0, 0, 0, 0}), make(0x582, {0x41, 0x03, 0x64, 0, 9, 0, 0, 0}));
  EXPECT_EQ(sdo({0x60, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x00, 'E', 'C', '-', 'm', 'a', 'x', ' '}));
  EXPECT_EQ(sdo({0x70, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x1B, '4', '0', 0, 0, 0, 0, 0}));
  // Two bytes of a number, the size not stated
  EXPECT_EQ(sdo({0x20, 0x17, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x60, 0x17, 0x10, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x0B, 100, 0, 0, 0, 0, 0, 0}), make(0x582, {0x20, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x40, 0x17, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x4B, 0x17, 0x10, 0, 100, 0, 0, 0}));
}

TEST_F(DriveNodeTest, EndsASegmentedTransferThatGoesWrong) {
  boot();
  sdo({0x40, 0x08, 0x10, 0, 0, 0, 0, 0});
  EXPECT_EQ(abort_code({0x70, 0, 0, 0, 0, 0, 0, 0}), 0x05030000u);  // the first toggle bit is 0
  sdo({0x40, 0x08, 0x10, 0, 0, 0, 0, 0});
  sdo({0x60, 0, 0, 0, 0, 0, 0, 0});
  EXPECT_EQ(sdo({0x60, 0, 0, 0, 0, 0, 0, 0}), make(0x582, {0x80, 0x08, 0x10, 0, 0, 0, 0x03, 0x05}));  // not alternated
  sdo({0x21, 0x03, 0x64, 0, 8, 0, 0, 0});
  EXPECT_EQ(abort_code({0x10, 1, 2, 3, 4, 5, 6, 7}), 0x05030000u);
  sdo({0x21, 0x03, 0x64, 0, 8, 0, 0, 0});
  sdo({0x00, 1, 2, 3, 4, 5, 6, 7});
  EXPECT_EQ(abort_code({0x1B, 8, 9, 0, 0, 0, 0, 0}), 0x06070012u);  // nine bytes come, eight were stated
  sdo({0x21, 0x03, 0x64, 0, 8, 0, 0, 0});
  EXPECT_EQ(abort_code({0x01, 1, 2, 3, 4, 5, 6, 7}), 0x06070013u);         // seven come
  EXPECT_EQ(abort_code({0x21, 0x03, 0x64, 0, 41, 0, 0, 0}), 0x06070012u);  // more than it has room for
  EXPECT_EQ(abort_code({0x21, 0x08, 0x10, 0, 8, 0, 0, 0}), 0x06010002u);   // read-only
  sdo({0x20, 0x17, 0x10, 0, 0, 0, 0, 0});
  EXPECT_EQ(abort_code({0x09, 1, 2, 3, 0, 0, 0, 0}), 0x06070010u);  // three bytes of two
  // The client gives up: nothing is answered, and nothing is left of it.
  sdo({0x40, 0x08, 0x10, 0, 0, 0, 0, 0});
  EXPECT_FALSE(sdo({0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05}));
  EXPECT_EQ(abort_code({0x60, 0, 0, 0, 0, 0, 0, 0}), 0x05040001u);
  EXPECT_EQ(sdo({0x40, 0x03, 0x64, 0, 0, 0, 0, 0}), make(0x582, {0x41, 0x03, 0x64, 0, 0, 0, 0, 0}));  // still empty
}

TEST_F(DriveNodeTest, AbortsTheTransferOfASilentClientAtItsLimitAndNotBefore) {
  boot();
  sdo({0x40, 0x08, 0x10, 0, 0, 0, 0, 0});
  now_ns = 500 * ms;
  sdo({0x60, 0, 0, 0, 0, 0, 0, 0});
  node.advance(1500 * ms - 1);
  EXPECT_FALSE(answer());
  node.advance(1500 * ms);
  EXPECT_EQ(answer(), make(0x582, {0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05}));
  node.advance(9000 * ms);
  EXPECT_FALSE(answer());
}

TEST_F(DriveNodeTest, TellsItsStatuswordOnEventAsItComesFromTheBox) {
  boot();
  node.receive(make(0x000, {0x01, 2}), now_ns);
  node.advance(now_ns);
  EXPECT_EQ(answer(), make(0x182, {0x50, 0x02}));  // on becoming operational
  node.receive(make(0x202, {0x06, 0x00}), now_ns);
  node.advance(++now_ns);
  EXPECT_EQ(answer(), make(0x182, {0x31, 0x02}));  // Ready to switch on
  node.advance(++now_ns);
  EXPECT_FALSE(answer());
  expect_ok({0x2B, 0x00, 0x18, 5, 10, 0, 0, 0});  // and every 10 ms
  node.advance(now_ns);
  EXPECT_EQ(answer(), make(0x182, {0x31, 0x02}));
  node.advance(now_ns + 10 * ms - 1);
  EXPECT_FALSE(answer());
  node.advance(now_ns += 10 * ms);
  EXPECT_EQ(answer(), make(0x182, {0x31, 0x02}));
}

TEST_F(DriveNodeTest, WaitsForTheInhibitTimeBetweenEvents) {
  boot();
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0xC0});
  expect_ok({0x2B, 0x00, 0x18, 3, 50, 0, 0, 0});  // 5 ms
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0x40});
  node.receive(make(0x000, {0x01, 2}), now_ns);
  node.advance(0);
  EXPECT_TRUE(answer());
  node.receive(make(0x202, {0x06, 0x00}), now_ns);
  node.advance(5 * ms - 1);
  EXPECT_FALSE(answer());
  node.advance(5 * ms);
  EXPECT_EQ(answer(), make(0x182, {0x31, 0x02}));
}

TEST_F(DriveNodeTest, AnswersRemoteFramesOfItsTpdosWhereTheyAreAllowed) {
  boot();
  CanFrame remote{.id = 0x182, .length = 2};
  remote.remote = true;
  node.receive(make(0x000, {0x01, 2}), now_ns);
  node.advance(now_ns);
  EXPECT_TRUE(answer());
  EXPECT_FALSE(ask(remote));  // bit 30 is set at power-on
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0x00});
  EXPECT_EQ(ask(remote), make(0x182, {0x50, 0x02}));
}

TEST_F(DriveNodeTest, GuardsAndIsGuarded) {
  boot();
  CanFrame remote{.id = 0x702, .length = 1};
  remote.remote = true;
  EXPECT_EQ(ask(remote), make(0x702, {0x7F}));
  EXPECT_EQ(ask(remote), make(0x702, {0xFF}));  // the toggle bit
  EXPECT_EQ(ask(remote), make(0x702, {0x7F}));
  expect_ok({0x2B, 0x0C, 0x10, 0, 20, 0, 0, 0});
  expect_ok({0x2F, 0x0D, 0x10, 0, 3, 0, 0, 0});
  node.receive(make(0x000, {0x01, 2}), 0);
  node.receive(make(0x000, {0x01, 2}), 0);
  node.advance(60 * ms - 1);
  EXPECT_EQ(node.nmt_state(), NmtState::Operational);
  node.advance(60 * ms);
  EXPECT_EQ(node.nmt_state(), NmtState::PreOperational);
  EXPECT_EQ(node.counters().heartbeats_lost, 1u);
  while (answer()) {
  }
  expect_ok({0x2B, 0x17, 0x10, 0, 20, 0, 0, 0});
  EXPECT_FALSE(ask(remote));  // heartbeats take its place
}

TEST_F(DriveNodeTest, RemembersItsErrorsLastOneFirst) {
  boot();
  EXPECT_EQ(sdo({0x40, 0x03, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x4F, 0x03, 0x10, 0, 0, 0, 0, 0}));
  EXPECT_EQ(abort_code({0x40, 0x03, 0x10, 1, 0, 0, 0, 0}), 0x08000024u);
  for (const int code : {0x2310, 0x4210, 0x7300, 0x8611, 0x3210}) {
    node.trigger_fault(static_cast<std::uint16_t>(code));
    EXPECT_TRUE(answer());
    for (const int word : {0, 0x80}) expect_ok({0x2B, 0x40, 0x60, 0, static_cast<std::uint8_t>(word), 0, 0, 0});
    EXPECT_TRUE(answer());  // error reset
  }
  EXPECT_EQ(sdo({0x40, 0x03, 0x10, 0, 0, 0, 0, 0}), make(0x582, {0x4F, 0x03, 0x10, 0, 4, 0, 0, 0}));
  EXPECT_EQ(sdo({0x40, 0x03, 0x10, 1, 0, 0, 0, 0}), make(0x582, {0x43, 0x03, 0x10, 1, 0x10, 0x32, 0, 0}));
  EXPECT_EQ(sdo({0x40, 0x03, 0x10, 4, 0, 0, 0, 0}), make(0x582, {0x43, 0x03, 0x10, 4, 0x10, 0x42, 0, 0}));
  EXPECT_EQ(abort_code({0x2F, 0x03, 0x10, 0, 1, 0, 0, 0}), 0x06090030u);  // only 0 may be written
  expect_ok({0x2F, 0x03, 0x10, 0, 0, 0, 0, 0});
  EXPECT_EQ(abort_code({0x40, 0x03, 0x10, 1, 0, 0, 0, 0}), 0x08000024u);
}

TEST_F(DriveNodeTest, ReactsToALostMasterWithTheStateThatItsErrorBehaviourNames) {
  for (const auto& [behaviour, state] : {std::pair{std::uint8_t{0}, NmtState::PreOperational},
                                         {std::uint8_t{1}, NmtState::Operational},
                                         {std::uint8_t{2}, NmtState::Stopped}}) {
    node.restart();
    now_ns = 0;
    configure();
    expect_ok({0x2F, 0x29, 0x10, 1, behaviour, 0, 0, 0});
    node.receive(make(0x77F, {0x05}), 0);
    node.advance(60 * ms);
    EXPECT_EQ(node.nmt_state(), state);
    while (answer()) {
    }
  }
}

TEST_F(DriveNodeTest, ProducesHeartbeats) {
  boot();
  expect_ok({0x23, 0x00, 0x18, 1, 0x82, 0x01, 0, 0xC0});  // no feedback in between
  expect_ok({0x2B, 0x17, 0x10, 0, 20, 0, 0, 0});
  node.advance(now_ns);
  EXPECT_EQ(answer(), make(0x702, {0x7F}));
  node.advance(19 * ms);
  EXPECT_FALSE(answer());
  node.advance(20 * ms);
  EXPECT_EQ(answer(), make(0x702, {0x7F}));
  node.receive(make(0x000, {0x01, 0}), 20 * ms);  // to all
  node.advance(40 * ms);
  EXPECT_EQ(answer(), make(0x702, {0x05}));
  node.receive(make(0x000, {0x02, 2}), 40 * ms);
  node.advance(60 * ms);
  EXPECT_EQ(answer(), make(0x702, {0x04}));
  node.receive(make(0x000, {0x01, 3}), 60 * ms);  // another node
  EXPECT_EQ(node.nmt_state(), NmtState::Stopped);
}

TEST_F(DriveNodeTest, TellsPositionTorqueAndStatuswordAtTheSync) {
  configure();
  node.set_shaft(-2 * std::numbers::pi - 1e-9, 0.4);  // one turn back and a little: floor
  const auto tpdo = sync();
  // -16001 + 500 = -15501 = FFFFC373h; 0.4 / (10 * 0.8) = 0.05 N m = 500 permille; Switch on disabled
  EXPECT_EQ(tpdo, make(0x182, {0x73, 0xC3, 0xFF, 0xFF, 0xF4, 0x01, 0x50, 0x02}));
  EXPECT_FALSE(answer());
}

TEST_F(DriveNodeTest, EncoderCountsWrapAtThirtyTwoBits) {
  configure();
  node.set_shaft(2 * std::numbers::pi * (std::pow(2.0, 31) / 16000.0) - 1.0, 0);  // 2546 counts short of it, offset 500
  const std::int32_t high = node.position_counts();
  EXPECT_GT(high, 0);
  node.set_shaft(2 * std::numbers::pi * (std::pow(2.0, 31) / 16000.0) + 0.1, 0);
  EXPECT_LT(node.position_counts(), 0);
  node.set_shaft(std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity());
  EXPECT_LT(node.position_counts(), 0);
}

TEST_F(DriveNodeTest, WalksThroughItsStates) {
  configure();
  const auto status = [&] { return hal::load<std::uint16_t>(*sync(), 6) & 0x6F; };
  control(0x0F);  // not from here
  EXPECT_EQ(status(), 0x40);
  control(0x06);
  EXPECT_EQ(status(), 0x21);
  control(0x07);
  EXPECT_EQ(status(), 0x23);
  control(0x0F);
  EXPECT_EQ(status(), 0x27);
  control(0x07);
  EXPECT_EQ(status(), 0x23);
  control(0x06);
  EXPECT_EQ(status(), 0x21);
  control(0x00);
  EXPECT_EQ(status(), 0x40);
}

TEST_F(DriveNodeTest, QuickStopIsVisibleThenEndsByItself) {
  enable();
  torque(500);
  sync();
  EXPECT_GT(node.motor_torque_nm(), 0.0);
  control(0x02);
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  EXPECT_EQ(hal::load<std::uint16_t>(*sync(), 6) & 0x6F, 0x07);
  EXPECT_EQ(hal::load<std::uint16_t>(*sync(), 6) & 0x4F, 0x40);
}

TEST_F(DriveNodeTest, TorqueIsItsOwnWordAppliedAtTheSyncWithinThePeak) {
  enable();
  torque(500);
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  sync();
  EXPECT_NEAR(node.motor_torque_nm(), 0.05, 1e-15);
  torque(-32768);
  sync();
  EXPECT_NEAR(node.motor_torque_nm(), -0.3, 1e-15);
  sync();  // no new frame: the value stands, until the watch ends it
  EXPECT_NEAR(node.motor_torque_nm(), -0.3, 1e-15);
}

TEST_F(DriveNodeTest, EnablingStartsFromZeroTorque) {
  configure();
  control(0x06);
  control(0x07);
  torque(500);
  sync();
  torque(600);
  control(0x0F);
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  sync();
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
}

TEST_F(DriveNodeTest, FaultsWhenTorqueFramesStopAtTheLimitAndNotBefore) {
  enable();
  now_ns = 5 * ms;
  torque(500);
  sync();
  node.advance(25 * ms - 1);
  EXPECT_EQ(node.state(), DriveState::OperationEnabled);
  EXPECT_GT(node.motor_torque_nm(), 0.0);
  node.advance(25 * ms);
  EXPECT_EQ(node.state(), DriveState::Fault);
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  EXPECT_EQ(answer(), make(0x082, {0x50, 0x82, 0x11, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo({0x40, 0x3F, 0x60, 0, 0, 0, 0, 0}), make(0x582, {0x4B, 0x3F, 0x60, 0, 0x50, 0x82, 0, 0}));
}

TEST_F(DriveNodeTest, AFaultOfItsWatchdogsStaysWhenTheFramesComeBack) {
  for (const bool heartbeat : {false, true}) {
    node.restart();
    now_ns = 0;
    enable();
    if (heartbeat) {
      node.receive(make(0x77F, {0x05}), 0);
      now_ns = 55 * ms;
      torque(500);
    }
    node.advance(heartbeat ? 60 * ms : 20 * ms + 1);
    ASSERT_EQ(node.state(), DriveState::Fault);
    for (now_ns = 61 * ms; now_ns < 1000 * ms; now_ns += ms) {
      node.receive(make(0x77F, {0x05}), now_ns);
      node.receive(make(0x000, {0x01, 2}), now_ns);  // as a master would that starts it again
      torque(500);
      sync();
      control(0x0F);
      node.advance(now_ns);
      ASSERT_EQ(node.state(), DriveState::Fault);
      ASSERT_EQ(node.motor_torque_nm(), 0.0);
    }
    control(0x80);  // an explicit reset leads out of it, and no torque comes with it
    EXPECT_EQ(node.state(), DriveState::SwitchOnDisabled);
    EXPECT_EQ(node.motor_torque_nm(), 0.0);
    while (answer()) {
    }
  }
}

TEST_F(DriveNodeTest, DoesNotMissTorqueFramesWhileDisabled) {
  configure();
  node.advance(1000 * ms);
  EXPECT_EQ(node.state(), DriveState::SwitchOnDisabled);
  EXPECT_FALSE(answer());
}

TEST_F(DriveNodeTest, LosesItsMasterAtTheHeartbeatTimeoutAndNotBefore) {
  for (const std::int64_t late_ns : {std::int64_t{-1}, std::int64_t{0}, std::int64_t{1}}) {
    node.restart();
    now_ns = 0;
    enable();
    node.receive(make(0x77F, {0x05}), 0);
    now_ns = 55 * ms;  // torque frames still come
    torque(500);
    sync();
    node.advance(60 * ms + late_ns);
    EXPECT_EQ(node.state(), late_ns < 0 ? DriveState::OperationEnabled : DriveState::Fault) << late_ns;
    EXPECT_EQ(node.motor_torque_nm() == 0.0, late_ns >= 0);
    EXPECT_EQ(node.nmt_state(), late_ns < 0 ? NmtState::Operational : NmtState::PreOperational);
    while (answer()) {
    }
  }
}

TEST_F(DriveNodeTest, WatchesItsMasterOnlyFromTheFirstHeartbeatOn) {
  configure();
  node.advance(1000 * ms);
  EXPECT_EQ(node.nmt_state(), NmtState::Operational);
  node.receive(make(0x77E, {0x05}), 1000 * ms);  // not the master
  node.advance(2000 * ms);
  EXPECT_EQ(node.nmt_state(), NmtState::Operational);
}

TEST_F(DriveNodeTest, ReactsToALostMasterAsItsOptionSays) {
  struct Case {
    std::uint8_t option;
    DriveState state;
  };
  for (const Case& c : {Case{0, DriveState::OperationEnabled}, Case{1, DriveState::Fault}, Case{2, DriveState::SwitchOnDisabled},
                        Case{3, DriveState::QuickStopActive}}) {
    node.restart();
    now_ns = 0;
    enable();
    expect_ok({0x2B, 0x07, 0x60, 0, c.option, 0, 0, 0});
    node.receive(make(0x77F, {0x05}), 0);
    now_ns = 50 * ms;
    torque(0);
    node.advance(60 * ms);
    EXPECT_EQ(node.state(), c.state) << int{c.option};
    EXPECT_EQ(answer(), make(0x082, {0x30, 0x81, 0x11, 0, 0, 0, 0, 0}));
  }
}

TEST_F(DriveNodeTest, LeavingOperationalWhileEnabledIsAFault) {
  enable();
  torque(500);
  sync();
  node.receive(make(0x000, {0x80, 2}), now_ns);
  EXPECT_EQ(node.state(), DriveState::Fault);
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  EXPECT_EQ(node.nmt_state(), NmtState::PreOperational);
}

TEST_F(DriveNodeTest, FaultIsResetByARisingEdgeOnly) {
  enable();
  control(0x80);  // bit 7 is up before the fault comes
  node.trigger_fault(0x2310);
  EXPECT_EQ(answer(), make(0x082, {0x10, 0x23, 0x01, 0, 0, 0, 0, 0}));
  control(0x80);
  EXPECT_EQ(node.state(), DriveState::Fault);
  control(0x00);
  EXPECT_EQ(node.state(), DriveState::Fault);
  control(0x80);
  EXPECT_EQ(node.state(), DriveState::SwitchOnDisabled);
  EXPECT_EQ(answer(), make(0x082, {0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST_F(DriveNodeTest, RefusesATorqueFrameThatIsTooShort) {
  enable();
  node.receive(make(0x200, {0, 0, 1}), now_ns);
  EXPECT_EQ(answer(), make(0x082, {0x10, 0x82, 0x11, 0, 0, 0, 0, 0}));
  sync();
  EXPECT_EQ(node.motor_torque_nm(), 0.0);
  EXPECT_EQ(node.counters().rpdo_wrong_length, 1u);
}

TEST_F(DriveNodeTest, ForgetsItsMappingWithACommunicationReset) {
  configure();
  node.receive(make(0x000, {0x82, 2}), now_ns);
  node.advance(now_ns);
  EXPECT_EQ(answer(), make(0x702, {0x00}));
  node.receive(make(0x000, {0x01, 2}), now_ns);
  EXPECT_FALSE(sync());  // the statusword comes on event, as from the box
  EXPECT_EQ(sdo({0x40, 0x00, 0x1A, 0, 0, 0, 0, 0})->data[4], 1);
  EXPECT_EQ(sdo({0x40, 0x60, 0x60, 0, 0, 0, 0, 0})->data[4], 10);  // 6060h is no communication object
}

}  // namespace
}  // namespace trocar::sim_plant
