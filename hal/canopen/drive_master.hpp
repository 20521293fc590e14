// The master's side of one drive: bring-up, supervision, controlwords. Advanced by frames and by time; sends nothing itself but
// offers at most one frame when asked.
//
//   Reset ─ NMT reset communication → WaitBoot ─ boot-up message → Configure ─ all steps read back → Configured
//   ─ all drives configured: NMT start → WaitHeartbeat ─ heartbeat "operational" → Running
//   any failure → Pause (200 ms) → Reset.    A boot-up message always leads to Configure: the drive has forgotten everything.
#pragma once

#include <cstdint>

#include "hal/can/frame.hpp"
#include "hal/canopen/cia402.hpp"
#include "hal/canopen/drive_setup.hpp"
#include "hal/canopen/sdo.hpp"

namespace trocar::hal::canopen {

inline constexpr std::int64_t ns_per_ms = 1'000'000;
inline constexpr std::int64_t boot_timeout_ns = 300 * ns_per_ms;       // NMT reset to boot-up message
inline constexpr std::int64_t sdo_timeout_ns = 100 * ns_per_ms;        // request to answer
inline constexpr std::int64_t retry_pause_ns = 200 * ns_per_ms;        // after a failed bring-up
inline constexpr std::int64_t controlword_repeat_ns = 10 * ns_per_ms;  // a controlword that had no effect is sent again

enum class DrivePhase : std::uint8_t { Reset, WaitBoot, Configure, Configured, WaitHeartbeat, Running, Pause };

enum class DriveProblem : std::uint8_t {
  None,
  NoBootUp,         // nothing answers at this node id
  SdoTimeout,       // an object was asked for, no answer came
  SdoAborted,       // the drive refused; `actual` is the abort code
  ReadsBackWrong,   // `expected`, `actual`
  NoHeartbeat,      // started, but no heartbeat says so
  HeartbeatLost,    // while running
  LeftOperational,  // while running; `actual` is the NMT state
  Rebooted,         // while configured or running
};

// What a drive is doing, or why it is stuck. Plain data, so that it may cross to another thread.
struct DriveReport {
  DrivePhase phase{};
  DriveProblem problem{};  // of the last failed attempt; None once running
  std::uint8_t drive{};    // index in the rig
  std::uint8_t node{};
  Object object{};
  std::uint32_t expected{};
  std::uint32_t actual{};
  const char* remedy{};  // static text, may be null
  bool reading_back{};
};

struct DriveCounters {
  std::uint64_t sdo_timeouts{};
  std::uint64_t sdo_aborts{};
  std::uint64_t readback_errors{};
  std::uint64_t boot_timeouts{};
  std::uint64_t heartbeats_lost{};
  std::uint64_t left_operational{};
  std::uint64_t reboots{};
  std::uint64_t emergencies{};
  std::uint64_t controlwords{};
  std::uint64_t malformed{};  // frames of wrong length
};

class DriveMaster {
 public:
  DriveMaster() noexcept = default;
  DriveMaster(const rig::Rig& rig, std::size_t drive) noexcept;

  // A frame whose identifier belongs to this drive.
  void receive(const CanFrame& frame, std::int64_t now_ns) noexcept;
  void supervise(std::int64_t now_ns) noexcept;

  // Each returns true if it has a frame to send now, and then counts it as sent.
  bool bring_up_frame(std::int64_t now_ns, bool may_start, CanFrame& frame) noexcept;
  bool controlword_frame(std::int64_t now_ns, DriveRequest request, bool reset_fault, CanFrame& frame) noexcept;

  // Feedback of the last TPDO.
  [[nodiscard]] std::int32_t position_counts() const noexcept { return position_counts_; }
  [[nodiscard]] std::int16_t torque_permille() const noexcept { return torque_permille_; }
  [[nodiscard]] std::uint16_t statusword() const noexcept { return statusword_; }
  [[nodiscard]] bool fresh() const noexcept { return fresh_; }
  void clear_fresh() noexcept { fresh_ = false; }
  [[nodiscard]] std::uint16_t emergency_code() const noexcept { return emergency_code_; }
  [[nodiscard]] DriveState state() const noexcept { return decode_statusword(statusword_); }

  [[nodiscard]] DrivePhase phase() const noexcept { return report_.phase; }
  [[nodiscard]] bool configured() const noexcept { return report_.phase >= DrivePhase::Configured && report_.phase <= DrivePhase::Running; }
  [[nodiscard]] bool running() const noexcept { return report_.phase == DrivePhase::Running; }
  // A drive that left operation, or booted anew, has said so: its heartbeat is not what is missing.
  [[nodiscard]] bool heartbeat_ok() const noexcept {
    return running() || report_.problem == DriveProblem::LeftOperational || report_.problem == DriveProblem::Rebooted;
  }
  [[nodiscard]] bool waits_for_sdo() const noexcept { return sdo_.state() == SdoClient::State::Waiting; }
  [[nodiscard]] const DriveReport& report() const noexcept { return report_; }
  [[nodiscard]] const DriveCounters& counters() const noexcept { return counters_; }

 private:
  void enter(DrivePhase phase, std::int64_t now_ns) noexcept;
  void fail(DriveProblem problem, std::int64_t now_ns) noexcept;
  void blame_step(const char* remedy) noexcept;
  void heartbeat(NmtState state, std::int64_t now_ns) noexcept;
  void finish_exchange(std::int64_t now_ns) noexcept;
  [[nodiscard]] const SetupStep& step() const noexcept { return setup_.step[step_]; }

  std::uint8_t node_{};
  std::int64_t heartbeat_timeout_ns_{};
  DriveSetup setup_{};
  std::size_t step_{};
  bool written_{};  // this step's value was accepted; reading back is next
  SdoClient sdo_{};
  DriveReport report_{};
  DriveCounters counters_{};
  std::int64_t phase_since_ns_{};
  std::int64_t last_heartbeat_ns_{};

  std::int32_t position_counts_{};
  std::int16_t torque_permille_{};
  std::uint16_t statusword_{};
  std::uint16_t emergency_code_{};
  bool fresh_{};
  bool feedback_seen_{};  // since the drive was started
  std::uint16_t last_word_{};
  bool word_sent_{};
  std::int64_t word_sent_ns_{};
};

}  // namespace trocar::hal::canopen
