// The controller: one tick is a pure function of (state, inputs, time), in causal order
//   acquire -> observe -> commands -> supervise -> control -> limit -> send.
// controller.cpp is the tick; commands.cpp is what commands ask of it, and the replies that come later.
// No allocation, exception, lock or system call; every loop is bounded by a capacity. The same object runs in trocar-rig and in
// the lock-step bench.
#pragma once

#include <cstdint>

#include "common/core/contracts.hpp"
#include "common/core/ring.hpp"
#include "common/mechanism/twin.hpp"
#include "common/rig/rig.hpp"
#include "firmware/control/force_observer.hpp"
#include "firmware/control/haptic.hpp"
#include "firmware/control/motion.hpp"
#include "firmware/control/pid.hpp"
#include "firmware/control/velocity_observer.hpp"
#include "firmware/safety/faults.hpp"
#include "firmware/safety/modes.hpp"
#include "firmware/safety/output_gate.hpp"
#include "firmware/safety/watchdog.hpp"
#include "firmware/virtual_needle/virtual_needle.hpp"
#include "hal/rig_link.hpp"

namespace trocar::controller {

// Everything that leaves or enters the tick without waiting. One bridge thread is at the other end of each ring.
struct Mailboxes {
  Ring<Command, capacity::command_ring> commands;
  Ring<Command, capacity::stop_ring> stops;  // Stop alone: whatever fills the other, the next tick stops
  Ring<Reply, capacity::event_ring> replies;
  Ring<Event, capacity::event_ring> events;
  Ring<Sample, capacity::sample_ring> samples;
};

struct TickInput {
  std::int64_t now_ns{};          // controller's monotonic time of this tick's SYNC
  std::int64_t wakeup_late_ns{};  // wake-up against the schedule
  const hal::Feedback* link{};
};

struct Status {
  Mode mode{};
  Fault fault{};
  bool homed{};
  bool tared{};
  std::uint64_t session{};
  std::uint64_t tick{};
  std::uint64_t ticks_late{};
  std::uint64_t ticks_without_feedback{};
  std::uint8_t gain_set{};
};

class Controller {
 public:
  // real_time: the machine granted the whole real-time set-up; selects the lateness limit.
  // needle: what Haptic shows; without one, or on a rig that is no haptic device, that mode is refused. Whether the rig's observer is
  // admissible (control::admit) the caller has to ask.
  // Preconditions: rig is a twin, read and checked by common/config; rig, mail and needle outlive the controller.
  Controller(const rig::Rig& rig, Mailboxes& mail, bool real_time, virtual_needle::VirtualNeedle* needle = nullptr) noexcept;

  [[nodiscard]] const hal::LinkCommand& tick(const TickInput& input) noexcept;

  // As the command, from the tick's own thread between two ticks.
  void stop() noexcept { execute({.kind = CommandKind::Stop}); }

  // Of the last tick. The caller fills in the execution time and pushes it into the ring.
  [[nodiscard]] Sample& sample() noexcept { return sample_; }
  [[nodiscard]] Status status() const noexcept;

 private:
  static constexpr std::uint32_t rest_ticks_needed = 50;

  void acquire(const TickInput& input) noexcept;
  void observe() noexcept;
  void observe_force() noexcept;
  void observe_hand() noexcept;
  void take_commands() noexcept;
  void execute(const Command& command) noexcept;
  [[nodiscard]] ReplyCode home() noexcept;
  [[nodiscard]] ReplyCode arm(const Command& command) noexcept;
  [[nodiscard]] ReplyCode move(const Command& command) noexcept;
  [[nodiscard]] ReplyCode begin_haptic(const Command& command) noexcept;
  [[nodiscard]] ReplyCode reset_fault() noexcept;
  [[nodiscard]] bool path_is_reachable(const mechanism::Vec3& from, const mechanism::Vec3& to) noexcept;
  void follow_up() noexcept;
  void supervise(const TickInput& input) noexcept;
  void check(bool violated, Fault fault, double value, double limit) noexcept;
  void control() noexcept;
  void control_position() noexcept;
  void control_haptic() noexcept;
  [[nodiscard]] bool device(control::DeviceState& device) const noexcept;
  [[nodiscard]] mechanism::Vec3 one_count() const noexcept;
  void send(const mechanism::Vec4& friction_nm) noexcept;
  void stand_here() noexcept;
  void limit_and_send() noexcept;
  void record(const TickInput& input) noexcept;

