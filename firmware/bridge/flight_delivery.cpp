#include "firmware/bridge/flight_delivery.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <utility>

namespace trocar::bridge {

static_assert(wire::flight_topic.depth * wire::BatchBuffer::capacity >= capacity::flight_recorder + capacity::flight_aftermath,
              "a late reader gets a whole recording");

FlightDelivery::FlightDelivery(const wire::Participant& participant, wire::Writer<wire::Event>& events, std::filesystem::path folder)
    : samples_(participant), events_(events), folder_(std::move(folder)) {
  thread_ = std::thread([this] { run(); });
}

FlightDelivery::~FlightDelivery() {
  {
    const std::lock_guard lock(mutex_);
    finished_ = true;
  }
  wake_.notify_one();
  thread_.join();
}

void FlightDelivery::deliver(flight::Recording recording) {
  {
    const std::lock_guard lock(mutex_);
    if (waiting_.size() == most_waiting) waiting_.pop_back();  // the older ones are closer to what began it
    waiting_.push_back(std::move(recording));
  }
  wake_.notify_one();
}

void FlightDelivery::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return finished_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    const flight::Recording recording = std::move(waiting_.front());
    waiting_.pop_front();
    lock.unlock();
    try {
      send(recording);
      write(recording);
    } catch (const std::exception& e) {  // whatever it is, the rig goes on
      fmt::print(stderr, "trocar-rig: the flight recording of {} is lost: {}\n", to_string(recording.fault), e.what());
    }
    lock.lock();
  }
}

void FlightDelivery::send(const flight::Recording& recording) {
  const std::int64_t end_ns = recording.samples.back().time_ns;
  for (const Sample& sample : recording.samples) {
    (void)buffer_.push(sample);
    if (!buffer_.full() && &sample != &recording.samples.back()) continue;
    (void)samples_.write(buffer_.flight(end_ns));
    buffer_.clear();
  }
}

void FlightDelivery::write(const flight::Recording& recording) {
  Event event{.tick = recording.fault_tick,
              .time_ns = recording.samples.back().time_ns,
              .kind = EventKind::FlightRecorded,
              .from = recording.samples.back().mode,
              .to = recording.samples.back().mode,
              .fault = recording.fault};
  std::string text;
  try {
    text = folder_.write(recording, std::chrono::system_clock::now()).string();
    event.value = static_cast<double>(recording.samples.size());
    said_.clear();
  } catch (const std::exception& e) {
    text = e.what();
    // The file is named after its time, so that two complaints of one cause differ by it.
    const std::string complaint = text.substr(text.rfind(": ") + 1);
    if (complaint != said_) fmt::print(stderr, "trocar-rig: no flight recording on disk: {}\n", text);
    said_ = complaint;
  }
  (void)events_.write(wire::to_wire(event, text));
}

}  // namespace trocar::bridge
