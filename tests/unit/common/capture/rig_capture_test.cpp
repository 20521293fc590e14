#include "common/capture/rig_capture.hpp"

#include <gtest/gtest.h>

#include <memory>

#include "common/wire/convert.hpp"
#include "example.hpp"

namespace {

using namespace trocar;
using namespace trocar::capture;

TEST(RigCapture, SamplesAndEventsComeBackAsTheyWere) {
  const example::Folder folder;
  const auto samples = example::samples(10, 250);
  {
    RigCaptureWriter file(folder / "capture.mcap");
    file.write_samples(samples, 1'000);
    file.write(wire::to_wire(Event{11, 12, EventKind::Homed, Mode::Ready, Mode::Ready, Fault::None, 0, 0}, "homed"), 2'000);
    file.close();
    EXPECT_EQ(file.messages(wire::samples_topic), 250u);
  }
  const RigLog log = read_capture(folder / "capture.mcap");
  EXPECT_TRUE(log.report.problems.empty());
  ASSERT_EQ(log.samples.size(), samples.size());
  EXPECT_EQ(log.samples[123].tick, 133u);
  EXPECT_EQ(log.samples[249].pose, samples[249].pose);
  EXPECT_EQ(log.ticks.lost(), 0u);
  ASSERT_EQ(log.events.size(), 1u);
  EXPECT_EQ(log.events[0].event.kind, EventKind::Homed);
  EXPECT_EQ(log.events[0].text, "homed");
  EXPECT_EQ(log.messages.at("rig/samples"), 250u);
}

TEST(RigCapture, KeepsTheLastWordAboutTheMachine) {
  const example::Folder folder;
  const auto status = [](const char* machine, std::uint64_t overruns) {
    wire::Status s{};
    s.protocol = protocol_version;
    s.real_time = true;
    wire::copy_text(s.machine, machine);
    wire::put_loop({.overruns = overruns, .armed_page_faults = 7}, s);
    return s;
  };
  {
    RigCaptureWriter file(folder / "capture.mcap");
    file.write_samples(example::samples(10, 2), 1'000);
    file.write(status("Linux, core 3", 1), 2'000);
    file.write(status("Linux, core 3", 2), 3'000);
    file.close();
  }
  const RigLog log = read_capture(folder / "capture.mcap");
  ASSERT_TRUE(log.machine.has_value());
  EXPECT_EQ(log.machine->text, "Linux, core 3");
  EXPECT_TRUE(log.machine->real_time);
  EXPECT_EQ(log.machine->loop.overruns, 2u);
  EXPECT_EQ(log.machine->loop.armed_page_faults, 7u);
  {
    RigCaptureWriter file(folder / "older.mcap");  // whose writer did not know the field
    file.write(status("", 0), 2'000);
    file.close();
  }
  EXPECT_FALSE(read_capture(folder / "older.mcap").machine.has_value());
}

TEST(RigCapture, CountsMissingTicksAndRestarts) {
  TickCounter ticks;
  for (const std::uint64_t tick : {5u, 6u, 7u, 10u, 11u, 20u, 0u, 1u}) ticks.see(tick);
  EXPECT_EQ(ticks.ticks(), 8u);
  EXPECT_EQ(ticks.lost(), 2u + 8u);
  EXPECT_EQ(ticks.gaps(), 2u);
  EXPECT_EQ(ticks.restarts(), 1u);
}

TEST(RigCapture, LogsEverySampleOfABatchAtItsOwnTime) {
  const example::Folder folder;
  const auto batch = std::make_unique<wire::BatchBuffer>();
  for (const Sample& s : example::samples(10, 20)) batch->push(s);  // 1 ms apart
  {
    RigCaptureWriter file(folder / "capture.mcap");
    file.write_batch_cdr(1'000'000'000, 999'000'000, serialise(batch->message(0)));
    file.close();
  }
  std::vector<std::uint64_t> times;
  McapReader(folder / "capture.mcap").read([&](const Message& m) {
    times.push_back(m.log_time_ns);
    EXPECT_EQ(m.publish_time_ns, 999'000'000u);
    EXPECT_EQ(Decoded<wire::Sample>(m.data)->tick, 9 + times.size());
  });
  ASSERT_EQ(times.size(), 20u);
  EXPECT_EQ(times.front(), 981'000'000u);
  EXPECT_EQ(times.back(), 1'000'000'000u);
}

// Two batches of one recording, which are sent at nearly the same time: what lies before its last sample is logged so much earlier.
TEST(RigCapture, LogsAFlightRecordingAtItsOwnTime) {
  const example::Folder folder;
  const auto samples = example::samples(10, 40);  // 1 ms apart
  {
    RigCaptureWriter file(folder / "capture.mcap");
    const auto batch = std::make_unique<wire::BatchBuffer>();
    for (const std::size_t first : {0u, 20u}) {
      batch->clear();
      for (std::size_t i = first; i < first + 20; ++i) batch->push(samples[i]);
      file.write_flight_cdr(1'000'000'000 + first, 999'000'000, serialise(batch->flight(samples.back().time_ns)));
    }
    file.close();
    EXPECT_EQ(file.messages(wire::flight_topic), 40u);
  }
  std::vector<std::uint64_t> times;
  McapReader(folder / "capture.mcap").read([&](const Message& m) {
    EXPECT_EQ(m.channel->topic, "rig/flight");
    times.push_back(m.log_time_ns);
  });
  ASSERT_EQ(times.size(), 40u);
  EXPECT_EQ(times.front(), 961'000'000u);
  EXPECT_EQ(times.back(), 1'000'000'020u);
  const RigLog log = read_capture(folder / "capture.mcap");
  EXPECT_TRUE(log.samples.empty());
  ASSERT_EQ(log.flight.size(), 40u);
  EXPECT_EQ(log.flight[33].pose, samples[33].pose);
}

TEST(RigCapture, NamesBothVersionsOfAForeignRecording) {
  const example::Folder folder;
  {
    McapWriter file(folder / "capture.mcap");
    const auto schema = file.add_schema("trocar::wire::Sample", "omgidl", wire::idl_text());
    const auto channel = file.add_channel(schema, wire::samples_topic.name, "cdr", {{"protocol", std::to_string(protocol_version + 4)}});
    file.write(channel, 0, 0, serialise(wire::to_wire(example::sample(1))));
    file.close();
  }
  try {
    (void)read_capture(folder / "capture.mcap");
    FAIL() << "no error";
  } catch (const CaptureError& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("protocol " + std::to_string(protocol_version + 4)), std::string::npos) << text;
    EXPECT_NE(text.find("this program reads " + std::to_string(protocol_version)), std::string::npos) << text;
  }
}

TEST(RigCapture, ReportsAMessageThatDoesNotDecodeAndReadsOn) {
  const example::Folder folder;
  {
    RigCaptureWriter file(folder / "capture.mcap");
    const auto samples = example::samples(0, 2);
    file.write_samples(samples, 0);
    auto cdr = serialise(wire::to_wire(Event{}, "x"));
    cdr.resize(20);
    file.write_cdr(wire::events_topic, 1, 1, cdr);
    file.write_samples(example::samples(2, 2), 2);
    file.close();
  }
  const RigLog log = read_capture(folder / "capture.mcap");
  EXPECT_EQ(log.samples.size(), 4u);
  ASSERT_EQ(log.report.problems.size(), 1u);
  EXPECT_NE(log.report.problems[0].find("rig/events message 0 does not decode"), std::string::npos) << log.report.problems[0];
}

}  // namespace
