// Between the plain structs of common/core/contracts.hpp and the DDS types. Allocation-free; texts are cut to what rig.idl allows.
// A received code that this program does not know is kept as it is: to_string() prints it as "?".
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/core/contracts.hpp"
#include "common/wire/types.hpp"

namespace trocar::wire {

[[nodiscard]] Sample to_wire(const trocar::Sample& sample) noexcept;
[[nodiscard]] trocar::Sample from_wire(const Sample& sample) noexcept;

void put_loop(const LoopCounters& loop, Status& status) noexcept;
[[nodiscard]] LoopCounters loop_of(const Status& status) noexcept;

[[nodiscard]] Event to_wire(const trocar::Event& event, std::string_view text = {}) noexcept;
[[nodiscard]] trocar::Event from_wire(const Event& event) noexcept;

[[nodiscard]] Reply to_wire(const trocar::Reply& reply, std::string_view text = {}) noexcept;
[[nodiscard]] trocar::Reply from_wire(const Reply& reply) noexcept;

// `sent_ns` and `now_ns` are CLOCK_REALTIME; a deadline of 0 ms never expires. Gain sets travel by name.
[[nodiscard]] Command to_wire(const trocar::Command& command, std::string_view gain_set, std::int64_t sent_ns,
                              std::uint32_t deadline_ms) noexcept;
// Accepted and `out` filled, or the reason why not: WrongVersion (also for a kind that this program does not know), Expired, UnknownGains.
// Numbers are not judged here; the controller refuses what is not finite or out of its limits.
[[nodiscard]] ReplyCode from_wire(const Command& command, std::span<const std::string_view> gain_sets, std::int64_t now_ns,
                                  trocar::Command& out) noexcept;

// Empty when `theirs` is the protocol of this program, else a sentence that names both, for example
// "rig ubc_twin speaks protocol 2, this program 1: install the same version of trocar on both sides".
[[nodiscard]] std::string version_problem(std::string_view who, std::uint32_t theirs);

// Copies as much of `text` as fits, always terminated; never splits a UTF-8 character.
void copy_text(std::span<char> to, std::string_view text) noexcept;

// Collects samples for one message, without allocation. Not copyable: the message points into it.
class BatchBuffer {
 public:
  static constexpr std::size_t capacity = 100;  // bound of the sequence in rig.idl
  BatchBuffer() = default;
  BatchBuffer(const BatchBuffer&) = delete;
  BatchBuffer& operator=(const BatchBuffer&) = delete;

  bool push(const trocar::Sample& sample) noexcept;  // false when full
  [[nodiscard]] bool full() const noexcept { return size_ == capacity; }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  void clear() noexcept { size_ = 0; }
  // Valid until the next push or clear. `dropped`: samples lost in the controller's ring since its start.
  [[nodiscard]] SampleBatch message(std::uint64_t dropped) noexcept;
  // The same as part of a flight recording whose last sample is of end_ns.
  [[nodiscard]] FlightBatch flight(std::int64_t end_ns) noexcept;

 private:
  template <class Sequence>
  void lend(Sequence& sequence) noexcept {
    sequence._buffer = samples_.data();
    sequence._length = static_cast<std::uint32_t>(size_);
    sequence._maximum = static_cast<std::uint32_t>(capacity);
    sequence._release = false;
  }

  std::array<Sample, capacity> samples_{};
  std::size_t size_{};
};

}  // namespace trocar::wire
