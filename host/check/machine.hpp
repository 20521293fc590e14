// What this machine is, as far as it matters to a loop that must wake up in time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace trocar::check {

inline constexpr std::uint64_t unlimited = std::numeric_limits<std::uint64_t>::max();

struct Machine {
  std::string kernel;                             // release
  bool preempt_rt{};                              // /sys/kernel/realtime is 1
  std::string clocksource;                        // what reads the time
  std::vector<int> online, isolated, nohz_full;   // cores
  std::optional<bool> smt;                        // hyper-threads are on; none: the kernel does not say
  std::vector<std::string> governors;             // of the cores' clocks, each name once; empty: none to choose
  std::vector<std::vector<int>> interrupt_cores;  // of every interrupt: where it may run
  std::uint64_t memlock_bytes{};                  // limits of this process, inherited by those that it starts
  std::uint64_t rtprio{};
};

// Files below `root`/proc and `root`/sys; what is missing is left empty. Limits are those of the calling process.
[[nodiscard]] Machine look_at_machine(const std::filesystem::path& root = "/");

// "0-2,5" -> 0 1 2 5. Empty for what is no such list ("(null)", which kernels print for none).
[[nodiscard]] std::vector<int> cores_of(std::string_view list);
// 0 1 2 5 -> "0-2,5"; "none".
[[nodiscard]] std::string to_text(const std::vector<int>& cores);

}  // namespace trocar::check
