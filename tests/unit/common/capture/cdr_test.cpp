#include "common/capture/cdr.hpp"

#include <gtest/gtest.h>

#include <unistd.h>
#include <cstring>

#include <memory>

#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "example.hpp"

namespace {

using namespace trocar;
using capture::Decoded;
using capture::serialise;
using namespace std::chrono_literals;

template <class T>
std::vector<std::byte> through_dds(const T& value) {
  const wire::Participant participant(100 + static_cast<std::uint32_t>(getpid()) % 100);
  wire::Writer<T> writer(participant);
  wire::RawReader reader(participant, wire::topic_of<T>);
  wire::WaitSet wait(participant);
  wait.add(reader.entity());
  if (!writer.write(value)) return {};
  std::vector<std::byte> got;
  if (!wait.wait(10s)) return {};
  reader.take([&](std::span<const std::byte> cdr, std::int64_t) { got.assign(cdr.begin(), cdr.end()); });
  return got;
}

wire::Status example_status(std::string_view text) {
  wire::Status s{};
  s.protocol = 1;
  wire::copy_text(s.rig, "ubc_twin");
  s.mode = 4;
  s.homed = true;
  s.session = 0x1122334455667788ull;
  s.tick = 99;
  wire::copy_text(s.gain_set, "thesis");
  wire::copy_text(s.text, text);
  return s;
}

TEST(Cdr, BytesEqualThoseThatADdsReaderReceives) {
  const auto batch = std::make_unique<wire::BatchBuffer>();
  for (const Sample& s : example::samples(5, 20)) batch->push(s);
  EXPECT_EQ(serialise(batch->message(6)), through_dds(batch->message(6)));
  batch->clear();
  EXPECT_EQ(serialise(batch->message(6)), through_dds(batch->message(6)));
  // Text lengths 0 to 3 need all paddings.
  for (const char* text : {"", "a", "ab", "abc", "abcd"}) {
    EXPECT_EQ(serialise(example_status(text)), through_dds(example_status(text))) << text;
    EXPECT_EQ(serialise(wire::to_wire(Event{1, 2, EventKind::Tared, Mode::Off, Mode::Hold, Fault::None, 3, 4}, text)),
              through_dds(wire::to_wire(Event{1, 2, EventKind::Tared, Mode::Off, Mode::Hold, Fault::None, 3, 4}, text)));
    EXPECT_EQ(serialise(wire::to_wire(Reply{5, 6, CommandKind::Arm, ReplyCode::Done, Mode::Armed, 7}, text)),
              through_dds(wire::to_wire(Reply{5, 6, CommandKind::Arm, ReplyCode::Done, Mode::Armed, 7}, text)));
    EXPECT_EQ(serialise(wire::to_wire(Command{}, text, 8, 9)), through_dds(wire::to_wire(Command{}, text, 8, 9)));
  }
}

TEST(Cdr, ReadsBackWhatItWrote) {
  const auto batch = std::make_unique<wire::BatchBuffer>();
  for (const Sample& s : example::samples(5, 3)) batch->push(s);
  const Decoded<wire::SampleBatch> decoded(serialise(batch->message(6)));
  EXPECT_EQ(decoded->dropped, 6u);
  ASSERT_EQ(decoded->samples._length, 3u);
  EXPECT_EQ(decoded->samples._buffer[2].tick, 7u);
  EXPECT_EQ(decoded->samples._buffer[2].base_wrench[1], example::sample(7).base_wrench[1]);
  const Decoded<wire::Status> status(serialise(example_status("ready")));
  EXPECT_STREQ(status->rig, "ubc_twin");
  EXPECT_STREQ(status->text, "ready");
  EXPECT_EQ(status->session, 0x1122334455667788ull);
}

// The same integer written by hand in both byte orders: protocol 1, session 2, id 3, kind 4, code 5, mode 6, tick 7, text "".
TEST(Cdr, ReadsHandMadeBytesOfBothByteOrders) {
  const auto bytes = [](std::initializer_list<int> values) {
    std::vector<std::byte> out;
    for (const int v : values) out.push_back(static_cast<std::byte>(v));
    return out;
  };
  // Delimiter 33; XCDR2 aligns 8-byte values to 4.
  const auto little = bytes({0, 9, 0, 3, 33, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 3, 0,
                             0, 0, 4, 5, 6,  0, 7, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0});
  const auto big = bytes({0, 8, 0, 3, 0, 0, 0, 33, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0,
                          0, 3, 4, 5, 6, 0, 0, 0,  0, 0, 0, 0, 0, 7, 0, 0, 0, 1, 0, 0, 0, 0});
  for (const auto& cdr : {little, big}) {
    const Decoded<wire::Reply> reply(cdr);
    EXPECT_EQ(reply->protocol, 1u);
    EXPECT_EQ(reply->session, 2u);
    EXPECT_EQ(reply->id, 3u);
    EXPECT_EQ(reply->kind, 4);
    EXPECT_EQ(reply->code, 5);
    EXPECT_EQ(reply->mode, 6);
    EXPECT_EQ(reply->tick, 7u);
    EXPECT_STREQ(reply->text, "");
  }
  EXPECT_EQ(serialise(*Decoded<wire::Reply>(big)), little);
}

TEST(Cdr, SkipsFieldsThatANewerWriterAppended) {
  auto cdr = serialise(wire::to_wire(Reply{5, 6, CommandKind::Arm, ReplyCode::Done, Mode::Armed, 7}, "abc"));  // no padding
  ASSERT_EQ(cdr[3], std::byte{0});
  cdr.insert(cdr.end(), 8, std::byte{0xAB});
  cdr[4] = static_cast<std::byte>(std::to_integer<int>(cdr[4]) + 8);  // the delimiter covers them
  const Decoded<wire::Reply> reply(cdr);
  EXPECT_EQ(reply->tick, 7u);
  EXPECT_STREQ(reply->text, "abc");
}

TEST(Cdr, SamplesCutFromABatchEqualSamplesEncodedAlone) {
  const auto batch = std::make_unique<wire::BatchBuffer>();
  EXPECT_TRUE(capture::split_batch<wire::SampleBatch>(serialise(batch->message(0))).empty());
  const auto samples = example::samples(5, 100);
  for (const Sample& s : samples) batch->push(s);
  const auto cut = capture::split_batch<wire::SampleBatch>(serialise(batch->message(6)));
  ASSERT_EQ(cut.size(), 100u);
  for (std::size_t i = 0; i < 100; ++i) EXPECT_EQ(cut[i], serialise(wire::to_wire(samples[i])));
  EXPECT_EQ(capture::split_batch<wire::FlightBatch>(serialise(batch->flight(-7))), cut);
}

TEST(Cdr, SamplesCutFromABatchKeepFieldsThatANewerWriterAppended) {
  const auto batch = std::make_unique<wire::BatchBuffer>();
  batch->push(example::sample(8));
  auto cdr = serialise(batch->message(6));
  cdr.insert(cdr.end(), {std::byte{1}, std::byte{2}, std::byte{3}, std::byte{4}});
  for (const std::size_t delimiter : {4u, 20u, 28u}) {  // of batch, sequence and sample
    std::uint32_t size = 0;
    std::memcpy(&size, &cdr[delimiter], sizeof size);
    size += 4;
    std::memcpy(&cdr[delimiter], &size, sizeof size);
  }
  const auto cut = capture::split_batch<wire::SampleBatch>(cdr);
  ASSERT_EQ(cut.size(), 1u);
  EXPECT_EQ(cut[0].size(), serialise(wire::to_wire(example::sample(8))).size() + 4);
  EXPECT_EQ(cut[0].back(), std::byte{4});
  EXPECT_EQ(Decoded<wire::Sample>(cut[0])->tick, 8u);
}

TEST(Cdr, RefusesWhatIsNotTheType) {
  const auto batch = std::make_unique<wire::BatchBuffer>();
  for (const Sample& s : example::samples(5, 2)) batch->push(s);
  const auto cdr = serialise(batch->message(6));
  for (std::size_t size = 0; size < cdr.size(); ++size) {
    EXPECT_THROW(Decoded<wire::SampleBatch>(std::span(cdr).first(size)), capture::CdrError) << size;
  }
  auto foreign = cdr;
  foreign[1] = std::byte{0x01};  // plain XCDR1
  EXPECT_THROW((Decoded<wire::SampleBatch>(foreign)), capture::CdrError);
  auto hostile = cdr;
  hostile[28] = std::byte{101};  // one sample more than the bound of the sequence
  EXPECT_THROW((Decoded<wire::SampleBatch>(hostile)), capture::CdrError);
}

}  // namespace
