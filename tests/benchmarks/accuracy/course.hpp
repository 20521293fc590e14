// A real insertion, tick by tick: how continuous the base force is, and what a tick takes.
#pragma once

#include "tests/benchmarks/accuracy/method.hpp"

namespace trocar::bench {

struct Course {
  // Over each 0.1 mm: change of the base force less the density over what was newly covered, along the shaft.
  double worst_jump_mn{};
  double worst_lateral_change_mn{};  // over each 0.1 mm, for comparison: lateral forces are the tissue's and need not vanish
  double median_us{}, percentile99_us{};
  std::size_t contacts{};
  insertion::Status status{};  // worst of all ticks
};

// From 1 mm before the tissue to the depth, 10 um a tick (10 mm/s).
[[nodiscard]] Course insert(const Compiled& compiled, contact::Method method, const Path& path, double depth_m);

// Explicit contacts, all present from the start: median tick, us, of a push from rest through the same motion.
[[nodiscard]] double push_explicit_us(const Compiled& compiled, const Path& path, double depth_m);

}  // namespace trocar::bench
