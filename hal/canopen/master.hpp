// The CANopen master of a drives bus: brings the drives up, watches them, walks them through CiA 402, and keeps to the bus budget:
// beside SYNC and torque it sends at most one frame a tick, and none in the tick after an SDO request, which belongs to the answer.
// Priority: controlwords that take torque away, own heartbeat, then all else in turn over the drives.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/rig/rig.hpp"
#include "hal/canopen/drive_master.hpp"

namespace trocar::hal::canopen {

inline constexpr std::int64_t reset_window_ns =
    100 * ns_per_ms;  // one reset request is tried for so long: a reset takes two frames a drive

// Identifiers of all frames that a master of this rig listens to.
struct ReceivedIds {
  std::array<std::uint32_t, 4 * capacity::drives> id{};
  std::size_t count{};
  [[nodiscard]] std::span<const std::uint32_t> all() const noexcept { return std::span{id}.first(count); }
};
[[nodiscard]] ReceivedIds received_ids(const rig::Rig& rig) noexcept;

class Master {
 public:
  explicit Master(const rig::Rig& rig) noexcept;

  // False: the frame is none of a drive's.
  bool receive(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void supervise(std::int64_t now_ns) noexcept;
  // Once a tick: the further frame of this tick, if there is one.
  bool next_frame(std::int64_t now_ns, DriveRequest request, bool reset_faults, CanFrame& frame) noexcept;

  [[nodiscard]] bool operational() const noexcept;  // every drive mapped, verified, started, its heartbeat present
  [[nodiscard]] bool all_enabled() const noexcept;  // every drive in Operation enabled
  [[nodiscard]] std::size_t drives() const noexcept { return drives_; }
  [[nodiscard]] const DriveMaster& drive(std::size_t i) const noexcept { return drive_[i]; }
  void clear_fresh() noexcept {
    for (DriveMaster& drive : drive_) drive.clear_fresh();
  }

  // The drive that holds the bring-up back: the first with a problem, else the first that is not running; drives() if none.
  [[nodiscard]] std::size_t blocking_drive() const noexcept;

 private:
  std::array<DriveMaster, capacity::drives> drive_{};
  std::array<std::uint8_t, 128> drive_of_node_{};  // node id to index; capacity::drives: foreign
  std::size_t drives_;
  std::uint8_t node_;
  std::int64_t heartbeat_period_ns_;
  std::int64_t next_heartbeat_ns_{};
  bool heartbeat_started_{};
  bool answer_due_{};
  std::int64_t reset_until_ns_{};
  std::size_t turn_{};
  std::size_t controlword_turn_{};
};

// One line for people: which drive, which object, why, and the remedy. Returns the number of characters, without the final zero.
std::size_t describe(const DriveReport& report, std::span<char> text) noexcept;

}  // namespace trocar::hal::canopen
