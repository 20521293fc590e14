#include "sim_plant/nodes/object_dictionary.hpp"

#include <algorithm>
#include <cstring>

namespace trocar::sim_plant {
namespace {

using hal::canopen::Object;
using hal::canopen::SdoAbort;
namespace co = hal::canopen;
namespace object = hal::canopen::object;

constexpr std::uint32_t extended_id = 0x2000'0000u;  // bit 29 of an identifier entry: this drive has 11 bits only
constexpr std::uint32_t sync_producer = 0x4000'0000u;

constexpr bool is_mapping(std::uint16_t index) noexcept {
  return (index >= 0x1600 && index <= 0x17FF) || (index >= 0x1A00 && index <= 0x1BFF);
}
constexpr bool is_pdo(std::uint16_t index) noexcept { return (index >= 0x1400 && index <= 0x15FF) || (index >= 0x1800 && index <= 0x19FF); }
constexpr bool is_transmitted(std::uint16_t index) noexcept { return index >= 0x1800; }
constexpr Object from_mapping(std::uint32_t entry) noexcept {
  return {static_cast<std::uint16_t>(entry >> 16), static_cast<std::uint8_t>(entry >> 8), static_cast<std::uint8_t>((entry & 0xFF) / 8)};
}
// Data types as place holders in an RPDO: INTEGER8, 16, 32, UNSIGNED8, 16, 32.
constexpr bool is_place_holder(std::uint32_t entry) noexcept {
  constexpr std::array<std::uint32_t, 6> bits{8, 16, 32, 8, 16, 32};
  for (std::uint32_t type = 2; type <= 7; ++type)
    if (entry == ((type << 16) | bits[type - 2])) return true;
  return false;
}
constexpr std::uint32_t keep(std::uint32_t value, std::uint8_t bytes) noexcept {
  return bytes >= 4 ? value : value & ((1u << (8u * bytes)) - 1u);
}
constexpr std::uint32_t key(Object object) noexcept { return (std::uint32_t{object.index} << 8) | object.subindex; }
// Identifiers that no PDO may take (CiA 301, table 73).
constexpr bool is_reserved(std::uint32_t id) noexcept {
  return id <= 0x7F || (id >= 0x101 && id <= 0x180) || (id >= 0x581 && id <= 0x5FF) || (id >= 0x601 && id <= 0x67F) || id >= 0x6E0;
}

}  // namespace

// In the order of index and subindex: find() relies on it.
ObjectDictionary::ObjectDictionary(const DriveIdentity& identity) noexcept : identity_{identity} {
  constexpr Access ro = Access::ReadOnly;
  constexpr Access rw = Access::ReadWrite;
  const std::uint8_t node = identity.node;
  const auto device_type = 0x0002'0000u | co::profile_402;  // servo drive
  add(object::device_type, ro, device_type);
  add(object::error_register, ro, 0);
  add(object::error_count, rw, 0);
  for (std::uint8_t i = 1; i <= error_history; ++i) add({object::error_count.index, i, 4}, ro, 0);
  add(object::sync_id, rw, co::cob_sync);
  add({0x1006, 0, 4}, rw, 0);  // communication cycle period, us
  add_text(0x1008, ro, "trocar simulated drive");
  add_text(0x1009, ro, "simulated");
  add_text(0x100A, ro, "1");
  add(object::guard_time, rw, 0);
  add(object::life_time_factor, rw, 0);
  add(object::emergency_id, rw, co::cob_emergency(node));
  add({0x1016, 0, 1}, ro, 1);
  add(object::consumer_heartbeat, rw, 0);
  add(object::producer_heartbeat, rw, 0);
  add({0x1018, 0, 1}, ro, 4);
  add(object::vendor, ro, 0);  // 0: no vendor of CAN in Automation
  add(object::product, ro, 0x0074726F);
  add({0x1018, 3, 4}, ro, 1);
  add({0x1018, 4, 4}, ro, node);
  add({0x1029, 0, 1}, ro, 1);
  add(object::error_behaviour, rw, 0);
  add({0x1200, 0, 1}, ro, 2);
  add({0x1200, 1, 4}, ro, co::cob_sdo_request(node));
  add({0x1200, 2, 4}, ro, co::cob_sdo_response(node));
  for (std::uint16_t i = 0; i < pdos; ++i)
    add_pdo(static_cast<std::uint16_t>(0x1400 + i), (0x200u + 0x100u * i + node) | (i == 0 ? 0 : co::pdo_invalid), false);
  for (std::uint16_t i = 0; i < pdos; ++i) add_map(static_cast<std::uint16_t>(0x1600 + i), i == 0 ? object::controlword : Object{});
  for (std::uint16_t i = 0; i < pdos; ++i)
    add_pdo(static_cast<std::uint16_t>(0x1800 + i), (0x180u + 0x100u * i + node) | co::pdo_no_remote | (i == 0 ? 0 : co::pdo_invalid),
            true);
  for (std::uint16_t i = 0; i < pdos; ++i) add_map(static_cast<std::uint16_t>(0x1A00 + i), i == 0 ? object::statusword : Object{});
  add(object::abort_connection_option, rw, 0);
  add(object::error_code, ro, 0);
  add(object::controlword, rw, 0);
  add(object::statusword, ro, 0);
  add(object::quick_stop_option, rw, 2);
  add(object::fault_reaction_option, rw, 2);
  add(object::mode, rw, 0);
  add(object::mode_display, ro, 0);
  add(object::position, ro, 0);
  add(object::target_torque, rw, 0);
  add(object::max_torque, rw, identity.peak_torque_permille);
  add(object::rated_torque, ro, identity.rated_torque_mnm);
  add(object::torque, ro, 0);
  add_text(0x6403, rw, "");          // catalogue number of the motor, for who installs it to note
  add({0x6502, 0, 4}, ro, 1u << 9);  // supported modes: cyclic synchronous torque
  add({0x67FF, 0, 4}, ro, device_type);
}

void ObjectDictionary::add(Object object, Access access, std::uint32_t power_on) noexcept {
  if (entries_ < capacity) entry_[entries_++] = {object, access, power_on, power_on};
}

void ObjectDictionary::add_text(std::uint16_t index, Access access, const char* text) noexcept {
  Value value;
  value.bytes = std::min(std::strlen(text), text_bytes);
  std::copy_n(text, value.bytes, value.byte.begin());
  if (texts_ < text_.size()) text_[texts_++] = {index, access, value, value};
}

void ObjectDictionary::add_pdo(std::uint16_t communication, std::uint32_t id, bool transmits) noexcept {
  add({communication, 0, 1}, Access::ReadOnly, 5);
  add(object::pdo_id(communication), Access::ReadWrite, id);
  add(object::pdo_transmission(communication), Access::ReadWrite, co::transmission_event);
  if (transmits) add(object::pdo_inhibit(communication), Access::ReadWrite, 0);
  add(object::pdo_event_ms(communication), Access::ReadWrite, 0);
}

void ObjectDictionary::add_map(std::uint16_t map, Object first) noexcept {
  add(object::map_count(map), Access::ReadWrite, first.bytes == 0 ? 0 : 1);
  for (std::uint8_t place = 1; place <= mapped; ++place)
    add(object::map_entry(map, place), Access::ReadWrite, place == 1 && first.bytes != 0 ? co::mapping(first) : 0);
}

const ObjectDictionary::Entry* ObjectDictionary::find(Object object) const noexcept {
  const Entry* const end = entry_.data() + entries_;
  const Entry* const found = std::lower_bound(entry_.data(), end, key(object),
                                              [](const Entry& entry, std::uint32_t wanted) { return key(entry.object) < wanted; });
  return found != end && found->object == object ? found : nullptr;
}

ObjectDictionary::Entry* ObjectDictionary::find(Object object) noexcept {
  return const_cast<Entry*>(static_cast<const ObjectDictionary&>(*this).find(object));
}

const ObjectDictionary::Text* ObjectDictionary::find_text(Object object) const noexcept {
  for (std::size_t i = 0; i < texts_; ++i)
    if (text_[i].index == object.index && object.subindex == 0) return &text_[i];
  return nullptr;
}

SdoAbort ObjectDictionary::missing(std::uint16_t index) const noexcept {
  const bool known = std::any_of(entry_.begin(), entry_.begin() + entries_, [&](const Entry& e) { return e.object.index == index; }) ||
                     find_text({index, 0, 0}) != nullptr;
  return known ? SdoAbort::NoSubindex : SdoAbort::NoObject;
}

std::size_t ObjectDictionary::bytes(Object object) const noexcept {
  if (const Entry* entry = find(object)) return entry->object.bytes;
  const Text* text = find_text(object);
  return text == nullptr ? 0 : text->value.bytes;
}

std::optional<SdoAbort> ObjectDictionary::read(Object object, Value& value) const noexcept {
  if (const Text* text = find_text(object)) {
    value = text->value;
    return std::nullopt;
  }
  const Entry* entry = find(object);
  if (entry == nullptr) return missing(object.index);
  if (object.index == object::error_count.index && object.subindex > get(object::error_count)) return SdoAbort::NoData;
  value.bytes = entry->object.bytes;
  for (std::size_t i = 0; i < value.bytes; ++i) value.byte[i] = static_cast<std::uint8_t>(entry->value >> (8 * i));
  return std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::accepts(Object object, std::optional<std::size_t> bytes) const noexcept {
  const Entry* entry = find(object);
  const Text* text = find_text(object);
  if (entry == nullptr && text == nullptr) return missing(object.index);
  if ((entry != nullptr ? entry->access : text->access) == Access::ReadOnly) return SdoAbort::ReadOnly;
  if (!bytes) return std::nullopt;
  if (text != nullptr) return *bytes > text_bytes ? std::optional{SdoAbort::TooLong} : std::nullopt;
  return *bytes != entry->object.bytes ? std::optional{SdoAbort::WrongLength} : std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::write(Object object, std::span<const std::uint8_t> value) noexcept {
  if (const auto refusal = accepts(object, value.size())) return refusal;
  if (const Text* found = find_text(object)) {
    Value& text = const_cast<Text*>(found)->value;
    text.bytes = value.size();
    std::copy(value.begin(), value.end(), text.byte.begin());
    return std::nullopt;
  }
  Entry& entry = *find(object);
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < value.size(); ++i) number |= std::uint32_t{value[i]} << (8 * i);
  if (const auto refusal = check(entry, number)) return refusal;
  entry.value = number;
  return std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::check(const Entry& entry, std::uint32_t value) const noexcept {
  if (is_mapping(entry.object.index)) return check_mapping(entry, value);
  if (is_pdo(entry.object.index)) return check_pdo(entry, value);
  const auto only_if = [](bool good) { return good ? std::nullopt : std::optional{SdoAbort::OutOfRange}; };
  if (entry.object == object::error_count) return only_if(value == 0);  // 0 clears the history
  if (entry.object == object::sync_id) return only_if((value & (extended_id | sync_producer)) == 0);
  if (entry.object == object::emergency_id) return only_if((value & extended_id) == 0 && (value & co::cob_mask) > 0x7F);
  if (entry.object == object::consumer_heartbeat) return only_if((value >> 16) <= 127);
  if (entry.object == object::error_behaviour) return only_if(value <= 2);
  if (entry.object == object::mode) return only_if(value == co::mode_cyclic_torque || value == 0);
  if (entry.object == object::max_torque) return only_if(value <= identity_.peak_torque_permille);
  return std::nullopt;
}

std::optional<SdoAbort> ObjectDictionary::check_mapping(const Entry& entry, std::uint32_t value) const noexcept {
  const std::uint16_t index = entry.object.index;
  const auto communication = static_cast<std::uint16_t>(index - 0x200);
  if ((get(object::pdo_id(communication)) & co::pdo_invalid) == 0) return SdoAbort::DeviceState;
  if (entry.object.subindex == 0) {
    if (value > mapped) return SdoAbort::OutOfRange;
    std::uint32_t length = 0;
    for (std::uint8_t place = 1; place <= static_cast<std::uint8_t>(value); ++place) {
      const Object inside = from_mapping(get(object::map_entry(index, place)));
      if (inside.bytes == 0) return SdoAbort::NotMappable;
      length += inside.bytes;
    }
    return length > 8 ? std::optional{SdoAbort::MappingTooLong} : std::nullopt;
  }
  if (get(object::map_count(index)) != 0) return SdoAbort::DeviceState;
  if (value == 0) return std::nullopt;
  const bool received = !is_transmitted(index);
  if (received && is_place_holder(value)) return std::nullopt;
  const Entry* target = find(from_mapping(value));
  if (target == nullptr) return find_text(from_mapping(value)) != nullptr ? SdoAbort::NotMappable : missing(from_mapping(value).index);
  const bool mappable =
      co::mapping(target->object) == value && (target->object.index >= 0x6000 || target->object == object::error_register);
  return mappable && (!received || target->access == Access::ReadWrite) ? std::nullopt : std::optional{SdoAbort::NotMappable};
}

std::optional<SdoAbort> ObjectDictionary::check_pdo(const Entry& entry, std::uint32_t value) const noexcept {
  const std::uint16_t index = entry.object.index;
  const std::uint32_t id = get(object::pdo_id(index));
  const bool on = (id & co::pdo_invalid) == 0;
  switch (entry.object.subindex) {
    case 1:
      if ((value & extended_id) != 0) return SdoAbort::OutOfRange;
      if ((value & co::pdo_invalid) != 0) return std::nullopt;
      if (is_reserved(value & co::cob_mask)) return SdoAbort::OutOfRange;
      return on && (value & co::cob_mask) != (id & co::cob_mask) ? std::optional{SdoAbort::DeviceState}
                                                                 : std::nullopt;  // off before a change
    case 2:
      return value <= 240 || value >= 254 ? std::nullopt : std::optional{SdoAbort::OutOfRange};
    case 3:
      return on ? std::optional{SdoAbort::DeviceState} : std::nullopt;
    default:
      return std::nullopt;
  }
}

std::uint32_t ObjectDictionary::get(Object object) const noexcept {
  const Entry* entry = find(object);
  return entry == nullptr ? 0 : entry->value;
}

void ObjectDictionary::set(Object object, std::uint32_t value) noexcept {
  if (Entry* entry = find(object)) entry->value = keep(value, entry->object.bytes);
}

void ObjectDictionary::remember_error(std::uint16_t code) noexcept {
  const auto place = [](std::size_t i) { return Object{object::error_count.index, static_cast<std::uint8_t>(i), 4}; };
  for (std::size_t i = error_history; i > 1; --i) set(place(i), get(place(i - 1)));
  set(place(1), code);
  set(object::error_count, std::min<std::uint32_t>(get(object::error_count) + 1, error_history));
}

void ObjectDictionary::reset_communication() noexcept {
  for (std::size_t i = 0; i < entries_; ++i)
    if (entry_[i].object.index < 0x2000) entry_[i].value = entry_[i].power_on;
}

void ObjectDictionary::reset_all() noexcept {
  for (std::size_t i = 0; i < entries_; ++i) entry_[i].value = entry_[i].power_on;
  for (std::size_t i = 0; i < texts_; ++i) text_[i].value = text_[i].power_on;
}

ObjectDictionary::Mapping ObjectDictionary::mapping(std::uint16_t map_index) const noexcept {
  Mapping result;
  const std::uint32_t count = get(object::map_count(map_index));
  for (std::uint8_t place = 1; place <= count && result.fields < result.field.size(); ++place) {
    const Object inside = from_mapping(get(object::map_entry(map_index, place)));
    result.field[result.fields++] = {inside, result.bytes};
    result.bytes = static_cast<std::uint8_t>(result.bytes + inside.bytes);
  }
  return result;
}

}  // namespace trocar::sim_plant
