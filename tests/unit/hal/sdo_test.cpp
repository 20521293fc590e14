// Frames written by hand from CiA 301, 7.2.4.3.
#include "hal/canopen/sdo.hpp"

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>

namespace trocar::hal::canopen {
namespace {

CanFrame bytes(std::uint32_t id, std::array<std::uint8_t, 8> data) { return CanFrame{.id = id, .length = 8, .data = data}; }

TEST(Sdo, DownloadRequestsOfOneToFourBytes) {
  EXPECT_EQ(sdo_download_request(5, {0x6060, 0, 1}, 0x0A), bytes(0x605, {0x2F, 0x60, 0x60, 0x00, 0x0A, 0, 0, 0}));
  EXPECT_EQ(sdo_download_request(5, {0x1017, 0, 2}, 1000), bytes(0x605, {0x2B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0}));
  EXPECT_EQ(sdo_download_request(5, {0x2000, 1, 3}, 0x030201), bytes(0x605, {0x27, 0x00, 0x20, 0x01, 1, 2, 3, 0}));
  EXPECT_EQ(sdo_download_request(5, {0x1600, 1, 4}, 0x60710010), bytes(0x605, {0x23, 0x00, 0x16, 0x01, 0x10, 0x00, 0x71, 0x60}));
  // A negative 16-bit value must not leak into the unused bytes.
  EXPECT_EQ(sdo_download_request(1, {0x6007, 0, 2}, static_cast<std::uint32_t>(-1)),
            bytes(0x601, {0x2B, 0x07, 0x60, 0x00, 0xFF, 0xFF, 0, 0}));
}

TEST(Sdo, UploadRequest) { EXPECT_EQ(sdo_upload_request(3, {0x1000, 0, 4}), bytes(0x603, {0x40, 0x00, 0x10, 0x00, 0, 0, 0, 0})); }

TEST(Sdo, Answers) {
  EXPECT_EQ(sdo_download_answer(5, {0x1017, 0, 2}), bytes(0x585, {0x60, 0x17, 0x10, 0, 0, 0, 0, 0}));
  EXPECT_EQ(sdo_upload_answer(5, {0x6041, 0, 2}, 0x1237), bytes(0x585, {0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0}));
  EXPECT_EQ(sdo_abort(0x585, {0x1234, 5, 0}, 0x06020000), bytes(0x585, {0x80, 0x34, 0x12, 5, 0, 0, 0x02, 0x06}));
}

TEST(Sdo, DecodesRequests) {
  SdoMessage m = decode_sdo_request(bytes(0x605, {0x2B, 0x17, 0x10, 0x00, 0xE8, 0x03, 0xFF, 0xFF}));
  EXPECT_EQ(m.kind, SdoKind::Download);
  EXPECT_EQ(m.object.index, 0x1017);
  EXPECT_EQ(m.object.bytes, 2);
  EXPECT_EQ(m.value, 1000u);
  m = decode_sdo_request(bytes(0x605, {0x22, 0x17, 0x10, 0x00, 0xE8, 0x03, 0, 0}));  // expedited, length not stated
  EXPECT_EQ(m.kind, SdoKind::Download);
  EXPECT_EQ(m.object.bytes, 0);
  EXPECT_EQ(decode_sdo_request(bytes(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0})).kind, SdoKind::Upload);
  EXPECT_EQ(decode_sdo_request(bytes(0x605, {0x21, 0, 0x10, 0, 9, 0, 0, 0})).kind, SdoKind::Other);  // segmented download
  EXPECT_EQ(decode_sdo_request(bytes(0x605, {0x80, 0, 0x10, 0, 0, 0, 4, 5})).kind, SdoKind::Abort);
  CanFrame cut = bytes(0x605, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
  cut.length = 7;
  EXPECT_EQ(decode_sdo_request(cut).kind, SdoKind::None);
}

struct SdoClientTest : ::testing::Test {
  std::optional<CanFrame> next() {
    CanFrame frame;
    return client.next_frame(frame, 0) ? std::optional{frame} : std::nullopt;
  }
  SdoClient client{5};
  static constexpr Object device_name{0x1008, 0, 0};
  static constexpr Object statusword{0x6041, 0, 2};
};

TEST_F(SdoClientTest, ReadsAValue) {
  EXPECT_EQ(client.upload(statusword, 0).id, 0x605u);
  EXPECT_TRUE(client.receive(bytes(0x585, {0x4B, 0x41, 0x60, 0, 0x37, 0x12, 0, 0})));
  EXPECT_EQ(client.state(), SdoClient::State::Done);
  EXPECT_EQ(client.value(), 0x1237u);
}

TEST_F(SdoClientTest, IgnoresWhatIsNotItsAnswer) {
  EXPECT_FALSE(client.receive(bytes(0x585, {0x4B, 0x41, 0x60, 0, 1, 0, 0, 0})));  // nothing asked
  (void)client.upload(statusword, 0);
  EXPECT_FALSE(client.receive(bytes(0x586, {0x4B, 0x41, 0x60, 0, 1, 0, 0, 0})));  // another node
  EXPECT_FALSE(client.receive(bytes(0x585, {0x4B, 0x41, 0x60, 1, 1, 0, 0, 0})));  // another subindex
  EXPECT_EQ(client.state(), SdoClient::State::Waiting);
}

TEST_F(SdoClientTest, TellsTheAbortCode) {
  (void)client.download(statusword, 1, 0);
  EXPECT_TRUE(client.receive(bytes(0x585, {0x80, 0x41, 0x60, 0, 0x02, 0x00, 0x01, 0x06})));
  EXPECT_EQ(client.state(), SdoClient::State::Aborted);
  EXPECT_EQ(client.abort_code(), 0x06010002u);
  EXPECT_STREQ(to_string(static_cast<SdoAbort>(client.abort_code())), "object is read-only");
}

TEST_F(SdoClientTest, RefusesWrongLengths) {
  (void)client.upload(statusword, 0);
  client.receive(bytes(0x585, {0x43, 0x41, 0x60, 0, 1, 2, 3, 4}));
  EXPECT_EQ(client.state(), SdoClient::State::Aborted);
  EXPECT_EQ(next(), bytes(0x605, {0x80, 0x41, 0x60, 0, 0x10, 0x00, 0x07, 0x06}));  // the node hears why
  (void)client.upload(statusword, 0);
  client.receive(bytes(0x585, {0x41, 0x41, 0x60, 0, 9, 0, 0, 0}));
  EXPECT_EQ(client.abort_code(), 0x06070010u);
  (void)client.upload(device_name, 0);
  client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, 65, 0, 0, 0}));
  EXPECT_EQ(client.abort_code(), 0x05040005u);  // beyond its capacity
}