  void raise(safety::Trigger trigger) noexcept;
  void latch(Fault fault, double value, double limit) noexcept;
  void escalate(Fault fault, double value, double limit) noexcept;
  void abandon_arm() noexcept;
  void abandon_tare() noexcept;
  void hold_here() noexcept;
  void forget_session() noexcept;
  void end_motion(ReplyCode code) noexcept;
  void reply(std::uint64_t session, std::uint32_t id, CommandKind kind, ReplyCode code) noexcept;
  void announce(EventKind kind, Mode from, Mode to, double value = 0.0, double limit = 0.0) noexcept;
  [[nodiscard]] bool position_controlled() const noexcept;

  const rig::Rig& rig_;
  Mailboxes& mail_;
  std::int64_t late_limit_ns_;

  // time
  std::uint64_t tick_{};
  std::int64_t now_ns_{};
  double dt_s_{};
  bool started_{};

  // measurement
  hal::Feedback link_{};
  std::array<std::int32_t, capacity::drives> counts_{};
  std::array<std::int32_t, capacity::drives> rest_counts_{};  // where the counts were when they last moved
  std::uint32_t rest_ticks_{};
  std::uint32_t missed_feedback_{};
  std::uint32_t gap_ticks_{1};  // ticks between the last two complete feedbacks
  std::uint32_t missed_sensor_{};
  bool homed_{};
  mechanism::Vec4 joint_offset_ = mechanism::Vec4::Zero();  // joint angle at count zero
  mechanism::Vec4 joint_rad_ = mechanism::Vec4::Zero();
  mechanism::TwinState state_{};
  mechanism::Mat43 joint_map_ = mechanism::Mat43::Zero();
  bool pose_valid_{};
  double pose_jump_m_{};
  double singularity_{};
  std::array<control::VelocityObserverState, 3> velocity_observer_{};
  mechanism::Vec3 velocity_ = mechanism::Vec3::Zero();
  mechanism::Vec3 sensor_wrench_ = mechanism::Vec3::Zero();  // needle frame: along, across, moment; tare not removed
  mechanism::Vec3 tare_ = mechanism::Vec3::Zero();           // needle frame
  mechanism::Vec3 base_wrench_ = mechanism::Vec3::Zero();    // rig frame, tare removed
  mechanism::Vec3 load_ = mechanism::Vec3::Zero();           // base_wrench_, low-passed
  bool tared_{};

  // the hand, and what it is shown
  virtual_needle::VirtualNeedle* needle_;
  control::ForceObserverConfig hand_config_;
  control::ForceObserverState hand_{};
  control::HapticConfig haptic_config_;
  control::HapticState haptic_{};
  mechanism::Vec3 virtual_pose_ = mechanism::Vec3::Zero();
  mechanism::Vec3 virtual_wrench_ = mechanism::Vec3::Zero();
  // Joint torques: of the last tick's command, which act from this tick's SYNC on, and of the one before, which acted up to it.
  mechanism::Vec4 sent_nm_ = mechanism::Vec4::Zero();
  mechanism::Vec4 acted_nm_ = mechanism::Vec4::Zero();
  std::array<std::uint32_t, capacity::drives> torque_error_ticks_{};
  std::int64_t clock_jump_ns_{};
  double since_hand_s_{};  // since the last sample that the observer took

  // what runs
  Mode mode_{Mode::Off};
  Fault fault_{Fault::None};
  std::uint64_t session_{};
  safety::Watchdog host_;
  safety::Watchdog enabling_;
  Command motion_command_{};  // Move that runs, kind KeepAlive when none
  Command tare_command_{};    // Tare that runs
  std::uint32_t tare_ticks_{};
  mechanism::Vec3 tare_sum_ = mechanism::Vec3::Zero();
  Command arm_command_{};  // Arm that waits for the drives
  ReplyCode motion_end_{ReplyCode::Done};
  bool stopping_{};         // braking, torque off at rest
  bool held_{};             // in Fault: the reaction keeps the handle under position control
  bool counts_doubtful_{};  // since a fault the counts may no longer mean what they meant: home again
  std::uint32_t last_move_id_{};
  control::Motion motion_{};
  std::array<control::PidState, 3> pid_{};
  std::uint8_t gain_set_{};
  safety::GateState gate_{};

  // outputs
  mechanism::Vec3 wrench_ = mechanism::Vec3::Zero();
  bool reset_drives_{};
  hal::LinkCommand command_{};
  Sample sample_{};
  std::uint64_t ticks_late_{};
  std::uint64_t ticks_without_feedback_{};
};

}  // namespace trocar::controller
