// Tables on the terminal, CSV files and figures of the paced run.
#pragma once

#include <filesystem>
#include <vector>

#include "tests/benchmarks/realtime/cyclictest.hpp"
#include "tests/benchmarks/realtime/paced.hpp"

namespace trocar::bench {

struct Rate {
  Paced paced{};
  CyclictestResult cyclictest{};
  [[nodiscard]] double half_period_us() const { return 5e5 / paced.tick_hz; }
};

// 99th percentile of the execution time of ticks with at least contacts_goal contacts, on the wall clock.
[[nodiscard]] double judged_us(const Rate& rate);
// The course was what it should be: Haptic throughout, the contacts there, every step solved, the same in each execution.
[[nodiscard]] bool sound(const Rate& rate);

void print(const Rate& rate);

// realtime.csv (percentiles), realtime_histogram.csv, realtime_slowest.csv, realtime_execution.svg, realtime_lateness.svg. Throws
// std::runtime_error or report::ReportError.
void write(const std::filesystem::path& folder, const std::vector<Rate>& rates);

}  // namespace trocar::bench
