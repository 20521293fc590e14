// What an image costs the tick on this machine: a run of common/insertion, not a prediction.
#pragma once

#include <cstddef>

#include "common/model/image.hpp"

namespace trocar::cli {

struct TickCost {
  std::size_t contacts{};     // at the end of the insertion; 0 when the needle found no tissue
  double insert_median_us{};  // 0.1 mm deeper each tick, contacts appearing on the way
  double insert_worst_us{};
  double turn_median_us{};  // all contacts, the base turned a little each tick
  double turn_worst_us{};
};

// Inserts along the longest direction of the candidates, through their middle, +y when none is much longer; then turns.
// Takes less than a second.
[[nodiscard]] TickCost tick_cost(const model::Image& image);

}  // namespace trocar::cli
