#include "tests/benchmarks/observer/output.hpp"

#include <fmt/core.h>

#include <cmath>
#include <tuple>

#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

constexpr const char* figures = R"(
set datafile separator ','
set terminal svg size 1000,720 font 'sans,14' background 'white'
set grid
csv = folder.'/observer.csv'
methods = 'nicosia momentum inverse'

set output folder.'/observer_trade.svg'
set multiplot layout 2,2 title 'Bandwidth against quantisation: 16,000 counts, friction on, 12 N of range, as modelled'
set logscale x
set xtics (50, 100, 200, 350, 600, 1000)
set xrange [45:1100]
set xlabel 'bandwidth [rad/s]'
set key top right opaque
do for [hz in '1000 4000'] {
  set title hz.' Hz'
  set ylabel 'RMS of the force error [N]'
  set yrange [0:2]
  plot for [m in methods] csv skip 1 using (strcol(1) eq 'as modelled' && $3 == real(hz) && strcol(2) eq m ? $4 : NaN):8 with linespoints pt 7 ps 0.5 title m, 0.6 with lines dt 2 lc 'black' title 'goal'
}
do for [hz in '1000 4000'] {
  set title hz.' Hz'
  set ylabel '90 % of a step of 12 N, worst [ms]'
  set yrange [0:30]
  plot for [m in methods] csv skip 1 using (strcol(1) eq 'as modelled' && $3 == real(hz) && strcol(2) eq m ? $4 : NaN):12 with linespoints pt 7 ps 0.5 title m, 10 with lines dt 2 lc 'black' title 'goal'
}
unset multiplot

unset logscale
unset title
set xtics auto
set yrange [*:*]
set xrange [*:*]
set key outside right top
set terminal svg size 1000,450 font 'sans,14' background 'white'
set output folder.'/observer_trace.svg'
set title 'A step of the hand from -6 to 6 N and a while after it, 1 kHz, 390 rad/s'
set xlabel 'time [s]'
set ylabel 'force along x [N]'
csv = folder.'/observer_trace.csv'
plot csv skip 1 using 1:2 with steps lw 2 lc 'black' title 'hand', for [k in '2 3 1'] csv skip 1 using 1:(column(2+int(k))) with steps lc int(k) title word(methods, int(k))
)";

const char* admitted(const Trial& row) { return row.method == "inverse" ? "" : control::to_text(row.admission.verdict); }

}  // namespace

void print(const std::vector<Trial>& rows, const std::string& machine, double tick_hz) {
  fmt::print("\n{}, {:.0f} Hz: RMS of the force error [N], rise to 90 % of 12 N [ms]\n", machine, tick_hz);
  fmt::print("{:<9} {:>6} {:>8} {:>7} {:>7} {:>7} {:>11} {:>9} {:>7} {:>7} {:>8} {:>8} {:>6}  {}\n", "method", "rad/s", "settled", "ramps",
             "sine", "worst", "with steps", "N mm", "median", "worst", "counts", "gain", "goals", "admissible");
  for (const Trial& r : rows) {
    if (r.machine != machine || r.tick_hz != tick_hz) continue;
    const Verdict& v = r.verdict;
    fmt::print("{:<9} {:>6.0f} {:>8.3f} {:>7.3f} {:>7.3f} {:>7.3f} {:>11.3f} {:>9.2f} {:>7.1f} {:>7.1f} {:>8.3f} {:>8.3f} {:>6}  {}\n",
               r.method, r.bandwidth_rad_s, v.settled_n, v.ramps_n, v.sine_n, v.worst_n(), v.with_steps_n, 1e3 * v.moment_nm,
               1e3 * v.rise_s, 1e3 * v.slowest_rise_s, r.admission.count_force_n, r.admission.speed_gain + r.admission.friction_gain,
               r.met() ? "met" : "-", admitted(r));
  }
}

void print_summary(const std::vector<Trial>& rows) {
  fmt::print("\nRMS < {} N and 90 % of every 12 N step in < {:.0f} ms\n", force_goal_n, 1e3 * rise_goal_s);
  fmt::print("{:<14} {:>7} {:<9} {:>20}   {}\n", "machine", "Hz", "method", "met at [rad/s]", "least RMS of those fast enough");
  std::vector<std::tuple<std::string, double, std::string>> groups;
  for (const Trial& r : rows)
    if (groups.empty() || groups.back() != std::tuple(r.machine, r.tick_hz, r.method)) groups.emplace_back(r.machine, r.tick_hz, r.method);
  for (const auto& [machine, hz, method] : groups) {
    double low = 0.0, high = 0.0;
    const Trial* best = nullptr;
    for (const Trial& r : rows) {
      if (std::tuple(r.machine, r.tick_hz, r.method) != std::tuple(machine, hz, method)) continue;
      if (r.met()) {
        if (low == 0.0) low = r.bandwidth_rad_s;
        high = r.bandwidth_rad_s;
      }
      if (r.verdict.slowest_rise_s < rise_goal_s && (best == nullptr || r.verdict.worst_n() < best->verdict.worst_n())) best = &r;
    }
    const std::string met = low == 0.0 ? "nowhere: MISSED" : fmt::format("{:.0f} to {:.0f}", low, high);
    const std::string least = best == nullptr ? "none is fast enough"
                                              : fmt::format("{:.3f} N at {:.0f} rad/s, {:.1f} ms", best->verdict.worst_n(),
                                                            best->bandwidth_rad_s, 1e3 * best->verdict.slowest_rise_s);
    fmt::print("{:<14} {:>7.0f} {:<9} {:>20}   {}\n", machine, hz, method, met, least);
  }
}

void write(const std::filesystem::path& folder, const std::vector<Trial>& rows, const std::vector<TraceRow>& trace) {
  std::filesystem::create_directories(folder);
  std::string text =
      "machine,method,tick_hz,bandwidth_rad_s,settled_rms_n,ramps_rms_n,sine_rms_n,worst_rms_n,with_steps_rms_n,moment_rms_nm,"
      "rise_median_ms,rise_worst_ms,count_force_n,speed_gain,friction_gain,met,admissible\n";
  for (const Trial& r : rows) {
    const Verdict& v = r.verdict;
    text += fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},\"{}\"\n", r.machine, r.method, r.tick_hz, r.bandwidth_rad_s,
                        v.settled_n, v.ramps_n, v.sine_n, v.worst_n(), v.with_steps_n, v.moment_nm, 1e3 * v.rise_s, 1e3 * v.slowest_rise_s,
                        r.admission.count_force_n, r.admission.speed_gain, r.admission.friction_gain, r.met() ? 1 : 0, admitted(r));
  }
  write_file(folder / "observer.csv", text);
  text = "time_s,hand_n,nicosia_n,momentum_n,inverse_n\n";
  for (const TraceRow& r : trace) {
    text += fmt::format("{},{}", r.time_s, r.hand_n);
    for (const double found : r.found_n) text += fmt::format(",{}", found);
    text += '\n';
  }
  write_file(folder / "observer_trace.csv", text);
  report::run_gnuplot(figures, folder);
}

}  // namespace trocar::bench
