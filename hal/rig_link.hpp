// The controller's link to its rig: four (or two) drives on one bus, the force sensor on another. Once a tick:
//   begin_tick  SYNC (latches positions, applies the torques sent before it) and the sensor's request
//   poll        until it returns true or the caller's deadline passes
//   end_tick    second gate, torque frame, at most one further frame
// The torque of tick k acts at SYNC k + 1. Bring-up runs by itself in end_tick and takes about half a second.
// A tick without end_tick sends zero torque at the next begin_tick; a caller that vanishes is noticed by the drives
// (canopen::rpdo_timeout_ms). Nothing here waits, allocates or throws; time is the caller's monotonic clock in ns.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>

#include "common/core/capacities.hpp"
#include "common/rig/rig.hpp"
#include "hal/can/bits.hpp"
#include "hal/can/bus.hpp"
#include "hal/canopen/master.hpp"
#include "hal/output_gate.hpp"
#include "hal/sensor/ati_net_ft.hpp"

namespace trocar::hal {

using canopen::DriveRequest;  // Disable, Enable, QuickStop

// Down: not begun, shut down, or off the bus (only a new start leads out of it). Operational: all drives mapped, verified,
// heartbeats present; they may still be disabled or faulted.
enum class LinkState : std::uint8_t { Down, BringUp, Operational };

struct DriveFeedback {
  std::int32_t position_counts{};
  double joint_torque_nm{};  // measured by the drive, carried over to the joint
  std::uint16_t statusword{};
  bool fresh{};  // belongs to this tick's SYNC
  bool enabled{};
  bool faulted{};
  bool heartbeat_ok{};
  std::uint16_t emcy_code{};  // last emergency, 0 after it has been cleared
};

struct SensorFeedback {
  std::array<double, 6> force_torque{};  // N, N, N, N m, N m, N m in the sensor's frame: Fx Fy Fz Tx Ty Tz; last known if not fresh
  std::uint16_t status{};                // ati::status_…
  bool fresh{};
  bool saturated{};
};

struct Feedback {
  LinkState state{};
  std::array<DriveFeedback, capacity::drives> drive{};
  std::size_t drives{};
  SensorFeedback sensor{};
  bool complete{};  // every drive fresh this tick
  bool bus_off{};   // the CAN controller left the drives' bus; only a new start leads back
};

// Zero-initialised is harmless: everything disabled.
struct LinkCommand {
  DriveRequest request{};
  bool reset_faults{};  // one tick is enough
  std::array<double, capacity::drives> joint_torque_nm{};
};

struct LinkCounters {
  std::uint64_t ticks{};
  std::uint64_t missed_ends{};      // ticks without end_tick
  std::uint64_t late_feedback{};    // drive values that came after their tick
  std::uint64_t missed_feedback{};  // drive values that were absent at end_tick while operational
  std::uint64_t missed_sensor{};    // ticks whose sensor values were absent at end_tick
  std::uint64_t foreign_frames{};   // frames that nobody here expects
  std::uint64_t unexpected_sensor{};
  GateCounters gate{};
  std::array<canopen::DriveCounters, capacity::drives> drive{};
  BusCounters drives_bus{};
  BusCounters sensor_bus{};
};

// How the buses are doing, for people; small enough to be copied in every tick.
struct BusReport {
  BusLoad drives_load{};  // since the start, as is the next
  BusLoad sensor_load{};
  std::uint64_t ticks{};
  BusCondition drives{};
  BusCondition sensor{};
};

template <CanBus Bus>
class RigLink {
 public:
  RigLink(const rig::Rig& rig, Bus& drives, Bus& sensor) noexcept
      : drives_{drives},
        sensor_{sensor},
        master_{rig},
        gate_{rig},
        ati_{rig.buses.sensor_base_id},
        scale_{rig.sensor},
        sensor_base_id_{rig.buses.sensor_base_id},
        drive_nodes_{rig.buses.drive_node} {
    feedback_.drives = rig.drives();
  }

