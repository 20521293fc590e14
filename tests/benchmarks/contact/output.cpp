#include "tests/benchmarks/contact/output.hpp"

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

set output folder.'/contact_error.svg'
set title 'Run time against error: 32 contacts, turning to and fro'
set xlabel 'worst error of a contact force [N]'
set ylabel 'time of a tick [us]'
csv = folder.'/contact_error.csv'
methods = 'ours thesis full_refactored full_reused_columns full_reused_iterations'
plot for [m in methods] csv skip 1 using (strcol(1) eq 'turn_to_and_fro' && strcol(2) eq m ? ($3 < 1e-17 ? 1e-17 : $3) : NaN):5 with points pt 7 ps 1.5 title m noenhanced

set output folder.'/contact_size.svg'
set title 'Cost against size: 14 contacts, whole step 32'
set xlabel 'nodes of the mesh'
csv = folder.'/contact.csv'
methods = 'ours our_whole_step thesis full_displacement full_reused_columns full_reused_iterations full_refactored'
plot for [m in methods] csv skip 1 using (strcol(1) eq 'mesh_size' && strcol(2) eq m ? $4 : NaN):5 with points pt 7 title m noenhanced
)";

}  // namespace

void print(const std::vector<Timing>& timings) {
  fmt::print("{:<22} {:<24} {:>9} {:>8} {:>12} {:>24}\n", "scene", "method", "contacts", "nodes", "median [us]", "quartiles [us]");
  for (const Timing& t : timings)
    fmt::print("{:<22} {:<24} {:>9} {:>8} {:>12.3f} {:>12.3f} {:>11.3f}\n", t.scene, t.method, t.contacts, t.mesh_nodes, 1e6 * t.median_s,
               1e6 * t.quartile1_s, 1e6 * t.quartile3_s);
}

void print(const std::vector<Error>& errors) {
  fmt::print("\n{:<22} {:<24} {:>20} {:>20}\n", "scene", "method", "contact force [N]", "base force [N]");
  for (const Error& e : errors) fmt::print("{:<22} {:<24} {:>20.3g} {:>20.3g}\n", e.scene, e.method, e.worst_force_n, e.worst_base_force_n);
}

void print(const std::vector<Ratio>& ratios) {
  fmt::print("\n{:<72} {:>10} {:>12}\n", "ratio within this run", "value", "goal");
  for (const Ratio& r : ratios) {
    fmt::print("{:<72} {:>10.4g}", r.what, r.value);
    const bool most = r.kind == Ratio::Goal::AtMost;
    if (r.kind != Ratio::Goal::None)
      fmt::print(" {} {:>9.4g}  {}", most ? "<=" : ">=", r.goal, (most ? r.value <= r.goal : r.value >= r.goal) ? "met" : "MISSED");
    fmt::print("\n");
  }
}

void write(const std::filesystem::path& folder, const std::vector<Timing>& timings, const std::vector<Error>& errors) {
  std::filesystem::create_directories(folder);
  std::string text = "scene,method,contacts,mesh_nodes,median_us,quartile1_us,quartile3_us\n";
  for (const Timing& t : timings)
    text += fmt::format("{},{},{},{},{},{},{}\n", t.scene, t.method, t.contacts, t.mesh_nodes, 1e6 * t.median_s, 1e6 * t.quartile1_s,
                        1e6 * t.quartile3_s);
  write_file(folder / "contact.csv", text);
  text = "scene,method,worst_force_error_n,worst_base_force_error_n,median_us\n";
  for (const Error& e : errors)
    text += fmt::format("{},{},{},{},{}\n", e.scene, e.method, e.worst_force_n, e.worst_base_force_n, 1e6 * e.median_s);
  write_file(folder / "contact_error.csv", text);
  report::run_gnuplot(figures, folder);
}

}  // namespace trocar::bench
