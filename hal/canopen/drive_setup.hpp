// What is written to one drive before it may run, and what must read back. A table: the master walks through it from top to bottom,
// one object at a time, and stops at the first that differs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/rig/rig.hpp"
#include "hal/canopen/objects.hpp"

namespace trocar::hal::canopen {

struct SetupStep {
  enum class Expect : std::uint8_t {
    Anything,  // readable is enough
    Value,     // equal to `value` under `mask`
    Near,      // within 1 % or 1 of `value`, whichever is more: the drive stores a rounded figure
    Skip,      // not read back: an intermediate value
  };
  Object object{};
  bool write{};
  std::uint32_t value{};
  Expect expect{Expect::Value};
  std::uint32_t mask{0xFFFF'FFFFu};
  const char* remedy{};  // what a person does when it differs or is refused
};

struct DriveSetup {
  std::array<SetupStep, 64> step{};
  std::size_t steps{};
};

// No torque frame for so long while enabled, 20 ticks: the drive faults by itself.
[[nodiscard]] constexpr std::uint16_t rpdo_timeout_ms(const rig::Rig& rig) noexcept {
  // NOLINTNEXTLINE(bugprone-incorrect-roundings): positive and far from 2^52; std::lround is not constexpr
  return static_cast<std::uint16_t>(20.0 * 1000.0 / rig.timing.tick_hz + 0.5);
}

// Rated torque of the motor (in front of the gear), to which the permille of 6071h, 6072h and 6077h refer.
[[nodiscard]] constexpr double rated_torque_nm(const rig::Actuation& actuation) noexcept {
  return actuation.torque_constant_nm_per_a * actuation.continuous_current_a;
}

// Precondition: drive < rig.drives().
[[nodiscard]] DriveSetup make_drive_setup(const rig::Rig& rig, std::size_t drive) noexcept;

}  // namespace trocar::hal::canopen
