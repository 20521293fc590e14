// Captures, whole, cut off or damaged: everything that is handed out is counted, belongs to a declared channel and lies in the selection;
// what does not decode is said.
#include "common/capture/rig_capture.hpp"
#include "memory_file.hpp"

using namespace trocar;
using fuzz::require;

namespace {

void require_lines(const capture::ReadReport& report) {
  for (const std::string& problem : report.problems) fuzz::require_line(problem);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path file = fuzz::memory_file(data, size);
  try {
    capture::McapReader reader(file);
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0;
    const capture::ReadReport all = reader.read([&](const capture::Message& message) {
      require(message.channel != nullptr && reader.channels().contains(message.channel->id), "messages have a channel");
      ++messages;
      bytes += message.data.size();
    });
    require_lines(all);
    require(messages == all.messages, "every message is counted");
    require(bytes <= size && all.lost_bytes <= size, "no more comes out than went in");
    require(all.finished == reader.finished(), "finished is finished");

    const capture::Selection part{.topics = {"rig/samples"}, .from_ns = 1000, .to_ns = 2'000'000'000};
    std::uint64_t selected = 0;
    // A reader of its own: what the first has learnt of channels that are declared behind their messages would be known to it.
    capture::McapReader again(file);
    const capture::ReadReport some = again.read(
        [&](const capture::Message& message) {
          require(part.topics.contains(message.channel->topic), "of the topics asked for");
          require(message.log_time_ns >= part.from_ns && message.log_time_ns <= part.to_ns, "of the time asked for");
          ++selected;
        },
        part);
    require(selected == some.messages && selected <= messages, "a part is no more than the whole");
  } catch (const capture::CaptureError& refusal) {
    fuzz::require_line(refusal.what());
  }
  try {
    const capture::RigLog log = capture::read_capture(file);
    require_lines(log.report);
    require(log.ticks.ticks() <= log.samples.size() + log.flight.size(), "ticks are counted once");
  } catch (const capture::CaptureError& refusal) {
    fuzz::require_line(refusal.what());
  }
  return 0;
}
