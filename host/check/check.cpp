#include "host/check/check.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "common/config/document.hpp"

namespace trocar::check {

namespace {

constexpr const char* remedy = "give the output of trocar-rig --check";

bool contains(const std::vector<int>& cores, int core) { return std::ranges::find(cores, core) != cores.end(); }

std::uint64_t count(const config::Table& table, const char* key) {
  return static_cast<std::uint64_t>(table.integer(key, 0, std::int64_t{1} << 53, remedy));
}

Latency latency(const config::Table& table) {
  const auto at = [&](const char* key) { return table.number(key, {-1e12, 1e12}, remedy); };
  return {at("p50"), at("p99"), at("p99_99"), at("max")};
}

}  // namespace

Figures read_figures(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  Figures f;
  f.rig = root.text("rig", remedy);
  f.period_us = root.number("period_us", {0.0, 1e9}, remedy);
  f.late_tick_us = root.number("late_tick_us", {0.0, 1e9}, remedy);
  f.feedback_deadline_us = root.number("feedback_deadline_us", {0.0, 1e9}, remedy);
  f.cpu = static_cast<int>(root.integer("cpu", -1, 1 << 20, remedy));
  f.real_time = root.flag("real_time", remedy);
  f.ticks = count(root, "ticks");
  f.moving = count(root, "moving");
  f.late = count(root, "late");
  f.loop = {.overruns = count(root, "overruns"),
            .minor_faults = count(root, "minor_faults"),
            .major_faults = count(root, "major_faults"),
            .preemptions = count(root, "preemptions"),
            .allocations = count(root, "allocations"),
            .armed_page_faults = count(root, "armed_page_faults"),
            .armed_allocations = count(root, "armed_allocations")};
  f.wakeup_late = latency(root.table("wakeup_late_us"));
  f.tick = latency(root.table("tick_us"));
  for (const config::Table& item : root.tables("setup"))
    f.setup.push_back({item.text("name", remedy), item.flag("asked", remedy), item.flag("obtained", remedy), item.text("text", remedy)});
  document.refuse_unknown_keys();
  return f;
}

Verdict judge(const Figures& f, const Machine& m, const rig::BusBudget& budget, bool under_load) {
  Verdict v;
  for (const SetupItem& item : f.setup)
    if (item.asked && !item.obtained) v.against.push_back(item.text);
  if (f.moving == 0)
    v.against.emplace_back("the controller never came to move, so that nothing was measured of it: give it longer (--seconds)");
  if (f.late > 0)
    v.against.push_back(
        fmt::format("{} of {} wake-ups came more than {:g} us late, the worst {:.0f} us: see firmware/targets/linux/REALTIME.md", f.late,
                    f.ticks, f.late_tick_us, f.wakeup_late.max));
  if (f.loop.overruns > 0)
    v.against.push_back(
        fmt::format("{} of {} ticks ended after the next one was due: see firmware/targets/linux/REALTIME.md", f.loop.overruns, f.ticks));
  if (f.loop.armed_page_faults > 0)
    v.against.push_back(fmt::format("{} page faults in the loop while armed: lock its memory", f.loop.armed_page_faults));
  if (f.loop.armed_allocations > 0)
    v.against.push_back(
        fmt::format("{} allocations in the loop while armed: tell the maintainers, there must be none", f.loop.armed_allocations));
  if (!budget.fits())
    v.against.emplace_back("the rig's frames do not fit on its buses: lower tick_hz or raise bitrate_bps in the rig file");
  if (!under_load) v.against.emplace_back("it was measured without load: add --load");

  if (f.cpu < 0) {
    v.advice.emplace_back(
        "the loop may run on any core: give it one of its own (--cpu N, with isolcpus=N nohz_full=N rcu_nocbs=N at boot)");
  } else {
    if (!contains(m.isolated, f.cpu))
      v.advice.push_back(fmt::format("core {0} is not isolated: boot with isolcpus={0} nohz_full={0} rcu_nocbs={0}", f.cpu));
    else if (!contains(m.nohz_full, f.cpu))
      v.advice.push_back(fmt::format("core {0} keeps its scheduler tick: boot with nohz_full={0} rcu_nocbs={0}", f.cpu));
    const auto here = std::ranges::count_if(m.interrupt_cores, [&](const auto& cores) { return contains(cores, f.cpu); });
    if (here > 0)
      v.advice.push_back(
          fmt::format("{} interrupts are served on core {}: stop irqbalance, and boot with irqaffinity= the other cores", here, f.cpu));
  }
  if (m.smt.value_or(false))
    v.advice.emplace_back(
        "hyper-threads are on, and the loop's core shares its units with another: switch them off in the BIOS, or boot with nosmt");
  if (std::ranges::any_of(m.governors, [](const std::string& g) { return g != "performance"; }))
    v.advice.emplace_back("cores change their clock: cpupower frequency-set -g performance");
  if (m.clocksource == "hpet" || m.clocksource == "acpi_pm" || m.clocksource == "jiffies")
    v.advice.push_back(
        fmt::format("the clock is {}, which is slow or coarse: see with dmesg why the kernel does not use tsc", m.clocksource));
  if (f.ticks < 10'000)
    v.advice.push_back(fmt::format("99.99 % of {} ticks are all of them: --seconds {:.0f} or more gives that figure a meaning", f.ticks,
                                   10'000 * 1e-6 * f.period_us));
  return v;
}

}  // namespace trocar::check
