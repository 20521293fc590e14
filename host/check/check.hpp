// What `trocar-rig --check` measured on this machine, and what follows from it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"
#include "common/rig/bus_budget.hpp"
#include "host/check/machine.hpp"

namespace trocar::check {

struct Latency {  // us, nearest rank
  double p50{}, p99{}, p99_99{}, max{};
};

struct SetupItem {
  std::string name;
  bool asked{}, obtained{};
  std::string text;  // what was granted, or what was refused, why, and the remedy
};

struct Figures {
  std::string rig;
  double period_us{};
  double late_tick_us{};          // wake-up later than this is a fault
  double feedback_deadline_us{};  // of each period, waited for the drives
  int cpu{-1};                    // core of the loop; -1: any
  bool real_time{};               // everything asked for was granted, on PREEMPT_RT
  std::uint64_t ticks{}, moving{}, late{};
  LoopCounters loop{};
  Latency wakeup_late, tick;
  std::vector<SetupItem> setup;
};

// Throws config::UserError with file and line when it is no such document.
[[nodiscard]] Figures read_figures(const std::filesystem::path& file);

struct Verdict {
  std::vector<std::string> against;  // what stands against motors, with its remedy; empty: fit for motors
  std::vector<std::string> advice;   // what would help, but was not shown to hurt
  [[nodiscard]] bool fit() const noexcept { return against.empty(); }
};

// under_load: whether the machine was kept busy meanwhile; without that nothing is fit.
[[nodiscard]] Verdict judge(const Figures& figures, const Machine& machine, const rig::BusBudget& budget, bool under_load);

}  // namespace trocar::check
