#include "hal/canopen/drive_setup.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::hal::canopen {
namespace {

using Expect = SetupStep::Expect;
constexpr const char* remedy_heartbeat = "the drive must support heartbeats with this time; change heartbeat_ms in the rig file";
constexpr const char* remedy_option = "the drive cannot be trusted to stop as asked; check its firmware";
constexpr const char* remedy_pdo = "the drive needs a free PDO mapping; check its firmware and restore its defaults (1011h)";

class Builder {
 public:
  explicit Builder(DriveSetup& setup) noexcept : setup_{setup} {}
  void add(const SetupStep& step) noexcept {
    if (setup_.steps < setup_.step.size()) setup_.step[setup_.steps++] = step;
  }
  void write(Object object, std::uint32_t value, const char* remedy) noexcept {
    add({.object = object, .write = true, .value = value, .remedy = remedy});
  }
  // CiA 301 wants this order: PDO off, mapping emptied, entries, their number, PDO on.
  template <std::size_t N>
  void pdo(std::uint16_t communication, std::uint16_t map, std::uint32_t id, std::uint8_t transmission,
           const std::array<Object, N>& objects, std::uint16_t event_ms) noexcept {
    add({.object = object::pdo_id(communication), .write = true, .value = id | pdo_invalid, .expect = Expect::Skip, .remedy = remedy_pdo});
    write(object::pdo_transmission(communication), transmission, remedy_pdo);
    if (event_ms != 0) write(object::pdo_event_ms(communication), event_ms, remedy_pdo);
    add({.object = object::map_count(map), .write = true, .value = 0, .expect = Expect::Skip, .remedy = remedy_pdo});
    for (std::size_t i = 0; i < N; ++i) write(object::map_entry(map, static_cast<std::uint8_t>(i + 1)), mapping(objects[i]), remedy_pdo);
    write(object::map_count(map), N, remedy_pdo);
    add({.object = object::pdo_id(communication),
         .write = true,
         .value = id,
         .expect = Expect::Value,
         .mask = pdo_invalid | cob_mask,
         .remedy = remedy_pdo});
  }

 private:
  DriveSetup& setup_;
};

}  // namespace

DriveSetup make_drive_setup(const rig::Rig& rig, std::size_t drive) noexcept {
  const std::uint8_t node = rig.buses.drive_node[drive];
  const rig::Actuation& actuation = rig.actuation;
  DriveSetup setup;
  Builder b{setup};
  b.add({.object = object::device_type,
         .value = profile_402,
         .mask = 0xFFFFu,
         .remedy = "this node is no CiA 402 drive; correct drive_node in the rig file"});
  b.add({.object = object::vendor, .expect = Expect::Anything, .remedy = "every CANopen node must have an identity"});
  b.add({.object = object::product, .expect = Expect::Anything, .remedy = "every CANopen node must have an identity"});
  b.add({.object = object::rated_torque,
         .value = static_cast<std::uint32_t>(std::lround(std::clamp(1000.0 * rated_torque_nm(actuation), 0.0, 1e9))),
         .expect = Expect::Near,
         .remedy = "torque_constant_nm_per_a times continuous_current_a (mN m) of the rig file must be the drive's rated torque"});
  b.write(
      object::max_torque,
      static_cast<std::uint32_t>(std::lround(std::clamp(1000.0 * actuation.peak_current_a / actuation.continuous_current_a, 0.0, 32767.0))),
      "the drive does not allow the rig file's peak_current_a");
  b.write(object::consumer_heartbeat,
          (std::uint32_t{rig.buses.master_node} << 16) | std::min<std::uint32_t>(rig.timing.heartbeat_timeout_ms, 0xFFFF),
          remedy_heartbeat);
  b.write(object::producer_heartbeat, std::min<std::uint32_t>(rig.timing.heartbeat_ms, 0xFFFF), remedy_heartbeat);
  b.write(object::abort_connection_option, abort_connection_fault, remedy_option);
  b.write(object::quick_stop_option, quick_stop_ramp, remedy_option);
  b.write(object::fault_reaction_option, fault_reaction_disable, remedy_option);
  b.add({.object = object::mode,
         .write = true,
         .value = mode_cyclic_torque,
         .expect = Expect::Skip,
         .remedy = "the drive has no cyclic synchronous torque mode"});
  b.add({.object = object::mode_display, .value = mode_cyclic_torque, .remedy = "the drive has no cyclic synchronous torque mode"});

  std::array<Object, capacity::drives> torque_words{};
  torque_words.fill(object::dummy_int16);
  torque_words[drive] = object::target_torque;
  b.pdo(object::torque_rpdo, object::torque_rpdo_map, cob_torque, transmission_every_sync, torque_words, rpdo_timeout_ms(rig));
  b.pdo(object::controlword_rpdo, object::controlword_rpdo_map, cob_controlword(node), transmission_event, std::array{object::controlword},
        0);
  b.pdo(object::feedback_tpdo, object::feedback_tpdo_map, cob_feedback(node) | pdo_no_remote, transmission_every_sync,
        std::array{object::position, object::torque, object::statusword}, 0);
  return setup;
}

}  // namespace trocar::hal::canopen