TEST_F(SdoClientTest, ReadsATextInSegments) {
  EXPECT_EQ(client.upload(device_name, 0), bytes(0x605, {0x40, 0x08, 0x10, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(next());
  EXPECT_TRUE(client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, 10, 0, 0, 0})));
  EXPECT_EQ(next(), bytes(0x605, {0x60, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_FALSE(next());
  EXPECT_TRUE(client.receive(bytes(0x585, {0x00, 's', 'e', 'r', 'v', 'o', ' ', 'd'})));
  EXPECT_EQ(client.state(), SdoClient::State::Waiting);
  EXPECT_EQ(next(), bytes(0x605, {0x70, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_TRUE(client.receive(bytes(0x585, {0x19, 'r', 'i', 'v', 0, 0, 0, 0})));
  EXPECT_EQ(client.state(), SdoClient::State::Done);
  EXPECT_FALSE(next());
  EXPECT_EQ(std::string(client.data().begin(), client.data().end()), "servo driv");
}

TEST_F(SdoClientTest, ReadsANumberFromANodeThatPutsItIntoASegment) {
  (void)client.upload(statusword, 0);
  EXPECT_TRUE(client.receive(bytes(0x585, {0x40, 0x41, 0x60, 0, 0, 0, 0, 0})));  // size not stated
  EXPECT_TRUE(next());
  EXPECT_TRUE(client.receive(bytes(0x585, {0x0B, 0x37, 0x12, 0, 0, 0, 0, 0})));
  EXPECT_EQ(client.state(), SdoClient::State::Done);
  EXPECT_EQ(client.value(), 0x1237u);
}

TEST_F(SdoClientTest, WritesALongValueInSegments) {
  const std::array<std::uint8_t, 14> text{'0', '1', '2', '3', '4', '5', '6', '7', '8', '9', 'a', 'b', 'c', 'd'};
  EXPECT_EQ(client.download({0x6403, 0, 0}, text, 0), bytes(0x605, {0x21, 0x03, 0x64, 0, 14, 0, 0, 0}));
  EXPECT_TRUE(client.receive(bytes(0x585, {0x60, 0x03, 0x64, 0, 0, 0, 0, 0})));
  EXPECT_EQ(next(), bytes(0x605, {0x00, '0', '1', '2', '3', '4', '5', '6'}));
  EXPECT_TRUE(client.receive(bytes(0x585, {0x20, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(client.state(), SdoClient::State::Waiting);
  EXPECT_EQ(next(), bytes(0x605, {0x11, '7', '8', '9', 'a', 'b', 'c', 'd'}));
  EXPECT_TRUE(client.receive(bytes(0x585, {0x30, 0, 0, 0, 0, 0, 0, 0})));
  EXPECT_EQ(client.state(), SdoClient::State::Done);
  EXPECT_FALSE(next());
  // Short ones go in one frame.
  EXPECT_EQ(client.download({0x1017, 0, 0}, std::span{text}.first(2), 0), bytes(0x605, {0x2B, 0x17, 0x10, 0, '0', '1', 0, 0}));
}

TEST_F(SdoClientTest, AbortsWhenTheToggleBitStandsStill) {
  (void)client.upload(device_name, 0);
  client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, 20, 0, 0, 0}));
  (void)next();
  client.receive(bytes(0x585, {0x00, 1, 2, 3, 4, 5, 6, 7}));
  (void)next();
  client.receive(bytes(0x585, {0x00, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(client.state(), SdoClient::State::Aborted);
  EXPECT_EQ(next(), bytes(0x605, {0x80, 0x08, 0x10, 0, 0, 0, 0x03, 0x05}));

  const std::array<std::uint8_t, 20> long_value{};
  (void)client.download({0x6403, 0, 0}, long_value, 0);
  client.receive(bytes(0x585, {0x60, 0x03, 0x64, 0, 0, 0, 0, 0}));
  (void)next();
  client.receive(bytes(0x585, {0x30, 0, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(client.abort_code(), 0x05030000u);
}

TEST_F(SdoClientTest, AbortsWhenTheStatedSizeIsNotTheRealOne) {
  for (const auto& [size, code] : {std::pair{std::uint8_t{8}, 0x06070013u}, {std::uint8_t{6}, 0x06070012u}}) {
    (void)client.upload(device_name, 0);
    client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, size, 0, 0, 0}));
    (void)next();
    client.receive(bytes(0x585, {0x01, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_EQ(client.state(), SdoClient::State::Aborted);
    EXPECT_EQ(client.abort_code(), code);
  }
}

TEST_F(SdoClientTest, TakesAnAbortInTheMiddleOfSegments) {
  (void)client.upload(device_name, 0);
  client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, 20, 0, 0, 0}));
  (void)next();
  EXPECT_TRUE(client.receive(bytes(0x585, {0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05})));
  EXPECT_EQ(client.state(), SdoClient::State::Aborted);
  EXPECT_EQ(client.abort_code(), 0x05040000u);
  EXPECT_FALSE(next());
}

TEST_F(SdoClientTest, CountsItsTimeFromTheLastRequest) {
  (void)client.upload(device_name, 0);
  client.receive(bytes(0x585, {0x41, 0x08, 0x10, 0, 20, 0, 0, 0}));
  EXPECT_EQ(client.update(5000, 100), SdoClient::State::Waiting);  // it is not the node that keeps the next request back
  CanFrame segment;
  ASSERT_TRUE(client.next_frame(segment, 90));
  EXPECT_EQ(client.update(90 + 99, 100), SdoClient::State::Waiting);
  EXPECT_EQ(client.update(90 + 100, 100), SdoClient::State::TimedOut);
  EXPECT_EQ(next(), bytes(0x605, {0x80, 0x08, 0x10, 0, 0, 0, 0x04, 0x05}));
}

TEST_F(SdoClientTest, TimesOutAtItsLimitAndNotBefore) {
  (void)client.upload(statusword, 1000);
  EXPECT_EQ(client.update(1000 + 99, 100), SdoClient::State::Waiting);
  EXPECT_EQ(client.update(1000 + 100, 100), SdoClient::State::TimedOut);
  EXPECT_FALSE(client.receive(bytes(0x585, {0x4B, 0x41, 0x60, 0, 1, 0, 0, 0})));  // too late
  EXPECT_EQ(client.update(5000, 100), SdoClient::State::TimedOut);
}

}  // namespace
}  // namespace trocar::hal::canopen
