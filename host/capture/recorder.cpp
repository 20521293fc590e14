#include "host/capture/recorder.hpp"

#include <system_error>

#include "common/wire/convert.hpp"

namespace trocar::host {

namespace {

constexpr std::chrono::milliseconds flush_interval{250};

std::uint64_t wall_clock_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count());
}

void refuse_foreign(const std::string& problem) {
  if (!problem.empty()) throw capture::CaptureError("recording stopped: " + problem);
}

std::filesystem::path file_for(const std::filesystem::path& out) {
  if (out.extension() == ".mcap") return out;
  std::error_code error;
  std::filesystem::create_directories(out, error);
  if (error) {
    throw capture::CaptureError("cannot create the folder " + out.string() + ": " + error.message() +
                                "; choose a folder that you may write to");
  }
  return out / "capture.mcap";
}

std::string summary(const Recording& recording, const std::filesystem::path& path) {
  const auto count = [&](const wire::Topic& topic) {
    const auto found = recording.messages.find(topic.name);
    return std::to_string(found == recording.messages.end() ? 0 : found->second);
  };
  std::string line = "recorded " + count(wire::samples_topic) + " samples, " + count(wire::events_topic) + " events, " +
                     count(wire::command_topic) + " commands, " + count(wire::reply_topic) + " replies to " + path.string();
  if (recording.messages.contains(wire::flight_topic.name)) line += ", with " + count(wire::flight_topic) + " samples of flight recordings";
  if (recording.messages.contains(wire::markers_topic.name)) line += ", with " + count(wire::markers_topic) + " frames of markers";
  if (recording.ticks.lost() > 0) {
    line += "; " + std::to_string(recording.ticks.lost()) + " ticks lost in " + std::to_string(recording.ticks.gaps()) + " gaps";
  }
  if (recording.ticks.restarts() > 0) line += "; the rig restarted " + std::to_string(recording.ticks.restarts()) + " times";
  return line;
}

}  // namespace

Recorder::Recorder(const std::filesystem::path& file, std::uint32_t domain)
    : participant_(domain), wait_(participant_), file_(file), flushed_(std::chrono::steady_clock::now()) {
  for (const wire::Topic& topic : wire::topics) {
    readers_.emplace_back(participant_, topic);
    wait_.add(readers_.back().entity());
  }
  recording_.bytes = file_.bytes();
}

void Recorder::spin(std::chrono::milliseconds timeout) {
  if (wait_.wait(std::min(timeout, flush_interval))) take();
  const auto now = std::chrono::steady_clock::now();
  if (now - flushed_ >= flush_interval) {
    file_.flush();
    flushed_ = now;
  }
  recording_.bytes = file_.bytes();
}

void Recorder::close() {
  take();
  file_.close();
  recording_.bytes = file_.bytes();
}

void Recorder::take() {
  for (wire::RawReader& reader : readers_) {
    const wire::Topic& topic = reader.topic();
    reader.take([&](std::span<const std::byte> cdr, std::int64_t written_ns) {
      const auto publish_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, written_ns));
      if (topic == wire::flight_topic) {
        const capture::Decoded<wire::FlightBatch> batch(cdr);
        refuse_foreign(wire::version_problem("the rig", batch->protocol));
        recording_.messages[topic.name] += batch->samples._length;
        file_.write_flight_cdr(wall_clock_ns(), publish_ns, cdr);
        return;
      }
      if (topic != wire::samples_topic) {
        ++recording_.messages[topic.name];
        file_.write_cdr(topic, wall_clock_ns(), publish_ns, cdr);
        return;
      }
      const capture::Decoded<wire::SampleBatch> batch(cdr);
      refuse_foreign(wire::version_problem("the rig", batch->protocol));
      recording_.dropped_by_controller = std::max(recording_.dropped_by_controller, batch->dropped);
      recording_.messages[topic.name] += batch->samples._length;
      for (const wire::Sample& sample : std::span(batch->samples._buffer, batch->samples._length)) recording_.ticks.see(sample.tick);
      file_.write_batch_cdr(wall_clock_ns(), publish_ns, cdr);
    });
  }
}

int run_record(const RecordOptions& options, const std::atomic<bool>& stop) {
  const auto say = [&](const std::string& line) {
    if (options.say) options.say(line);
  };
  Recorder recorder(file_for(options.out), options.domain);
  say("recording to " + recorder.path().string());
  while (!stop.load(std::memory_order_relaxed)) recorder.spin(std::chrono::milliseconds(50));
  recorder.close();
  say(summary(recorder.recording(), recorder.path()));
  return 0;
}

}  // namespace trocar::host