  void begin_tick(std::int64_t now_ns) noexcept {
    if (halted_) return;
    begun_ = true;
    const std::size_t fresh_before = fresh_drives();
    drain(now_ns);
    counters_.late_feedback += fresh_drives() - fresh_before;
    if (open_tick_) {
      ++counters_.missed_ends;
      send(drives_, torque_frame({}), now_ns);
    }
    bus_report_.drives_load.end_tick();
    bus_report_.sensor_load.end_tick();
    bus_report_.ticks = ++counters_.ticks;
    open_tick_ = true;
    master_.clear_fresh();
    sensor_fresh_ = false;
    send(drives_, CanFrame{.id = canopen::cob_sync}, now_ns);
    drives_.flush(now_ns);
    send(sensor_, ati_.request(), now_ns);
    sensor_.flush(now_ns);
    update();
  }

  // True once all drives and the sensor have answered this tick.
  bool poll(std::int64_t now_ns) noexcept {
    if (halted_) return false;
    drain(now_ns);
    master_.supervise(now_ns);
    update();
    return feedback_.complete && sensor_fresh_;
  }

  [[nodiscard]] const Feedback& feedback() const noexcept { return feedback_; }

  void end_tick(std::int64_t now_ns, const LinkCommand& command) noexcept {
    if (halted_ || !open_tick_) return;
    open_tick_ = false;
    master_.supervise(now_ns);
    update();
    const bool operational = feedback_.state == LinkState::Operational;
    if (operational) counters_.missed_feedback += master_.drives() - fresh_drives();
    if (!sensor_fresh_) ++counters_.missed_sensor;
    const bool open = operational && command.request == DriveRequest::Enable && master_.all_enabled();
    send(drives_, torque_frame(gate_.pass(command.joint_torque_nm, open)), now_ns);
    const DriveRequest request = operational || command.request != DriveRequest::Enable ? command.request : DriveRequest::Disable;
    CanFrame further;
    if (master_.next_frame(now_ns, request, command.reset_faults, further)) send(drives_, further, now_ns);
    drives_.flush(now_ns);
  }

  // Zero torque, quick stop, then pre-operational for every drive, all at once (the budget no longer counts). Down from then on.
  void shut_down(std::int64_t now_ns) noexcept {
    if (halted_) return;
    drives_.send(torque_frame({}), now_ns);
    for (std::size_t i = 0; i < feedback_.drives; ++i) {
      CanFrame stop{.id = canopen::cob_controlword(drive_nodes_[i]), .length = 2};
      store(stop, 0, canopen::control::quick_stop);
      drives_.send(stop, now_ns);
    }
    drives_.send(canopen::nmt_frame(canopen::NmtCommand::PreOperational, 0), now_ns);
    drives_.flush(now_ns);
    halted_ = true;
    update();
  }

  // What the bring-up is doing, or why it is stuck, naming drive, node, object and remedy. Valid until the next call; from the
  // thread of the tick only (others: copy report(), then canopen::describe). Formats text: not for every tick.
  [[nodiscard]] const char* bring_up_step() noexcept {
    const auto print = [&](const char* line) { std::snprintf(text_.data(), text_.size(), "%s", line); };
    const BusCondition drives = bus_report_.drives;
    if (drives == BusCondition::Off || (drives == BusCondition::Passive && !master_.operational())) {
      std::snprintf(text_.data(), text_.size(), "the CAN controller of the drives bus is %s", to_string(drives));
    } else if (halted_) {
      print("shut down");
    } else if (!begun_) {
      print("not started");
    } else if (master_.blocking_drive() < master_.drives()) {
      canopen::describe(report(), text_);
    } else if (bus_report_.sensor >= BusCondition::Passive) {
      std::snprintf(text_.data(), text_.size(), "the CAN controller of the sensor bus is %s", to_string(bus_report_.sensor));
    } else if (ati_.readings() == 0) {
      std::snprintf(text_.data(), text_.size(),
                    "all drives run, but the force sensor does not answer to identifier %03Xh: check its supply, cable and base id",
                    static_cast<unsigned>(sensor_base_id_));
    } else {
      print("operational");
    }
    return text_.data();
  }

  // Of the drive that holds the bring-up back, else of the first.
  [[nodiscard]] const canopen::DriveReport& report() const noexcept {
    const std::size_t i = master_.blocking_drive();
    return master_.drive(i < master_.drives() ? i : 0).report();
  }

