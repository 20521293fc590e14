#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <set>

#include "common/capture/mcap_reader.hpp"
#include "common/capture/mcap_writer.hpp"
#include "example.hpp"

namespace {

using namespace trocar::capture;

struct Got {
  std::string topic;
  std::uint32_t sequence;
  std::uint64_t log_ns, publish_ns;
  std::string data;
  bool operator==(const Got&) const = default;
};

std::span<const std::byte> bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

// 3 chunks of 4 messages on two channels, 100 ms apart.
std::vector<Got> write_small(const std::filesystem::path& path, bool close) {
  auto file = std::make_unique<McapWriter>(path, McapOptions{.profile = "", .library = "small", .chunk_ns = 400'000'000});
  const auto schema = file->add_schema("S", "omgidl", "struct S { long a; };");
  const auto a = file->add_channel(schema, "a", "cdr");
  const auto b = file->add_channel(schema, "b", "cdr");
  std::vector<Got> all;
  for (std::uint32_t i = 0; i < 12; ++i) {
    const std::string data = "message " + std::to_string(i);
    file->write(i % 2 == 0 ? a : b, 1'000'000'000 + i * 100'000'000ull, i, bytes(data));
    all.push_back({i % 2 == 0 ? "a" : "b", i / 2, 1'000'000'000 + i * 100'000'000ull, i, data});
  }
  if (close) {
    file->close();
  } else {
    file->flush();
    // As a crash leaves it: what the operating system has by now.
    const std::string now = example::slurp(path);
    file.reset();
    example::spit(path, now);
  }
  return all;
}

std::vector<Got> read_all(const std::filesystem::path& path, ReadReport& report, const Selection& selection = {}) {
  std::vector<Got> got;
  McapReader reader(path);
  report = reader.read(
      [&](const Message& m) {
        got.push_back({m.channel->topic, m.sequence, m.log_time_ns, m.publish_time_ns,
                       std::string(reinterpret_cast<const char*>(m.data.data()), m.data.size())});
      },
      selection);
  return got;
}

// Flips bits of one byte in place while it lives: rewriting the file would wait for the disk thousands of times.
class Flip {
 public:
  Flip(std::filesystem::path path, std::size_t at, int bits) : path_(std::move(path)), at_(at), bits_(bits) { apply(); }
  ~Flip() { apply(); }
  Flip(const Flip&) = delete;
  Flip& operator=(const Flip&) = delete;

 private:
  void apply() const {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekg(static_cast<std::streamoff>(at_));
    const int value = file.get();
    file.seekp(static_cast<std::streamoff>(at_));
    file.put(static_cast<char>(value ^ bits_));
  }
  std::filesystem::path path_;
  std::size_t at_;
  int bits_;
};

std::string joined(const std::vector<std::string>& lines) {
  std::string all;
  for (const auto& line : lines) all += line + "\n";
  return all;
}

TEST(Mcap, ReadsBackWhatWasWrittenAndSaysThatItIsWhole) {
  const example::Folder folder;
  const auto all = write_small(folder / "x.mcap", true);
  ReadReport report;
  EXPECT_EQ(read_all(folder / "x.mcap", report), all);
  EXPECT_TRUE(report.finished);
  EXPECT_TRUE(report.problems.empty()) << joined(report.problems);
  EXPECT_EQ(report.messages, 12u);
  EXPECT_EQ(report.chunks, 3u);
  McapReader reader(folder / "x.mcap");
  ASSERT_EQ(reader.schemas().size(), 1u);
  EXPECT_EQ(reader.schemas().begin()->second.data, "struct S { long a; };");
  EXPECT_EQ(reader.channels().size(), 2u);
}

TEST(Mcap, SelectsByTimeAndTopicThroughTheIndex) {
  const example::Folder folder;
  write_small(folder / "x.mcap", true);
  // A damaged chunk that the selection does not need stays untouched: that proves the use of the index.
  std::string content = example::slurp(folder / "x.mcap");
  content[content.find("message 1") + 8] ^= 1;
  example::spit(folder / "x.mcap", content);
  ReadReport report;
  const auto got = read_all(folder / "x.mcap", report, {.topics = {"b"}, .from_ns = 1'500'000'000, .to_ns = 1'900'000'000});
  std::vector<std::string> data;
  for (const auto& g : got) data.push_back(g.data);
  EXPECT_EQ(data, (std::vector<std::string>{"message 5", "message 7", "message 9"}));
  EXPECT_EQ(report.chunks, 2u);
  EXPECT_TRUE(report.problems.empty()) << joined(report.problems);
}

TEST(Mcap, ChunksReachTheFileWhileTheWriterLives) {
  const example::Folder folder;
  McapWriter file(folder / "x.mcap", {.profile = "", .library = "t", .chunk_ns = 250'000'000});
  const auto channel = file.add_channel(file.add_schema("S", "omgidl", ""), "a", "cdr");
  for (std::uint64_t ms = 0; ms <= 600; ms += 50) file.write(channel, ms * 1'000'000, 0, bytes("x"));
  ReadReport report;
  EXPECT_EQ(read_all(folder / "x.mcap", report).size(), 10u);  // 0 … 200 ms and 250 … 450 ms
  EXPECT_FALSE(report.finished);
}

// Cut anywhere: what comes out is a prefix of what went in, cut at a chunk, and the reader says that something is missing.
TEST(Mcap, RecordingCutAtAnyByteIsReadableUpToItsLastWholeChunk) {
  const example::Folder folder;
  const auto all = write_small(folder / "x.mcap", true);
  const std::string content = example::slurp(folder / "x.mcap");
  std::set<std::size_t> seen;
  example::spit(folder / "cut.mcap", content);
  for (std::size_t size = content.size(); size-- > 0;) {
    std::filesystem::resize_file(folder / "cut.mcap", size);
    ReadReport report;
    const auto got = read_all(folder / "cut.mcap", report);
    ASSERT_EQ(got.size() % 4, 0u) << size;
    ASSERT_EQ(got, std::vector<Got>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(got.size()))) << size;
    ASSERT_FALSE(report.finished) << size;
    ASSERT_FALSE(report.problems.empty()) << size;
    seen.insert(got.size());
  }
  EXPECT_EQ(seen, (std::set<std::size_t>{0, 4, 8, 12}));
}

TEST(Mcap, SaysHowManyBytesOfACutRecordingAreLost) {
  const example::Folder folder;
  write_small(folder / "x.mcap", false);
  ReadReport report;
  EXPECT_EQ(read_all(folder / "x.mcap", report).size(), 12u);
  EXPECT_EQ(report.lost_bytes, 0u);
  const std::string content = example::slurp(folder / "x.mcap");
  // The last message lies in the last chunk, whose record the cut tears.
  const std::size_t cut = content.rfind("message 11");
  example::spit(folder / "cut.mcap", content.substr(0, cut));
  EXPECT_EQ(read_all(folder / "cut.mcap", report).size(), 8u);
  EXPECT_GT(report.lost_bytes, 0u);
  EXPECT_NE(joined(report.problems).find("of " + std::to_string(cut) + ": the last " + std::to_string(report.lost_bytes) + " bytes"),
            std::string::npos)
      << joined(report.problems);
}

// Any flipped bit of a finished recording is noticed, and never turns into a changed message.
TEST(Mcap, NoticesEveryFlippedByteAndHandsOutOnlyIntactMessages) {
  const example::Folder folder;
  const auto all = write_small(folder / "x.mcap", true);
  const std::string content = example::slurp(folder / "x.mcap");
  example::spit(folder / "bad.mcap", content);
  std::size_t least = all.size();
  for (std::size_t at = 0; at < content.size(); ++at) {
    for (const int flip : {0x01, 0x80}) {
      const Flip damage(folder / "bad.mcap", at, flip);
      ReadReport report;
      std::vector<Got> got;
      try {
        got = read_all(folder / "bad.mcap", report);
      } catch (const CaptureError& error) {
        ASSERT_LT(at, 8u) << error.what();  // only the mark at the start makes it no MCAP file at all
        continue;
      }
      ASSERT_FALSE(report.problems.empty()) << "byte " << at;
      for (const Got& g : got) ASSERT_NE(std::find(all.begin(), all.end(), g), all.end()) << "byte " << at;
      least = std::min(least, got.size());
    }
  }
  EXPECT_EQ(least, 8u) << "one flip costs one chunk at most";
}

// The same in a recording that was cut off: a damaged chunk is left out and those behind it are found again.
TEST(Mcap, FindsTheChunksBehindADamagedOneWithoutAnIndex) {
  const example::Folder folder;
  const auto all = write_small(folder / "x.mcap", false);
  const std::string content = example::slurp(folder / "x.mcap");
  const std::size_t from = content.find("message 4") - 120, to = content.find("message 8") - 130;
  for (std::size_t at = from; at < to; ++at) {
    const Flip damage(folder / "x.mcap", at, 0x40);
    ReadReport report;
    const auto got = read_all(folder / "x.mcap", report);
    for (const Got& g : got) ASSERT_NE(std::find(all.begin(), all.end(), g), all.end()) << "byte " << at;
    ASSERT_GE(got.size(), 8u) << "byte " << at << "\n" << joined(report.problems);
    ASSERT_EQ(got.back().data, "message 11") << "byte " << at;
  }
}

TEST(Mcap, NamesTheDamagedChunkAndItsTime) {
  const example::Folder folder;
  write_small(folder / "x.mcap", true);
  std::string content = example::slurp(folder / "x.mcap");
  content[content.find("message 6") + 8] ^= 4;
  example::spit(folder / "x.mcap", content);
  ReadReport report;
  EXPECT_EQ(read_all(folder / "x.mcap", report).size(), 8u);
  EXPECT_EQ(report.damaged_chunks, 1u);
  EXPECT_EQ(report.lost_messages, 4u);
  EXPECT_NE(joined(report.problems).find("(1.400 s to 1.700 s) is damaged"), std::string::npos) << joined(report.problems);
  EXPECT_NE(joined(report.problems).find("4 of 12 messages are lost"), std::string::npos) << joined(report.problems);
}

template <class Function>
std::string error_of(Function&& function) {
  try {
    function();
  } catch (const CaptureError& error) {
    return error.what();
  }
  return "no error";
}

TEST(Mcap, SaysWhatToDoWhenItCannotWrite) {
  const example::Folder folder;
  const auto contains = [](const std::string& text, std::initializer_list<const char*> parts) {
    for (const char* part : parts) EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  contains(error_of([&] { McapWriter(folder / "missing/x.mcap"); }), {"missing/x.mcap", "create the folder"});
  example::spit(folder / "mine.mcap", "precious");
  contains(error_of([&] { McapWriter(folder / "mine.mcap"); }), {"mine.mcap", "never overwritten"});
  EXPECT_EQ(example::slurp(folder / "mine.mcap"), "precious");
  contains(error_of([&] { McapWriter("/dev/full"); }), {"/dev/full", "No space left", "free some space"});
  if (geteuid() != 0) {  // root may write anywhere
    ::chmod((folder / ".").c_str(), 0500);
    contains(error_of([&] { McapWriter(folder / "x.mcap"); }), {"x.mcap", "may write to"});
    ::chmod((folder / ".").c_str(), 0700);
  }
}

TEST(Mcap, RefusesWhatIsNoMcapFile) {
  const example::Folder folder;
  example::spit(folder / "x.mcap", "tick,time_ns\n1,2\n");
  EXPECT_NE(error_of([&] { McapReader(folder / "x.mcap"); }).find("not an MCAP file"), std::string::npos);
  EXPECT_NE(error_of([&] { McapReader(folder / "none.mcap"); }).find("No such file"), std::string::npos);
  EXPECT_NE(error_of([&] { McapReader(folder / "."); }).find("not a regular file"), std::string::npos);
}

}  // namespace
