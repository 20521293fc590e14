// The object dictionary of a simulated drive: its entries, and the checks that a real drive makes before it accepts a value
// (CiA 301, 7.4 and 7.5; abort codes 7.2.4.3.17). Numbers of up to four bytes, and texts.
// Four RPDOs and four TPDOs of up to eight objects. At power-on the first of each exists as CiA 402 has it: controlword in, statusword
// out, both on event; the others do not exist until a master switches them on.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hal/canopen/objects.hpp"
#include "hal/canopen/sdo.hpp"

namespace trocar::sim_plant {

struct DriveIdentity {
  std::uint8_t node{};
  std::uint32_t rated_torque_mnm{};
  std::uint16_t peak_torque_permille{};
};

class ObjectDictionary {
 public:
  static constexpr std::size_t pdos = 4;           // in each direction
  static constexpr std::size_t mapped = 8;         // objects in one PDO
  static constexpr std::size_t text_bytes = 40;    // of the longest text
  static constexpr std::size_t error_history = 4;  // errors that 1003h remembers

  struct Value {
    std::array<std::uint8_t, text_bytes> byte{};
    std::size_t bytes{};
    [[nodiscard]] std::span<const std::uint8_t> all() const noexcept { return std::span{byte}.first(bytes); }
  };

  explicit ObjectDictionary(const DriveIdentity& identity) noexcept;

  // What an SDO client gets. Nothing: done.
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> read(hal::canopen::Object object, Value& value) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> write(hal::canopen::Object object, std::span<const std::uint8_t> value) noexcept;
  // Whether a value of so many bytes may be offered at all; no size: of as many as the object has.
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> accepts(hal::canopen::Object object, std::optional<std::size_t> bytes) const noexcept;
  [[nodiscard]] std::size_t bytes(hal::canopen::Object object) const noexcept;  // 0: unknown

  // The drive's own access; unknown objects read 0 and cannot be set.
  [[nodiscard]] std::uint32_t get(hal::canopen::Object object) const noexcept;
  void set(hal::canopen::Object object, std::uint32_t value) noexcept;
  void remember_error(std::uint16_t code) noexcept;  // in 1003h, the last one first

  void reset_communication() noexcept;  // 1000h … 1FFFh to their power-on values
  void reset_all() noexcept;

  struct Field {
    hal::canopen::Object object{};  // index below 20h: a place holder
    std::uint8_t offset{};
  };
  struct Mapping {
    std::array<Field, mapped> field{};
    std::size_t fields{};
    std::uint8_t bytes{};
  };
  [[nodiscard]] Mapping mapping(std::uint16_t map_index) const noexcept;

 private:
  static constexpr std::size_t capacity = 176;
  enum class Access : std::uint8_t { ReadOnly, ReadWrite };
  struct Entry {
    hal::canopen::Object object{};
    Access access{};
    std::uint32_t power_on{};
    std::uint32_t value{};
  };
  struct Text {
    std::uint16_t index{};
    Access access{};
    Value value{};
    Value power_on{};
  };
  void add(hal::canopen::Object object, Access access, std::uint32_t power_on) noexcept;
  void add_text(std::uint16_t index, Access access, const char* text) noexcept;
  void add_pdo(std::uint16_t communication, std::uint32_t id, bool transmits) noexcept;
  void add_map(std::uint16_t map, hal::canopen::Object first) noexcept;
  [[nodiscard]] const Entry* find(hal::canopen::Object object) const noexcept;
  [[nodiscard]] Entry* find(hal::canopen::Object object) noexcept;
  [[nodiscard]] const Text* find_text(hal::canopen::Object object) const noexcept;
  [[nodiscard]] hal::canopen::SdoAbort missing(std::uint16_t index) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> check(const Entry& entry, std::uint32_t value) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> check_mapping(const Entry& entry, std::uint32_t value) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> check_pdo(const Entry& entry, std::uint32_t value) const noexcept;

  DriveIdentity identity_;
  std::array<Entry, capacity> entry_{};  // by index and subindex
  std::size_t entries_{};
  std::array<Text, 4> text_{};
  std::size_t texts_{};
};

}  // namespace trocar::sim_plant
