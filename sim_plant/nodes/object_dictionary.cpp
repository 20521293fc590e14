#include "sim_plant/nodes/object_dictionary.hpp"

namespace trocar::sim_plant {
namespace {

using hal::canopen::Object;
using hal::canopen::SdoAbort;
namespace co = hal::canopen;
namespace object = hal::canopen::object;

constexpr bool is_mapping(std::uint16_t index) noexcept {
  return (index >= 0x1600 && index <= 0x17FF) || (index >= 0x1A00 && index <= 0x1BFF);
}
constexpr bool is_pdo(std::uint16_t index) noexcept { return (index >= 0x1400 && index <= 0x15FF) || (index >= 0x1800 && index <= 0x19FF); }
constexpr Object from_mapping(std::uint32_t entry) noexcept {
  return {static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8), static_cast<std::uint8_t>((entry & 0xFF) / 8)};
}
constexpr std::uint32_t keep(std::uint32_t value, std::uint8_t bytes) noexcept {
  return bytes >= 4 ? value : value & ((1u << (8u * bytes)) - 1u);
}

}  // namespace

ObjectDictionary::ObjectDictionary(const DriveIdentity& identity) noexcept : identity_{identity} {
  const std::uint8_t node = identity.node;
  add(object::device_type, false, 0x0002'0000u | co::profile_402);  // servo drive
  add(object::error_register, false, 0);
  add(object::sync_id, true, co::cob_sync);
  add({0x1016, 0, 1}, false, 1);
  add(object::consumer_heartbeat, true, 0);
  add(object::producer_heartbeat, true, 0);
  add({0x1018, 0, 1}, false, 4);
  add(object::vendor, false, 0);  // 0: no vendor of CAN in Automation
  add(object::product, false, 0x0074726F);
  add({0x1018, 3, 4}, false, 1);
  add({0x1018, 4, 4}, false, node);
  add_pdo(object::torque_rpdo, object::torque_rpdo_map, 0x200u + node, 255);
  add({object::torque_rpdo, 5, 2}, true, 0);
  add_pdo(object::controlword_rpdo, object::controlword_rpdo_map, 0x300u + node, 255);
  add({object::controlword_rpdo, 5, 2}, true, 0);
  add_pdo(object::feedback_tpdo, object::feedback_tpdo_map, 0x180u + node, 255);
  add(object::abort_connection_option, true, 0);
  add(object::error_code, false, 0);
  add(object::controlword, true, 0);
  add(object::statusword, false, 0);
  add(object::quick_stop_option, true, 2);
  add(object::fault_reaction_option, true, 2);
  add(object::mode, true, 0);
  add(object::mode_display, false, 0);
  add(object::position, false, 0);
  add(object::target_torque, true, 0);
  add(object::max_torque, true, identity.peak_torque_permille);
  add(object::rated_torque, false, identity.rated_torque_mnm);
  add(object::torque, false, 0);
  add({0x6502, 0, 4}, false, 1u << 9);  // supported modes: cyclic synchronous torque
}

void ObjectDictionary::add(Object object, bool writable, std::uint32_t power_on) noexcept {
  if (entries_ < capacity) entry_[entries_++] = {object, writable, power_on, power_on};
}

void ObjectDictionary::add_pdo(std::uint16_t communication, std::uint16_t map, std::uint32_t id, std::uint8_t transmission) noexcept {
  add({communication, 0, 1}, false, 5);
  add(object::pdo_id(communication), true, id | co::pdo_invalid);
  add(object::pdo_transmission(communication), true, transmission);
  add(object::map_count(map), true, 0);
  for (std::uint8_t place = 1; place <= 4; ++place) add(object::map_entry(map, place), true, 0);
}

const ObjectDictionary::Entry* ObjectDictionary::find(Object object) const noexcept {
  for (std::size_t i = 0; i < entries_; ++i)
    if (entry_[i].object == object) return &entry_[i];
  return nullptr;
}

ObjectDictionary::Entry* ObjectDictionary::find(Object object) noexcept {
  return const_cast<Entry*>(static_cast<const ObjectDictionary&>(*this).find(object));
}

bool ObjectDictionary::index_exists(std::uint16_t index) const noexcept {
  for (std::size_t i = 0; i < entries_; ++i)
    if (entry_[i].object.index == index) return true;
  return false;
}

std::optional<SdoAbort> ObjectDictionary::read(Object& object, std::uint32_t& value) const noexcept {
  const Entry* entry = find(object);
  if (entry == nullptr) return index_exists(object.index) ? SdoAbort::NoSubindex : SdoAbort::NoObject;
  object.bytes = entry->object.bytes;
  value = entry->value;
  return std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::write(const Object& object, std::uint32_t value) noexcept {
  Entry* entry = find(object);
  if (entry == nullptr) return index_exists(object.index) ? SdoAbort::NoSubindex : SdoAbort::NoObject;
  if (!entry->writable) return SdoAbort::ReadOnly;
  if (object.bytes != 0 && object.bytes != entry->object.bytes) return SdoAbort::WrongLength;
  if (const auto refusal = check(*entry, value)) return refusal;
  entry->value = keep(value, entry->object.bytes);
  return std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::check(const Entry& entry, std::uint32_t value) const noexcept {
  const std::uint16_t index = entry.object.index;
  const std::uint8_t subindex = entry.object.subindex;
  if (is_mapping(index)) {
    const auto communication = static_cast<std::uint16_t>(index - 0x200);
    if ((get(object::pdo_id(communication)) & co::pdo_invalid) == 0) return SdoAbort::DeviceState;
    if (subindex == 0) {
      if (value > 4) return SdoAbort::OutOfRange;
      std::uint32_t bytes = 0;
      for (std::uint8_t place = 1; place <= static_cast<std::uint8_t>(value); ++place) {
        const Object mapped = from_mapping(get(object::map_entry(index, place)));
        if (mapped.bytes == 0) return SdoAbort::NotMappable;
        bytes += mapped.bytes;
      }
      return bytes > 8 ? std::optional{SdoAbort::MappingTooLong} : std::nullopt;
    }
    if (get(object::map_count(index)) != 0) return SdoAbort::DeviceState;
    if (value == 0) return std::nullopt;
    const Object mapped = from_mapping(value);
    if (mapped == object::dummy_int16 && mapped.bytes == 2) return std::nullopt;
    const Entry* target = find(mapped);
    const bool mappable = target != nullptr && target->object.bytes == mapped.bytes && mapped.index >= 0x6000;
    const bool is_rpdo = index < 0x1A00;
    return mappable && (!is_rpdo || target->writable) ? std::nullopt : std::optional{SdoAbort::NotMappable};
  }
  if (is_pdo(index)) {
    const bool on = (get(object::pdo_id(index)) & co::pdo_invalid) == 0;
    if (on && subindex == 1 && (value & co::pdo_invalid) == 0) return SdoAbort::DeviceState;  // switch off before a change
    if (on && subindex == 2) return SdoAbort::DeviceState;
    return std::nullopt;
  }
  if (entry.object == object::mode && value != co::mode_cyclic_torque && value != 0) return SdoAbort::OutOfRange;
  if (entry.object == object::max_torque && value > identity_.peak_torque_permille) return SdoAbort::OutOfRange;
  return std::nullopt;
}

std::uint32_t ObjectDictionary::get(Object object) const noexcept {
  const Entry* entry = find(object);
  return entry == nullptr ? 0 : entry->value;
}

void ObjectDictionary::set(Object object, std::uint32_t value) noexcept {
  if (Entry* entry = find(object)) entry->value = keep(value, entry->object.bytes);
}

void ObjectDictionary::reset_communication() noexcept {
  for (std::size_t i = 0; i < entries_; ++i)
    if (entry_[i].object.index < 0x2000) entry_[i].value = entry_[i].power_on;
}

void ObjectDictionary::reset_all() noexcept {
  for (std::size_t i = 0; i < entries_; ++i) entry_[i].value = entry_[i].power_on;
}

ObjectDictionary::Mapping ObjectDictionary::mapping(std::uint16_t map_index) const noexcept {
  Mapping result;
  const std::uint32_t count = get(object::map_count(map_index));
  for (std::uint8_t place = 1; place <= count && result.fields < result.field.size(); ++place) {
    const Object mapped = from_mapping(get(object::map_entry(map_index, place)));
    result.field[result.fields++] = {mapped, result.bytes};
    result.bytes = static_cast<std::uint8_t>(result.bytes + mapped.bytes);
  }
  return result;
}

}  // namespace trocar::sim_plant
