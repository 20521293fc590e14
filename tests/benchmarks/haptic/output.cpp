#include "tests/benchmarks/haptic/output.hpp"

#include <fmt/core.h>

#include <string>

#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

constexpr const char* figures = R"(
set datafile separator ','
set terminal svg size 1000,500 font 'sans,14' background 'white'
set key outside right top
set logscale y
set grid

set output folder.'/haptic_wall.svg'
set title 'Walls that stay passive: below each line (0.32 kg, 2 N s/m, one tick of delay, in-process drives)'
set xlabel 'damping of the wall [N s/m]'
set ylabel 'largest stiffness [N/m]'
csv = folder.'/haptic_wall.csv'
rates = '512 1000 2000 4000'
plot for [hz in rates] csv skip 1 using (strcol(1) eq 'two channels' && $2 == real(hz) && $4 > 0 ? $3 : NaN):4 with linespoints pt 7 dt 1 title 'two channels, '.hz.' Hz', \
     for [hz in rates] csv skip 1 using (strcol(1) eq 'four channels' && $2 == real(hz) && $4 > 0 ? $3 : NaN):4 with linespoints pt 4 dt 2 title 'four channels, '.hz.' Hz'

set output folder.'/haptic_felt.svg'
set logscale xy
set title 'Stiffness rendered and felt (haptic rig, 1 kHz, guard on)'
set xlabel 'rendered [N/m]'
set ylabel 'felt [N/m]'
csv = folder.'/haptic_felt.csv'
schemes = '"two channels" admittance "four channels"'
plot x title 'exact' lc 'gray', for [s in schemes] csv skip 1 using (strcol(1) eq s ? $2 : NaN):3 with linespoints pt 7 title s

set output folder.'/haptic_free.svg'
unset logscale y
set title 'Free space: effective mass (haptic rig, 1 kHz, guard on)'
set xlabel 'frequency of the hand [Hz]'
set ylabel 'mass [kg]'
set yrange [*:*]
csv = folder.'/haptic_free.csv'
plot for [s in schemes] csv skip 1 using (strcol(1) eq s ? $2 : NaN):3 with linespoints pt 7 title s
)";

}  // namespace

void print(const std::vector<WallRow>& rows) {
  fmt::print(
      "In-process drives with one tick of delay: a CAN bus of 1 Mbit/s ends at 1.3 kHz, so 2000 and 4000 Hz are none that the rig has\n");
  fmt::print("{:<24} {:>8} {:>16} {:>24}\n", "passive walls", "rate", "damping [N s/m]", "largest stiffness [N/m]");
  for (const WallRow& r : rows) fmt::print("{:<24} {:>8} {:>16} {:>24.4g}\n", r.scheme, r.tick_hz, r.damping_n_s_m, r.stiffness_n_m);
}

void print(const std::vector<FeltRow>& rows) {
  fmt::print("\n{:<24} {:>16} {:>12} {:>10} {:>12} {:>18}\n", "stiffness", "rendered [N/m]", "felt [N/m]", "of it", "ripple [N]",
             "least energy [mJ]");
  for (const FeltRow& r : rows)
    fmt::print("{:<24} {:>16} {:>12.5g} {:>10.4f} {:>12.3f} {:>18.3f}\n", r.scheme, r.rendered_n_m, r.felt_n_m, r.felt_n_m / r.rendered_n_m,
               r.ripple_n, 1e3 * r.least_energy_j);
}

void print(const std::vector<FreeRow>& rows) {
  fmt::print("\n{:<24} {:>16} {:>12} {:>18}\n", "free space", "frequency [Hz]", "mass [kg]", "damping [N s/m]");
  for (const FreeRow& r : rows) fmt::print("{:<24} {:>16} {:>12.4f} {:>18.3f}\n", r.scheme, r.frequency_hz, r.mass_kg, r.damping_n_s_m);
}

void write(const std::filesystem::path& folder, const std::vector<WallRow>& walls, const std::vector<FeltRow>& felt,
           const std::vector<FreeRow>& free) {
  std::filesystem::create_directories(folder);
  std::string text = "scheme,tick_hz,damping_n_s_m,stiffness_n_m\n";
  for (const WallRow& r : walls) text += fmt::format("{},{},{},{}\n", r.scheme, r.tick_hz, r.damping_n_s_m, r.stiffness_n_m);
  write_file(folder / "haptic_wall.csv", text);
  text = "scheme,rendered_n_m,felt_n_m,ripple_n,least_energy_j\n";
  for (const FeltRow& r : felt) text += fmt::format("{},{},{},{},{}\n", r.scheme, r.rendered_n_m, r.felt_n_m, r.ripple_n, r.least_energy_j);
  write_file(folder / "haptic_felt.csv", text);
  text = "scheme,frequency_hz,mass_kg,damping_n_s_m\n";
  for (const FreeRow& r : free) text += fmt::format("{},{},{},{}\n", r.scheme, r.frequency_hz, r.mass_kg, r.damping_n_s_m);
  write_file(folder / "haptic_free.csv", text);
  report::run_gnuplot(figures, folder);
}

}  // namespace trocar::bench
