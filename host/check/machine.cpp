#include "host/check/machine.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <system_error>

namespace trocar::check {

namespace {

namespace fs = std::filesystem;

std::string first_line(const fs::path& file) {
  std::string line;
  std::ifstream in(file);
  std::getline(in, line);
  return line;
}

std::uint64_t limit_of(__rlimit_resource resource) {
  rlimit limit{};
  getrlimit(resource, &limit);
  return limit.rlim_cur == RLIM_INFINITY ? unlimited : static_cast<std::uint64_t>(limit.rlim_cur);
}

std::vector<fs::path> entries(const fs::path& folder) {
  std::vector<fs::path> all;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) all.push_back(at->path());
  return all;
}

}  // namespace

std::vector<int> cores_of(std::string_view list) {
  std::vector<int> cores;
  const char* at = list.data();
  const char* const end = at + list.size();
  while (at != end) {
    int first = 0;
    auto read = std::from_chars(at, end, first);
    if (read.ec != std::errc{} || first < 0) return {};
    int last = first;
    if (read.ptr != end && *read.ptr == '-') read = std::from_chars(read.ptr + 1, end, last);
    constexpr int most = 65536;
    if (read.ec != std::errc{} || last < first || last >= most) return {};
    for (int core = first; core <= last; ++core) cores.push_back(core);
    at = read.ptr;
    if (at != end && *at++ != ',') return {};
  }
  return cores;
}

std::string to_text(const std::vector<int>& cores) {
  std::string out;
  for (std::size_t i = 0; i < cores.size();) {
    std::size_t last = i;
    while (last + 1 < cores.size() && cores[last + 1] == cores[last] + 1) ++last;
    if (!out.empty()) out += ',';
    out += last > i ? fmt::format("{}-{}", cores[i], cores[last]) : fmt::format("{}", cores[i]);
    i = last + 1;
  }
  return out.empty() ? "none" : out;
}

Machine look_at_machine(const fs::path& root) {
  const fs::path cpu = root / "sys/devices/system/cpu";
  Machine machine;
  machine.kernel = first_line(root / "proc/sys/kernel/osrelease");
  machine.preempt_rt = first_line(root / "sys/kernel/realtime") == "1";
  machine.clocksource = first_line(root / "sys/devices/system/clocksource/clocksource0/current_clocksource");
  machine.online = cores_of(first_line(cpu / "online"));
  machine.isolated = cores_of(first_line(cpu / "isolated"));
  machine.nohz_full = cores_of(first_line(cpu / "nohz_full"));
  if (const std::string smt = first_line(cpu / "smt/active"); !smt.empty()) machine.smt = smt == "1";
  for (const int core : machine.online) {
    const std::string governor = first_line(cpu / fmt::format("cpu{}", core) / "cpufreq/scaling_governor");
    if (!governor.empty() && std::ranges::find(machine.governors, governor) == machine.governors.end())
      machine.governors.push_back(governor);
  }
  for (const fs::path& interrupt : entries(root / "proc/irq"))
    if (const auto cores = cores_of(first_line(interrupt / "effective_affinity_list")); !cores.empty())
      machine.interrupt_cores.push_back(cores);
  machine.memlock_bytes = limit_of(RLIMIT_MEMLOCK);
  machine.rtprio = limit_of(RLIMIT_RTPRIO);
  return machine;
}

}  // namespace trocar::check
