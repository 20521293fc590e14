// The object dictionary of a simulated drive: fixed entries, values of up to four bytes, and the checks that a real drive makes
// before it accepts a value (CiA 301, 7.4; abort codes 7.2.4.3.17).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

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
  explicit ObjectDictionary(const DriveIdentity& identity) noexcept;

  // What an SDO client gets. Nothing: done.
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> read(hal::canopen::Object& object /* bytes are filled in */,
                                                           std::uint32_t& value) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> write(const hal::canopen::Object& object, std::uint32_t value) noexcept;

  // The drive's own access; unknown objects read 0 and cannot be set.
  [[nodiscard]] std::uint32_t get(hal::canopen::Object object) const noexcept;
  void set(hal::canopen::Object object, std::uint32_t value) noexcept;

  void reset_communication() noexcept;  // 1000h … 1FFFh to their power-on values
  void reset_all() noexcept;

  struct Field {
    hal::canopen::Object object{};  // index below 20h: a place holder
    std::uint8_t offset{};
  };
  struct Mapping {
    std::array<Field, 4> field{};
    std::size_t fields{};
    std::uint8_t bytes{};
  };
  [[nodiscard]] Mapping mapping(std::uint16_t map_index) const noexcept;

 private:
  static constexpr std::size_t capacity = 64;
  struct Entry {
    hal::canopen::Object object{};
    bool writable{};
    std::uint32_t power_on{};
    std::uint32_t value{};
  };
  void add(hal::canopen::Object object, bool writable, std::uint32_t power_on) noexcept;
  void add_pdo(std::uint16_t communication, std::uint16_t map, std::uint32_t id, std::uint8_t transmission) noexcept;
  [[nodiscard]] const Entry* find(hal::canopen::Object object) const noexcept;
  [[nodiscard]] Entry* find(hal::canopen::Object object) noexcept;
  [[nodiscard]] bool index_exists(std::uint16_t index) const noexcept;
  [[nodiscard]] std::optional<hal::canopen::SdoAbort> check(const Entry& entry, std::uint32_t value) const noexcept;

  DriveIdentity identity_;
  std::array<Entry, capacity> entry_{};
  std::size_t entries_{};
};

}  // namespace trocar::sim_plant
