// The thread between the controller's rings and DDS. It may allocate and wait; the tick never waits for it.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <thread>

#include "common/rig/rig.hpp"
#include "firmware/controller/controller.hpp"
#include "hal/rig_link.hpp"

namespace trocar::bridge {

// What the tick thread leaves for the bridge to publish: status and bring-up text, double-buffered without locks.
struct Shared {
  struct Snapshot {
    controller::Status status{};
    hal::canopen::DriveReport drives{};
    bool operational{};
    hal::BusReport buses{};
    LoopCounters loop{};
  };
  Ring<Snapshot, 16> snapshots;  // one every few ticks; a full ring drops, the next one says the same
  std::atomic<bool> finished{false};
};

class Bridge {
 public:
  // Opens the DDS entities and starts the thread; throws wire::Error with a remedy. Call it before the real-time set-up: threads
  // inherit priority and core from the one that starts them. flight_folder: where flight recordings go, made with the first one.
  Bridge(const rig::Rig& rig, controller::Mailboxes& mail, Shared& shared, const std::filesystem::path& flight_folder);
  ~Bridge();
  Bridge(const Bridge&) = delete;
  Bridge& operator=(const Bridge&) = delete;

  // Once: whether the real-time set-up is complete, what it did not get, and on what machine.
  void report_real_time(bool complete, std::string missing, std::string machine);

 private:
  struct Entities;
  void run();
  void take_commands();
  void tell_losses(std::int64_t now_ns);
  void publish_samples(bool flush);
  void publish_rest();

  const rig::Rig& rig_;
  controller::Mailboxes& mail_;
  Shared& shared_;
  bool real_time_{};
  std::string real_time_text_, machine_;
  std::atomic<bool> real_time_known_{false};  // releases the three above
  Shared::Snapshot snapshot_{};
  hal::BusReport measured_buses_{};  // when their load was measured last
  double drives_percent_{}, sensor_percent_{};
  std::string fault_text_;
  std::uint64_t commands_lost_{};
  std::int64_t last_sample_ns_{};  // controller time
  std::uint64_t losses_told_{};    // of them
  std::int64_t losses_told_ns_ = std::numeric_limits<std::int64_t>::min() / 2;
  std::string loss_text_;
  std::size_t refusals_{};  // since the last status
  std::int64_t next_status_ns_{};
  std::unique_ptr<Entities> entities_;
  std::thread thread_;
};

}  // namespace trocar::bridge
