#include "tests/benchmarks/needle/output.hpp"

#include <fmt/core.h>

#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

constexpr const char* figures = R"(
set datafile separator ','
set terminal svg size 900,500 font 'sans,14' background 'white'
set key outside right top
set logscale xy
set grid
set format '10^{%L}'

set output folder.'/needle_bend.svg'
set title 'Run time against error: a cantilever from rest to its bent shape, 2 to 64 elements'
set xlabel 'error of the tip over the length'
set ylabel 'time of a solution [us]'
csv = folder.'/needle_bend.csv'
plot for [load in '1 3 10'] csv skip 1 using (strcol(1) eq 'elastica' && $4 == real(load) ? $5 : NaN):8 with linespoints pt 7 title 'P L^2 / EI = '.load

set output folder.'/needle_thesis.svg'
set title 'Run time against error: thesis figure 5.13 at 0.5 N, ours of 2 to 24 elements, triangles of 8 to 240 with E fitted'
plot for [method in 'ours thesis'] csv skip 1 using (strcol(1) eq 'figure 5.13' && strcol(2) eq method && $4 > 2 ? $5 : NaN):8 with linespoints pt 7 title method
)";

}  // namespace

void print(const std::vector<BendRow>& rows) {
  fmt::print("{:<12} {:<8} {:>8} {:>8} {:>12} {:>7} {:>10} {:>12} {:>24}\n", "scene", "method", "elements", "load", "error / L", "order",
             "iterations", "median [us]", "quartiles [us]");
  for (const BendRow& r : rows)
    fmt::print("{:<12} {:<8} {:>8} {:>8.3g} {:>12.3e} {:>7.2f} {:>10} {:>12.2f} {:>12.2f} {:>11.2f}\n", r.scene, r.method, r.elements,
               r.load, r.error, r.order, r.iterations, 1e6 * r.median_s, 1e6 * r.quartile1_s, 1e6 * r.quartile3_s);
}

void print(const std::vector<StepRow>& rows, double floor_s) {
  fmt::print("\n{:<64} {:>12} {:>24} {:>10}\n", "24 elements, 32 points", "median [us]", "quartiles [us]", "of floor");
  for (const StepRow& r : rows)
    fmt::print("{:<64} {:>12.2f} {:>12.2f} {:>11.2f} {:>10.2f}\n", r.what, 1e6 * r.median_s, 1e6 * r.quartile1_s, 1e6 * r.quartile3_s,
               r.median_s / floor_s);
}

void write(const std::filesystem::path& folder, const std::vector<BendRow>& bends, const std::vector<StepRow>& steps) {
  std::filesystem::create_directories(folder);
  std::string text = "scene,method,elements,load,error_of_length,order,iterations,median_us,quartile1_us,quartile3_us\n";
  for (const BendRow& r : bends)
    text += fmt::format("{},{},{},{},{},{},{},{},{},{}\n", r.scene, r.method, r.elements, r.load, r.error, r.order, r.iterations,
                        1e6 * r.median_s, 1e6 * r.quartile1_s, 1e6 * r.quartile3_s);
  write_file(folder / "needle_bend.csv", text);
  text = "what,median_us,quartile1_us,quartile3_us\n";
  for (const StepRow& r : steps)
    text += fmt::format("\"{}\",{},{},{}\n", r.what, 1e6 * r.median_s, 1e6 * r.quartile1_s, 1e6 * r.quartile3_s);
  write_file(folder / "needle_step.csv", text);
  report::run_gnuplot(figures, folder);
}

}  // namespace trocar::bench
