// Tables on the terminal, CSV files and figures.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "firmware/control/force_observer.hpp"
#include "tests/benchmarks/observer/judge.hpp"

namespace trocar::bench {

constexpr double force_goal_n = 0.6, rise_goal_s = 0.010;

struct Trial {
  std::string machine{}, method{};
  double tick_hz{}, bandwidth_rad_s{};
  Verdict verdict{};
  control::Admission admission{};  // of observers
  [[nodiscard]] bool met() const { return verdict.worst_n() < force_goal_n && verdict.slowest_rise_s < rise_goal_s; }
};

struct TraceRow {
  double time_s{};
  double hand_n{};
  std::vector<double> found_n{};  // by method
};

void print(const std::vector<Trial>& rows, const std::string& machine, double tick_hz);
// Which bandwidths meet both goals, for each machine, tick and method; and the least error among those that are fast enough.
void print_summary(const std::vector<Trial>& rows);

// observer.csv, observer_trace.csv, observer_trade.svg, observer_trace.svg. Throws std::runtime_error or report::ReportError.
void write(const std::filesystem::path& folder, const std::vector<Trial>& rows, const std::vector<TraceRow>& trace);

}  // namespace trocar::bench
