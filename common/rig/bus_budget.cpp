#include "common/rig/bus_budget.hpp"

namespace trocar::rig {

BusBudget bus_budget(const Rig& rig) noexcept {
  const auto drives = static_cast<std::uint32_t>(rig.drives());
  constexpr std::uint32_t full = worst_case_can_bits(8);
  BusBudget budget;
  budget.bits_per_tick = rig.buses.bitrate_bps / rig.timing.tick_hz;
  budget.drives_cyclic_bits = worst_case_can_bits(0) + full + drives * full;
  budget.drives_peak_bits = budget.drives_cyclic_bits + full;
  budget.sensor_bits = worst_case_can_bits(1) + 2 * full;
  const auto percent = [&](double bits) { return 100.0 * bits / budget.bits_per_tick; };
  budget.drives_cyclic_percent = percent(budget.drives_cyclic_bits);
  budget.drives_peak_percent = percent(budget.drives_peak_bits);
  budget.sensor_percent = percent(budget.sensor_bits);
  const double ticks_per_heartbeat = rig.timing.heartbeat_ms * rig.timing.tick_hz / 1000.0;
  if (ticks_per_heartbeat > 0) budget.heartbeat_percent = percent(drives * worst_case_can_bits(1) / ticks_per_heartbeat);
  return budget;
}

}  // namespace trocar::rig
