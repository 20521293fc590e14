// One servo drive as it looks from the wire: CANopen slave (CiA 301) with a CiA 402 state machine in cyclic synchronous torque mode.
// It knows nothing of mechanics: the plant sets the shaft and takes the commanded motor torque.
//
//   set_shaft(angle, torque)  →  encoder counts  →  SYNC latches, TPDO tells
//   torque RPDO  →  SYNC applies  →  motor_torque_nm()
// Order in a plant step: receive() every frame that has arrived, advance(), transmit() until empty.
// What ends in torque zero: any state but Operation enabled; master's heartbeat or node guarding lost; an RPDO that does not come for
// its 14xxh:05 ms while enabled; leaving NMT Operational while enabled; fault. The reaction to a lost master is 6007h's.
// A TPDO on event (254, 255) is sent when the drive becomes operational, when anything in it but position and torque changes, after
// 18xxh:05 ms, and no sooner than 18xxh:03 after the one before.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/rig/rig.hpp"
#include "hal/can/fifo.hpp"
#include "hal/can/frame.hpp"
#include "hal/canopen/cia402.hpp"
#include "sim_plant/nodes/object_dictionary.hpp"
#include "sim_plant/nodes/sdo_server.hpp"

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
  std::uint64_t heartbeats_lost{};  // or node guarding
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
    std::uint32_t id{};  // with pdo_invalid when off
    std::uint8_t transmission{};
    std::int64_t deadline_ns{};  // 0: none
    bool has_torque{};
    ObjectDictionary::Mapping mapping{};
    hal::CanFrame pending{};
    bool has_pending{};
    std::int64_t heard_ns{};
  };
  struct Tpdo {
    std::uint32_t id{};
    std::uint8_t transmission{};
    std::int64_t inhibit_ns{};
    std::int64_t event_ns{};
    ObjectDictionary::Mapping mapping{};
    hal::CanFrame last{};
    bool sent{};  // since the drive became operational
    std::int64_t sent_ns{};
    [[nodiscard]] bool exists() const noexcept { return (id & hal::canopen::pdo_invalid) == 0; }
    [[nodiscard]] bool on_event() const noexcept { return transmission >= 254; }
  };
  void reboot() noexcept;
  void nmt_command(const hal::CanFrame& frame) noexcept;
  void answer_remote(const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void go_to(hal::canopen::NmtState state) noexcept;
  void configure_pdos() noexcept;
  void configure_services() noexcept;
  void supervise_master(std::int64_t now_ns) noexcept;
  void master_lost() noexcept;
  [[nodiscard]] hal::CanFrame fill(const Tpdo& pdo) const noexcept;
  void send_tpdo(Tpdo& pdo, const hal::CanFrame& frame, std::int64_t now_ns) noexcept;
  void send_events(std::int64_t now_ns) noexcept;
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

  SdoServer sdo_;
  // What the objects of the communication profile say, taken over whenever one of them is written.
  std::array<Rpdo, ObjectDictionary::pdos> rpdo_{};
  std::array<Tpdo, ObjectDictionary::pdos> tpdo_{};
  std::uint32_t sync_id_{};
  std::uint32_t watched_id_{};  // heartbeats of this identifier; pdo_invalid: none
  std::int64_t watched_ns_{};
  std::int64_t life_ns_{};    // node guarding; 0: off
  std::int64_t period_ns_{};  // of the own heartbeat; 0: off

  std::uint32_t syncs_{};
  std::int64_t next_heartbeat_ns_{};
  std::int64_t master_heard_ns_{};
  bool master_watched_{};  // from its first heartbeat on
  std::int64_t guarded_ns_{};
  bool guarded_{};  // from the first request on
  std::uint8_t guard_toggle_{};

  std::int32_t position_counts_{};
  std::int16_t measured_permille_{};
  std::int16_t active_permille_{};
  hal::Fifo<hal::CanFrame, 32> outgoing_{};
  DriveNodeCounters counters_{};
};

}  // namespace trocar::sim_plant
