// Records a rig: everything that passes on the topics of common/wire goes to one MCAP file.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "common/capture/rig_capture.hpp"
#include "common/wire/dds.hpp"

namespace trocar::host {

struct Recording {
  std::map<std::string, std::uint64_t> messages;  // by topic; rig/samples and rig/flight count samples
  capture::TickCounter ticks;                     // of the samples received
  std::uint64_t dropped_by_controller{};          // samples that the rig itself had no room for
  std::uint64_t bytes{};                          // in the file
};

class Recorder {
 public:
  // Readers exist when this returns: whatever a rig that is in sight sends from now on is recorded.
  // Throws capture::CaptureError (cannot write) or wire::Error (no DDS); each says what to do.
  Recorder(const std::filesystem::path& file, std::uint32_t domain);

  // Waits for traffic, at most for `timeout`, and records it. Every quarter of a second what came is handed to the operating system,
  // also when nothing more comes. Throws capture::CaptureError when the disk is full or the rig speaks another protocol.
  void spin(std::chrono::milliseconds timeout);
  // Takes what has still arrived and completes the file with its index.
  void close();

  [[nodiscard]] const Recording& recording() const noexcept { return recording_; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return file_.path(); }

 private:
  void take();

  wire::Participant participant_;
  std::vector<wire::RawReader> readers_;
  wire::WaitSet wait_;
  capture::RigCaptureWriter file_;
  Recording recording_;
  std::chrono::steady_clock::time_point flushed_;
};

struct RecordOptions {
  std::filesystem::path out;  // a file that ends in .mcap, or a folder (made when missing) that gets a capture.mcap
  std::uint32_t domain{};
  std::function<void(const std::string&)> say;  // one line at the start, "recording to …", and one at the end
};

// `trocar record`: until `stop` is set, for example by SIGINT. Returns the exit code 0. Throws as Recorder does; what was recorded until
// then is readable.
int run_record(const RecordOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::host
