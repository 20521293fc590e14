#include "tests/benchmarks/realtime/output.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string>

#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

constexpr const char* figures = R"(
set datafile separator ','
set terminal svg size 1000,720 font 'sans,14' background 'white'
set grid
set logscale xy
set yrange [0.5:3e5]
set xrange [5:30000]
set key inside top right
csv = folder.'/realtime_histogram.csv'

set output folder.'/realtime_execution.svg'
set multiplot layout 2,1 title 'Execution of a tick with 32 contacts or more, flexible needle; dashed: half a period'
do for [hz in '1000 4000'] {
  set title hz.' Hz, in-process drives'
  set xlabel 'time [us]'
  set ylabel 'ticks'
  half = 5e5 / real(hz)
  unset arrow
  set arrow from half, graph 0 to half, graph 1 nohead dt 2
  plot for [what in '"wall" "CPU" "least"'] csv skip 1 using ($1 == real(hz) && strcol(2) eq what ? $3 : NaN):4 with points pt 7 ps 0.6 title (what eq 'wall' ? 'wall clock' : what eq 'CPU' ? 'CPU time of the thread' : 'least of all executions')
}
unset multiplot

unset arrow
set output folder.'/realtime_lateness.svg'
set multiplot layout 2,1 title 'Lateness of wake-ups, at the same moment on the same machine'
do for [hz in '1000 4000'] {
  set title hz.' Hz'
  set xlabel 'late by [us]'
  set ylabel 'wake-ups'
  plot for [what in '"late" "cyclictest"'] csv skip 1 using ($1 == real(hz) && strcol(2) eq what ? $3 : NaN):4 with points pt 7 ps 0.6 title (what eq 'late' ? 'ours' : what)
}
unset multiplot
)";

using Figure = std::function<std::int64_t(const Tick&)>;

struct Row {
  std::string name{};
  std::string histogram{};  // its name there; empty: not drawn
  bool deep{};              // ticks with contacts_goal contacts alone
  Figure of{};
};

const std::vector<Row>& rows() {
  static const std::vector<Row> all{
      {"execution, wall clock", "wall", true, [](const Tick& t) { return t.wall_ns; }},
      {"execution, CPU time of the thread", "CPU", true, [](const Tick& t) { return t.cpu_ns; }},
      {"execution, least of all executions", "least", true, [](const Tick& t) { return t.least_ns; }},
      {"execution in all ticks, wall clock", "", false, [](const Tick& t) { return t.wall_ns; }},
      {"plant and hand, outside of the tick", "", false, [](const Tick& t) { return t.plant_ns; }},
      {"wake-up late by, ours", "late", false, [](const Tick& t) { return t.late_ns; }},
  };
  return all;
}

std::vector<double> sorted_us(const Rate& rate, const Row& row) {
  std::vector<double> us;
  for (const Tick& t : rate.paced.tick)
    if (!row.deep || t.deep()) us.push_back(1e-3 * static_cast<double>(row.of(t)));
  std::sort(us.begin(), us.end());
  return us;
}

constexpr double parts[] = {0.5, 0.99, 0.9999, 1.0};

// Nearest rank; NaN of nothing.
double percentile(const std::vector<double>& sorted, double part) {
  if (sorted.empty()) return std::nan("");
  const auto rank = static_cast<std::size_t>(std::ceil(part * static_cast<double>(sorted.size())));
  return sorted[std::max<std::size_t>(rank, 1) - 1];
}

double percentile(const CyclictestResult& result, double part) {
  std::int64_t all = result.beyond;
  for (const std::int64_t n : result.count) all += n;
  const auto rank = static_cast<std::int64_t>(std::ceil(part * static_cast<double>(all)));
  std::int64_t below = 0;
  if (part < 1.0)
    for (std::size_t us = 0; us < result.count.size(); ++us)
      if ((below += result.count[us]) >= rank) return static_cast<double>(us);
  return result.most_us;
}

struct Blame {
  std::int64_t slow{};       // longer than half a period on the wall clock
  std::int64_t preempted{};  // of them: CPU time within half a period, or an involuntary switch within the tick
  std::int64_t not_again{};  // of them: shorter in another execution of the same tick
  std::int64_t ours{};       // of them: longer in every execution
};

Blame blame(const Rate& rate) {
  Blame b;
  const double half_ns = 1e3 * rate.half_period_us();
  for (const Tick& t : rate.paced.tick) {
    if (static_cast<double>(t.wall_ns) <= half_ns) continue;
    ++b.slow;
    b.preempted += static_cast<double>(t.cpu_ns) <= half_ns || t.switches > 0 ? 1 : 0;
    (static_cast<double>(t.least_ns) <= half_ns ? b.not_again : b.ours) += 1;
  }
  return b;
}

struct Most {
  std::uint32_t contacts{};
  std::int32_t newton{}, solves{}, pivots{};
  std::int64_t deep{}, unsolved{}, late{};
};

Most most(const Rate& rate, double late_ns) {
  Most m;
  for (const Tick& t : rate.paced.tick) {
    m.contacts = std::max(m.contacts, t.counts.contacts);
    m.newton = std::max(m.newton, t.counts.newton);
    m.solves = std::max(m.solves, t.counts.solves);
    m.pivots = std::max(m.pivots, t.counts.pivots);
    m.deep += t.deep() ? 1 : 0;
    m.unsolved += t.counts.solved ? 0 : 1;
    m.late += static_cast<double>(t.late_ns) > late_ns ? 1 : 0;
  }
  return m;
}

}  // namespace

