// Seeded noise that is the same on every machine: integer arithmetic and exact sums only (no logarithm, no library distribution).
// SplitMix64 (Steele, Lea, Flood, OOPSLA 2014) gives the bits; a normal value is the sum of twelve uniform ones minus six
// (Irwin-Hall): mean 0, variance 1, kurtosis 2.9, never beyond 6.
#pragma once

#include <cstdint>

namespace trocar::sim_plant {

class Random {
 public:
  explicit constexpr Random(std::uint64_t seed) noexcept : state_(seed) {}

  constexpr std::uint64_t bits() noexcept {
    state_ += 0x9E3779B97F4A7C15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }

  constexpr double normal() noexcept {
    std::uint64_t sum = 0;  // of twelve 16-bit values
    for (int word = 0; word < 3; ++word)
      for (std::uint64_t b = bits(), part = 0; part < 4; ++part, b >>= 16) sum += b & 0xFFFFu;
    return (static_cast<double>(sum) + 6.0) / 65536.0 - 6.0;  // + 6: the middle of each of the twelve cells
  }

 private:
  std::uint64_t state_;
};

}  // namespace trocar::sim_plant
