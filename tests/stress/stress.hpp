// Counts and checks that the stress tests share.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "tests/reference/allocations/allocations.hpp"

namespace trocar::stress {

using reference::allocations;

// Full counts only when asked for (./run stress).
[[nodiscard]] inline bool full() {
  const char* wanted = std::getenv("TROCAR_STRESS");
  return wanted != nullptr && std::string_view(wanted) == "full";
}
[[nodiscard]] inline long counts(long short_run, long full_run) { return full() ? full_run : short_run; }

// FNV-1a over the bits of numbers.
class Fingerprint {
 public:
  void add(double value) noexcept {
    hash_ = (hash_ ^ std::bit_cast<std::uint64_t>(value)) * 0x100000001B3U;
    hash_ ^= hash_ >> 29U;
  }
  [[nodiscard]] std::uint64_t value() const noexcept { return hash_; }

 private:
  std::uint64_t hash_{0xCBF29CE484222325U};
};

}  // namespace trocar::stress
