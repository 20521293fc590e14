#include "common/capture/rig_capture.hpp"

#include <algorithm>
#include <set>
#include <utility>

#include "common/capture/bytes.hpp"
#include "common/wire/convert.hpp"

namespace trocar::capture {

RigCaptureWriter::RigCaptureWriter(const std::filesystem::path& path) : file_(path, {.profile = "", .library = "trocar"}) {
  for (std::size_t i = 0; i < wire::topics.size(); ++i) {
    const wire::Topic& topic = wire::topics[i];
    const bool split = topic == wire::samples_topic || topic == wire::flight_topic;
    const char* type = split ? wire::descriptor<wire::Sample>().m_typename : topic.type;
    channels_[i] = file_.add_channel(file_.add_schema(type, "omgidl", wire::idl_text()), topic.name, "cdr",
                                     {{"protocol", std::to_string(protocol_version)}});
  }
}

std::uint16_t RigCaptureWriter::channel_of(const wire::Topic& topic) const {
  const auto found = std::ranges::find(wire::topics, topic);
  if (found == wire::topics.end()) throw CaptureError(std::string("captures have no topic ") + topic.name);
  return channels_[static_cast<std::size_t>(found - wire::topics.begin())];
}

void RigCaptureWriter::write_cdr(const wire::Topic& topic, std::uint64_t log_time_ns, std::uint64_t publish_time_ns,
                                 std::span<const std::byte> cdr) {
  file_.write(channel_of(topic), log_time_ns, publish_time_ns, cdr);
}

template <class Batch>
void RigCaptureWriter::write_split(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr,
                                   const Batch& batch, std::int64_t last_ns) {
  const auto samples = split_batch<Batch>(cdr);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto earlier_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, last_ns - batch.samples._buffer[i].time_ns));
    write_cdr(wire::topic_of<Batch>, log_time_ns - std::min(log_time_ns, earlier_ns), publish_time_ns, samples[i]);
  }
}

void RigCaptureWriter::write_batch_cdr(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr) {
  const Decoded<wire::SampleBatch> batch(cdr);
  if (batch->samples._length == 0) return;
  write_split(log_time_ns, publish_time_ns, cdr, *batch, batch->samples._buffer[batch->samples._length - 1].time_ns);
}

void RigCaptureWriter::write_flight_cdr(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr) {
  const Decoded<wire::FlightBatch> batch(cdr);
  write_split(log_time_ns, publish_time_ns, cdr, *batch, batch->end_ns);
}

void RigCaptureWriter::write_samples(std::span<const trocar::Sample> samples, std::uint64_t start_ns) {
  for (const trocar::Sample& sample : samples) {
    const std::uint64_t time_ns = start_ns + static_cast<std::uint64_t>(std::max<std::int64_t>(0, sample.time_ns));
    write_cdr(wire::samples_topic, time_ns, time_ns, serialise(wire::to_wire(sample)));
  }
}

void TickCounter::see(std::uint64_t tick) noexcept {
  if (ticks_ > 0) {
    if (tick <= last_) {
      ++restarts_;
    } else if (tick - last_ > 1) {
      ++gaps_;
      lost_ += tick - last_ - 1;
    }
  }
  last_ = tick;
  ++ticks_;
}

RigLog read_capture(const std::filesystem::path& path) {
  RigLog log;
  std::vector<std::string> problems;
  std::set<const Channel*> checked;
  const auto check_version = [&](const Channel& channel) {
    if (!checked.insert(&channel).second) return;
    const auto found = channel.metadata.find("protocol");
    const std::string theirs = found == channel.metadata.end() ? "of no number" : found->second;
    if (theirs == std::to_string(protocol_version)) return;
    throw CaptureError(printable(channel.topic) + " in " + path.string() + " was recorded with protocol " + printable(theirs) +
                       ", this program reads " + std::to_string(protocol_version) + ": use the version of trocar that recorded it");
  };
  McapReader reader(path);
  log.report = reader.read([&](const Message& message) {
    const std::string& topic = message.channel->topic;
    check_version(*message.channel);
    ++log.messages[topic];
    try {
      if (topic == wire::samples_topic.name) {
        const Decoded<wire::Sample> sample(message.data);
        log.samples.push_back(wire::from_wire(*sample));
        log.ticks.see(sample->tick);
      } else if (topic == wire::flight_topic.name) {
        log.flight.push_back(wire::from_wire(*Decoded<wire::Sample>(message.data)));
      } else if (topic == wire::events_topic.name) {
        const Decoded<wire::Event> event(message.data);
        log.events.push_back({wire::from_wire(*event), event->text});
      } else if (topic == wire::status_topic.name) {
        const Decoded<wire::Status> status(message.data);
        if (status->machine[0] != '\0') log.machine = {status->machine, static_cast<bool>(status->real_time), wire::loop_of(*status)};
      }
    } catch (const CdrError& error) {
      problems.push_back(printable(topic) + " message " + std::to_string(message.sequence) + " does not decode: " + error.what());
    }
  });
  log.report.problems.insert(log.report.problems.end(), problems.begin(), problems.end());
  return log;
}

std::vector<trocar::Sample> read_samples(const std::filesystem::path& path) { return std::move(read_capture(path).samples); }

}  // namespace trocar::capture
