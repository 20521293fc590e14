// Sends flight recordings to the host and writes them to disk, in a thread of its own: a disk that hangs, or a reader that does not keep
// up, must not hold commands back. What cannot be written is said and goes to the host all the same.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "common/wire/convert.hpp"
#include "common/wire/dds.hpp"
#include "firmware/flight/folder.hpp"
#include "firmware/flight/recorder.hpp"

namespace trocar::bridge {

class FlightDelivery {
 public:
  // `events` outlives it; DDS writers may be used from several threads.
  FlightDelivery(const wire::Participant& participant, wire::Writer<wire::Event>& events, std::filesystem::path folder);
  ~FlightDelivery();  // delivers what is waiting
  FlightDelivery(const FlightDelivery&) = delete;
  FlightDelivery& operator=(const FlightDelivery&) = delete;

  void deliver(flight::Recording recording);

 private:
  static constexpr std::size_t most_waiting = 4;  // megabytes, for a disk that hangs while faults go on

  void run();
  void send(const flight::Recording& recording);
  void write(const flight::Recording& recording);

  wire::Writer<wire::FlightBatch> samples_;
  wire::Writer<wire::Event>& events_;
  flight::Folder folder_;
  wire::BatchBuffer buffer_;
  std::string said_;  // the last complaint: one that repeats itself is said once

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<flight::Recording> waiting_;
  bool finished_{};
  std::thread thread_;
};

}  // namespace trocar::bridge
