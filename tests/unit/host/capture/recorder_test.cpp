#include "host/capture/recorder.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <thread>

#include "common/wire/convert.hpp"

namespace {

using namespace trocar;
using namespace std::chrono_literals;
using capture::CaptureError;

std::uint32_t test_domain() { return 100 + static_cast<std::uint32_t>(getpid()) % 100; }

class RecorderTest : public testing::Test {
 protected:
  RecorderTest() {
    std::string name = (std::filesystem::temp_directory_path() / "trocar_record_XXXXXX").string();
    folder_ = mkdtemp(name.data());
  }
  ~RecorderTest() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

bool eventually(const std::function<bool()>& condition) {
  const auto deadline = std::chrono::steady_clock::now() + 15s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

// A rig that only talks: batches of 20 ticks.
class TalkingRig {
 public:
  explicit TalkingRig(std::uint32_t domain)
      : participant_(domain), samples_(participant_), flight_(participant_), status_(participant_), events_(participant_) {
    wire::Status status{};
    status.protocol = protocol_version;
    (void)status_.write(status);
    (void)events_.write(wire::to_wire(Event{}, "started"));
  }
  [[nodiscard]] bool heard() const { return samples_.matched() == 1 && events_.matched() == 1 && status_.matched() == 1; }
  void say(std::uint64_t first_tick, std::uint32_t protocol = protocol_version) {
    batch_->clear();
    for (std::uint64_t i = 0; i < 20; ++i) {
      Sample s;
      s.tick = first_tick + i;
      s.time_ns = static_cast<std::int64_t>(s.tick) * 1'000'000;
      s.base_wrench[1] = 0.1 * static_cast<double>(s.tick);
      batch_->push(s);
    }
    wire::SampleBatch message = batch_->message(3);
    message.protocol = protocol;
    (void)samples_.write(message);
  }
  void say_flight(std::uint64_t first_tick) {
    batch_->clear();
    for (std::uint64_t i = 0; i < 7; ++i) batch_->push(Sample{.tick = first_tick + i, .time_ns = static_cast<std::int64_t>(i)});
    (void)flight_.write(batch_->flight(6));
  }

 private:
  wire::Participant participant_;
  wire::Writer<wire::SampleBatch> samples_;
  wire::Writer<wire::FlightBatch> flight_;
  wire::Writer<wire::Status> status_;
  wire::Writer<wire::Event> events_;
  std::unique_ptr<wire::BatchBuffer> batch_ = std::make_unique<wire::BatchBuffer>();
};

TEST_F(RecorderTest, RecordsEveryTopicAndCountsLostTicks) {
  TalkingRig rig(test_domain());  // before the recorder: first status and event, and the last flight recording, are recorded all the same
  rig.say_flight(500);
  host::Recorder recorder(folder_ / "x.mcap", test_domain());
  ASSERT_TRUE(eventually([&] { return rig.heard(); }));
  const wire::Participant commander(test_domain());
  wire::Writer<wire::Command> commands(commander);
  wire::Writer<wire::Reply> replies(commander);
  wire::Writer<wire::Markers> markers(commander);
  ASSERT_TRUE(eventually([&] { return commands.matched() == 1 && replies.matched() == 1 && markers.matched() == 1; }));
  std::array<float, 2> u{1.5F, 2.5F};
  wire::Markers frame{};
  frame.frame = 7;
  frame.u_px._buffer = u.data();
  frame.u_px._length = frame.u_px._maximum = 2;
  ASSERT_TRUE(markers.write(frame));
  ASSERT_TRUE(commands.write(wire::to_wire(Command{}, "", 0, 0)));
  ASSERT_TRUE(replies.write(wire::to_wire(Reply{}, "yes")));
  rig.say(0);
  rig.say(20);
  rig.say(45);  // 40 … 44 are missing
  ASSERT_TRUE(eventually([&] {
    recorder.spin(10ms);
    const auto& m = recorder.recording().messages;
    return m.contains("rig/samples") && m.at("rig/samples") == 60 && m.size() == wire::topics.size();
  }));
  recorder.close();
  EXPECT_EQ(recorder.recording().ticks.lost(), 5u);
  EXPECT_EQ(recorder.recording().dropped_by_controller, 3u);
  EXPECT_EQ(recorder.recording().bytes, std::filesystem::file_size(folder_ / "x.mcap"));

  const capture::RigLog log = capture::read_capture(folder_ / "x.mcap");
  EXPECT_TRUE(log.report.finished);
  EXPECT_TRUE(log.report.problems.empty());
  EXPECT_EQ(log.messages, recorder.recording().messages);
  ASSERT_EQ(log.samples.size(), 60u);
  EXPECT_EQ(log.samples.back().tick, 64u);
  ASSERT_EQ(log.flight.size(), 7u);
  EXPECT_EQ(log.flight.back().tick, 506u);
  EXPECT_EQ(log.samples.back().base_wrench[1], 0.1 * 64.0);
  EXPECT_EQ(log.ticks.lost(), 5u);
  EXPECT_EQ(log.events.at(0).text, "started");
  capture::McapReader(folder_ / "x.mcap").read([](const capture::Message& message) {
    if (message.channel->topic != wire::markers_topic.name) return;
    const capture::Decoded<wire::Markers> seen(message.data);
    EXPECT_EQ(seen->frame, 7u);
    ASSERT_EQ(seen->u_px._length, 2u);
    EXPECT_EQ(seen->u_px._buffer[1], 2.5F);
  });
}

TEST_F(RecorderTest, SaysWhereItRecordsAndClosesTheFileWhenStopped) {
  std::atomic<bool> stop{false};
  std::vector<std::string> lines;
  host::RecordOptions options{folder_ / "run", test_domain(), [&](const std::string& line) {
                                lines.push_back(line);
                                stop = true;
                              }};
  EXPECT_EQ(host::run_record(options, stop), 0);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0], "recording to " + (folder_ / "run/capture.mcap").string());
  EXPECT_NE(lines[1].find("recorded 0 samples"), std::string::npos) << lines[1];
  EXPECT_TRUE(capture::McapReader(folder_ / "run/capture.mcap").finished());
}

// A recorder in a process of its own, killed without warning: no message but those of the last moments is missing.
TEST_F(RecorderTest, KilledRecorderLeavesAReadableCapture) {
  const auto path = folder_ / "killed.mcap";
  const std::uint32_t domain = test_domain();
  const pid_t child = fork();
  if (child == 0) {
    const std::atomic<bool> never{false};
    try {
      host::run_record({path, domain, {}}, never);
    } catch (...) {
    }
    _exit(1);
  }
  TalkingRig rig(domain);
  ASSERT_TRUE(eventually([&] { return rig.heard(); }));
  std::uint64_t tick = 0;
  // Talks until a whole chunk can be read, then the recorder dies in mid-sentence. The size of the file tells nothing:
  // it grows while a chunk is being written, and a chunk cut short by the kill is lost by right.
  std::size_t readable = 0;
  const bool recorded = eventually([&] {
    rig.say(tick);
    tick += 20;
    readable = capture::read_capture(path).samples.size();
    return readable > 100;
  });
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(recorded);
  EXPECT_TRUE(WIFSIGNALED(status));

  const capture::RigLog log = capture::read_capture(path);
  EXPECT_FALSE(log.report.finished);
  EXPECT_EQ(log.report.damaged_chunks, 0u);
  ASSERT_GE(log.samples.size(), readable);
  EXPECT_EQ(log.ticks.lost(), 0u);
  EXPECT_EQ(log.samples.back().base_wrench[1], 0.1 * static_cast<double>(log.samples.back().tick));
}

TEST_F(RecorderTest, RefusesARigWithAnotherProtocolByNameAndKeepsWhatItHas) {
  TalkingRig rig(test_domain());
  host::Recorder recorder(folder_ / "x.mcap", test_domain());
  ASSERT_TRUE(eventually([&] { return rig.heard(); }));
  std::string text;
  rig.say(0, protocol_version + 6);
  ASSERT_TRUE(eventually([&] {
    try {
      recorder.spin(10ms);
    } catch (const CaptureError& error) {
      text = error.what();
    }
    return !text.empty();
  }));
  EXPECT_NE(text.find("the rig speaks protocol " + std::to_string(protocol_version + 6)), std::string::npos) << text;
  recorder.close();
  EXPECT_EQ(capture::read_capture(folder_ / "x.mcap").events.size(), 1u);
}

TEST_F(RecorderTest, SaysWhatToDoWhenItCannotRecord) {
  const std::atomic<bool> stop{true};
  const auto error_of = [&](const std::filesystem::path& out) -> std::string {
    try {
      host::run_record({out, test_domain(), {}}, stop);
    } catch (const CaptureError& error) {
      return error.what();
    }
    return "no error";
  };
  std::ofstream(folder_ / "file") << "x";
  const std::string under_file = error_of(folder_ / "file" / "run");
  EXPECT_NE(under_file.find("cannot create the folder"), std::string::npos) << under_file;
  EXPECT_NE(under_file.find("choose a folder"), std::string::npos) << under_file;
  std::filesystem::create_symlink("/dev/full", folder_ / "full.mcap");
  const std::string full = error_of(folder_ / "full.mcap");
  EXPECT_NE(full.find("free some space"), std::string::npos) << full;
  EXPECT_EQ(error_of(folder_ / "run"), "no error");
  const std::string twice = error_of(folder_ / "run");
  EXPECT_NE(twice.find("never overwritten"), std::string::npos) << twice;
}

}  // namespace
