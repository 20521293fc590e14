// Captures of the rig: an MCAP file with the topics of common/wire as raw CDR and rig.idl as their schema, and what is in one.
// rig/samples, and rig/flight likewise, holds one trocar::wire::Sample a message, cut out of the batch that was received: a viewer then
// plots every tick at its own time, and Foxglove's decoder (omgidl-serialization 1.0) does not know the length that XCDR2 puts before a
// sequence of structs.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/capture/cdr.hpp"
#include "common/capture/mcap_reader.hpp"
#include "common/capture/mcap_writer.hpp"
#include "common/core/contracts.hpp"
#include "common/wire/types.hpp"

namespace trocar::capture {

class RigCaptureWriter {
 public:
  explicit RigCaptureWriter(const std::filesystem::path& path);

  // Bytes as received, header included. Log time is when they were received, publish time when they were written.
  // On rig/samples: one sample.
  void write_cdr(const wire::Topic& topic, std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr);
  // A batch as received: the last sample is logged at log_time_ns, the others as much earlier as the controller took them earlier.
  void write_batch_cdr(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr);
  // The same for a FlightBatch; earlier than the recording's last sample, so that its batches lie one after the other.
  void write_flight_cdr(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr);
  template <wire::Topical T>
  void write(const T& value, std::uint64_t time_ns) {
    write_cdr(wire::topic_of<T>, time_ns, time_ns, serialise(value));
  }
  // Each sample at start_ns plus its own time: for a controller that runs in this process.
  void write_samples(std::span<const trocar::Sample> samples, std::uint64_t start_ns = 0);

  void flush() { file_.flush(); }
  void close() { file_.close(); }
  [[nodiscard]] std::uint64_t messages(const wire::Topic& topic) const { return file_.messages(channel_of(topic)); }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }
  [[nodiscard]] std::uint64_t bytes() const noexcept { return file_.bytes(); }

 private:
  template <class Batch>
  void write_split(std::uint64_t log_time_ns, std::uint64_t publish_time_ns, std::span<const std::byte> cdr, const Batch& batch,
                   std::int64_t last_ns);
  [[nodiscard]] std::uint16_t channel_of(const wire::Topic& topic) const;

  McapWriter file_;
  std::array<std::uint16_t, wire::topics.size()> channels_{};
};

// Counts what is missing in a stream of ticks. A tick that does not increase is a controller that started anew, not a loss.
class TickCounter {
 public:
  void see(std::uint64_t tick) noexcept;
  [[nodiscard]] std::uint64_t ticks() const noexcept { return ticks_; }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }  // ticks missing between those seen
  [[nodiscard]] std::uint64_t gaps() const noexcept { return gaps_; }  // places where they are missing
  [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }

 private:
  std::uint64_t last_{}, ticks_{}, lost_{}, gaps_{}, restarts_{};
};

struct EventRecord {
  trocar::Event event;
  std::string text;
};

// What the controller said last about the machine that it runs on.
struct MachineRecord {
  std::string text;
  bool real_time{};
  LoopCounters loop{};  // since its start
};

struct RigLog {
  std::vector<trocar::Sample> samples;
  std::vector<trocar::Sample> flight;  // of all flight recordings, one after the other
  std::vector<EventRecord> events;
  std::optional<MachineRecord> machine;  // none in lock-step, nor in captures of versions that did not say
  TickCounter ticks;
  std::uint64_t dropped_by_controller{};          // samples that the controller itself had no room for
  std::map<std::string, std::uint64_t> messages;  // by topic
  ReadReport report;                              // with what did not decode
};

// Reads a capture, whole or cut off. Throws CaptureError when it is none, or when it was recorded with another protocol (names both).
[[nodiscard]] RigLog read_capture(const std::filesystem::path& path);
[[nodiscard]] std::vector<trocar::Sample> read_samples(const std::filesystem::path& path);

}  // namespace trocar::capture