double judged_us(const Rate& rate) { return percentile(sorted_us(rate, rows().front()), 0.99); }

bool sound(const Rate& rate) {
  const Most m = most(rate, 0.0);
  return rate.paced.haptic && rate.paced.same && m.unsolved == 0 && m.deep > 0;
}

void print(const Rate& rate) {
  const Paced& p = rate.paced;
  const double period_ns = 1e9 / p.tick_hz;
  const Most m = most(rate, period_ns);
  const auto count = static_cast<double>(p.tick.size());
  fmt::print("\n{:.0f} Hz, {} ticks in {:.1f} s, in-process drives (CAN at 1 Mbit/s ends at 1.3 kHz)\n", p.tick_hz, p.tick.size(),
             p.wall_s);
  fmt::print("{} contacts or more in {:.0f} % of the ticks, at most {}; at most {} Newton iterations, {} solves, {} pivots; {} unsolved\n",
             contacts_goal, 100.0 * static_cast<double>(m.deep) / count, m.contacts, m.newton, m.solves, m.pivots, m.unsolved);
  if (!p.haptic) fmt::print("the controller LEFT Haptic\n");
  if (!p.same) fmt::print("executions of the same tick counted DIFFERENTLY\n");
  fmt::print("{:<40} {:>10} {:>10} {:>10} {:>10}\n", "[us]", "p50", "p99", "p99.99", "max");
  for (const Row& row : rows()) {
    const std::vector<double> us = sorted_us(rate, row);
    fmt::print("{:<40}", row.name);
    for (const double part : parts) fmt::print(" {:>10.1f}", percentile(us, part));
    fmt::print("\n");
  }
  fmt::print("{:<40}", "wake-up late by, cyclictest");
  if (rate.cyclictest.absent.empty())
    for (const double part : parts) fmt::print(" {:>10.0f}", percentile(rate.cyclictest, part));
  else
    fmt::print(" none: {}", rate.cyclictest.absent);
  const Blame b = blame(rate);
  fmt::print("\nticks longer than half a period: {}; of them interrupted (little CPU time, or an involuntary switch): {};\n", b.slow,
             b.preempted);
  fmt::print("  not when executed again, so not for what they compute: {}; every time, so ours: {}\n", b.not_again, b.ours);
  fmt::print("later than a whole period: {} ticks; missed periods: {}; stolen from this virtual machine's cores: {:.2f} s\n", m.late,
             p.missed_periods, p.steal_s);
}

void write(const std::filesystem::path& folder, const std::vector<Rate>& rates) {
  std::filesystem::create_directories(folder);
  std::string table = "tick_hz,what,p50_us,p99_us,p9999_us,max_us\n";
  std::string histogram = "tick_hz,what,us,count\n";
  std::string slowest = "tick_hz,tick,wall_ns,cpu_ns,least_ns,late_ns,plant_ns,switches,contacts,newton,solves,pivots\n";
  for (const Rate& rate : rates) {
    const double hz = rate.paced.tick_hz;
    const auto add = [&](const std::string& name, const std::function<double(double)>& of) {
      table += fmt::format("{},\"{}\"", hz, name);
      for (const double part : parts) table += fmt::format(",{}", of(part));
      table += '\n';
    };
    for (const Row& row : rows()) {
      const std::vector<double> us = sorted_us(rate, row);
      add(row.name, [&](double part) { return percentile(us, part); });
      std::map<std::int64_t, std::int64_t> bins;
      for (const double each : us) ++bins[static_cast<std::int64_t>(each)];
      if (!row.histogram.empty())
        for (const auto& [bin, n] : bins) histogram += fmt::format("{},{},{},{}\n", hz, row.histogram, bin, n);
    }
    if (rate.cyclictest.absent.empty()) {
      add("wake-up late by, cyclictest", [&](double part) { return percentile(rate.cyclictest, part); });
      for (std::size_t us = 0; us < rate.cyclictest.count.size(); ++us)
        if (rate.cyclictest.count[us] > 0) histogram += fmt::format("{},cyclictest,{},{}\n", hz, us, rate.cyclictest.count[us]);
    }
    const std::vector<Tick>& tick = rate.paced.tick;
    std::vector<std::size_t> order(tick.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    const std::size_t shown = std::min<std::size_t>(200, order.size());
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(shown), order.end(),
                      [&](std::size_t a, std::size_t b) { return tick[a].wall_ns > tick[b].wall_ns; });
    for (std::size_t k = 0; k < shown; ++k) {
      const Tick& t = tick[order[k]];
      slowest += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", hz, order[k], t.wall_ns, t.cpu_ns, t.least_ns, t.late_ns, t.plant_ns,
                             t.switches, t.counts.contacts, t.counts.newton, t.counts.solves, t.counts.pivots);
    }
  }
  write_file(folder / "realtime.csv", table);
  write_file(folder / "realtime_histogram.csv", histogram);
  write_file(folder / "realtime_slowest.csv", slowest);
  report::run_gnuplot(figures, folder);
}

}  // namespace trocar::bench
