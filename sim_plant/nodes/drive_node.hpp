// One servo drive as it looks from the wire: CANopen slave (CiA 301) with a CiA 402 state machine in cyclic synchronous torque mode.
// It knows nothing of mechanics: the plant sets the shaft and takes the commanded motor torque.
//
//   set_shaft(angle, torque)  →  encoder counts  →  SYNC latches, TPDO tells
//   torque RPDO  →  SYNC applies  →  motor_torque_nm()
// Order in a plant step: receive() every frame that has arrived, advance(), transmit() until empty.
// What ends in torque zero: any state but Operation enabled; master's heartbeat lost; no torque RPDO for 1400h:05 ms while enabled;
// leaving NMT Operational while enabled; fault. The reaction to a lost master is 6007h's.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/rig/rig.hpp"
#include "hal/can/fifo.hpp"
#include "hal/can/frame.hpp"
#include "hal/canopen/cia402.hpp"
#include "sim_plant/nodes/object_dictionary.hpp"

namespace trocar::sim_plant {

struct DriveNodeConfig {
  std::uint8_t node{};
  std::int32_t encoder_counts_per_turn{};  // per turn of the joint
  std::int32_t position_offset_counts{};   // what the encoder happens to read at joint angle 0 after power-on
  double rated_torque_nm{};                // of the motor, in front of the gear
  double peak_torque_nm{};                 // of the motor
  double gear_ratio{1};
  double gear_efficiency{1};
};

// Precondition: drive < rig.drives().
[[nodiscard]] DriveNodeConfig make_drive_config(const rig::Rig& rig, std::size_t drive, std::int32_t position_offset_counts = 0) noexcept;

struct DriveNodeCounters {
  std::uint64_t transmit_dropped{};   // answers that found the queue full
  std::uint64_t rpdo_wrong_length{};  // refused, emergency 8210h
  std::uint64_t rpdo_timeouts{};
  std::uint64_t heartbeats_lost{};
  std::uint64_t sdo_aborts{};
  std::uint64_t faults{};
};

class DriveNode {
 public:
  explicit DriveNode(const DriveNodeConfig& config) noexcept;

  void receive(const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void advance(std::int64_t now_ns) noexcept;    // timers: boot-up, heartbeats, timeouts
  bool transmit(hal::CanFrame& frame) noexcept;  // the next frame to send

  // joint_torque_nm: what the motor puts on the joint just now. Values that are not finite are ignored.
  void set_shaft(double joint_angle_rad, double joint_torque_nm) noexcept;
  // Commanded at the motor, in front of the gear; 0 unless Operation enabled in torque mode.
  [[nodiscard]] double motor_torque_nm() const noexcept;

  void trigger_fault(std::uint16_t emergency_code) noexcept;  // as the drive's own protections would
  void restart() noexcept;                                    // power gone and back

  [[nodiscard]] hal::canopen::DriveState state() const noexcept { return state_; }
  [[nodiscard]] hal::canopen::NmtState nmt_state() const noexcept { return nmt_; }
  [[nodiscard]] std::int32_t position_counts() const noexcept { return position_counts_; }
  [[nodiscard]] const ObjectDictionary& objects() const noexcept { return objects_; }
  [[nodiscard]] const DriveNodeCounters& counters() const noexcept { return counters_; }

 private:
  struct Rpdo {
    std::uint16_t communication{};
    std::uint32_t id{};  // with pdo_invalid when off
    std::uint8_t transmission{};
    ObjectDictionary::Mapping mapping{};
    hal::CanFrame pending{};
    bool has_pending{};
  };
  void reboot() noexcept;
  void nmt_command(const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void serve_sdo(const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void configure_pdos() noexcept;
  void accept_rpdo(Rpdo& pdo, const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void apply_rpdo(Rpdo& pdo, std::int64_t now_ns) noexcept;
  void synchronise(std::int64_t now_ns) noexcept;
  void object_written(hal::canopen::Object object, std::int64_t now_ns) noexcept;
  void control(std::uint16_t word, std::int64_t now_ns) noexcept;
  void enter(hal::canopen::DriveState state) noexcept;
  void connection_lost(std::uint16_t emergency_code) noexcept;
  void emergency(std::uint16_t code) noexcept;
  void publish() noexcept;
  void put(const hal::CanFrame& frame) noexcept;

  DriveNodeConfig config_;
  ObjectDictionary objects_;
  hal::canopen::NmtState nmt_{hal::canopen::NmtState::BootUp};
  hal::canopen::DriveState state_{hal::canopen::DriveState::SwitchOnDisabled};
  std::uint16_t last_controlword_{};

  Rpdo torque_rpdo_{};
  Rpdo controlword_rpdo_{};
  std::uint32_t tpdo_id_{};
  std::uint8_t tpdo_transmission_{};
  ObjectDictionary::Mapping tpdo_mapping_{};
  std::uint32_t syncs_{};
  std::int64_t last_torque_rpdo_ns_{};
  std::int64_t next_heartbeat_ns_{};
  std::int64_t master_heard_ns_{};
  bool master_watched_{};  // from its first heartbeat on

  std::int32_t position_counts_{};
  std::int16_t measured_permille_{};
  std::int16_t active_permille_{};
  hal::Fifo<hal::CanFrame, 32> outgoing_{};
  DriveNodeCounters counters_{};
};

}  // namespace trocar::sim_plant