  [[nodiscard]] const BusReport& bus_report() const noexcept { return bus_report_; }

  [[nodiscard]] LinkCounters counters() const noexcept {
    LinkCounters all = counters_;
    all.gate = gate_.counters();
    all.unexpected_sensor = ati_.unexpected();
    for (std::size_t i = 0; i < master_.drives(); ++i) all.drive[i] = master_.drive(i).counters();
    all.drives_bus = drives_.counters();
    all.sensor_bus = sensor_.counters();
    return all;
  }

 private:
  void send(Bus& bus, const CanFrame& frame, std::int64_t now_ns) noexcept {
    if (bus.send(frame, now_ns)) (&bus == &drives_ ? bus_report_.drives_load : bus_report_.sensor_load).add(frame);
  }

  // Bounded: a babbling node must not hold the tick.
  void drain(std::int64_t now_ns) noexcept {
    CanFrame frame;
    for (std::size_t n = 0; n < capacity::can_queue && drives_.receive(frame, now_ns); ++n) {
      if (frame.error) {
        bus_report_.drives = condition_after(frame, bus_report_.drives);
        if (bus_report_.drives == BusCondition::Off) halted_ = true;
        continue;
      }
      bus_report_.drives_load.add(frame);
      if (!master_.receive(frame, now_ns)) ++counters_.foreign_frames;
    }
    for (std::size_t n = 0; n < capacity::can_queue && sensor_.receive(frame, now_ns); ++n) {
      if (frame.error) {
        bus_report_.sensor = condition_after(frame, bus_report_.sensor);
        continue;
      }
      bus_report_.sensor_load.add(frame);
      if (frame.id != sensor_base_id_ + 5 && frame.id != sensor_base_id_ + 6) {
        ++counters_.foreign_frames;
      } else if (ati_.receive(frame)) {
        sensor_fresh_ = true;
      }
    }
  }

  [[nodiscard]] std::size_t fresh_drives() const noexcept {
    std::size_t n = 0;
    for (std::size_t i = 0; i < master_.drives(); ++i) n += master_.drive(i).fresh() ? 1u : 0u;
    return n;
  }

  void update() noexcept {
    feedback_.state = halted_ || !begun_ ? LinkState::Down : master_.operational() ? LinkState::Operational : LinkState::BringUp;
    for (std::size_t i = 0; i < master_.drives(); ++i) {
      const canopen::DriveMaster& drive = master_.drive(i);
      const canopen::DriveState state = drive.state();
      DriveFeedback& out = feedback_.drive[i];
      out.position_counts = drive.position_counts();
      out.joint_torque_nm = gate_.joint_torque_nm(i, drive.torque_permille());
      out.statusword = drive.statusword();
      out.fresh = drive.fresh();
      out.enabled = drive.running() && state == canopen::DriveState::OperationEnabled;
      out.faulted = state == canopen::DriveState::Fault || state == canopen::DriveState::FaultReaction;
      out.heartbeat_ok = drive.heartbeat_ok();
      out.emcy_code = drive.emergency_code();
    }
    feedback_.bus_off = bus_report_.drives == BusCondition::Off;
    feedback_.complete = !halted_ && fresh_drives() == master_.drives();
    feedback_.sensor.fresh = sensor_fresh_;
    if (sensor_fresh_) {
      feedback_.sensor.force_torque = ati_.reading().force_torque(scale_);
      feedback_.sensor.status = ati_.reading().status;
      feedback_.sensor.saturated = ati_.reading().saturated();
    }
  }

  Bus& drives_;
  Bus& sensor_;
  canopen::Master master_;
  OutputGate gate_;
  ati::Client ati_;
  rig::ForceSensor scale_;
  std::uint32_t sensor_base_id_;
  std::array<std::uint8_t, capacity::drives> drive_nodes_;
  bool begun_{};
  bool open_tick_{};  // begun, not yet ended
  bool halted_{};
  bool sensor_fresh_{};
  Feedback feedback_{};
  LinkCounters counters_{};
  BusReport bus_report_{};
  std::array<char, 384> text_{};
};

}  // namespace trocar::hal
