#include "tests/benchmarks/accuracy/output.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "host/report/gnuplot.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

// Columns of accuracy_error.csv: 1 path, 2 element, 3 side, 4 method, 5 tick_us, 8 axial_stiffness, 9 lateral_stiffness, 12 visible_slip,
// 13 slip_force.
constexpr const char* figure = R"(
set datafile separator ','
set datafile missing NaN
csv = folder.'/accuracy_error.csv'
methods = 'snap adapt embedded subdivide'
array colour[4] = ['#c0392b', '#2471a3', '#1e8449', '#b9770e']
array symbol[4] = [4, 6, 7, 8]
do for [out in 'svg png'] {
  if (out eq 'svg') { set terminal svg size 1120,900 font 'sans,14' background 'white' } else { set terminal pngcairo size 1120,900 font 'sans,11' background 'white' }
  set output folder.'/accuracy.'.out
  set multiplot layout 2,2 title 'Run time against error: a needle 30 degrees off the grid, triangles, 11^2 to 81^2 nodes (the number is the nodes per side)'
  set logscale xy
  set grid lc rgb '#dddddd'
  set xlabel 'error [%]'
  set ylabel 'median tick [us]'
  set format x '%g'
  set key top right
  array title_of[4] = ['stuck axial stiffness', 'stuck lateral stiffness', 'visible displacement in partial slip', 'base force in partial slip']
  array column_of[4] = [8, 9, 12, 13]
  do for [panel = 1:4] {
    set title title_of[panel]
    c = column_of[panel]
    plot for [i = 1:4] csv skip 1 using (strcol(1) eq 'oblique_30' && strcol(2) eq 'tri3' && strcol(4) eq word(methods, i) ? 100 * column(c) : NaN):5 with linespoints pt symbol[i] ps 1.3 lw 1.5 lc rgb colour[i] title word(methods, i), \
      for [i = 1:4] csv skip 1 using (strcol(1) eq 'oblique_30' && strcol(2) eq 'tri3' && strcol(4) eq word(methods, i) ? 100 * column(c) : NaN):5:3 with labels offset 1.3,0.5 font ',9' tc rgb colour[i] notitle
  }
  unset multiplot
}
)";

double order(double coarse, double middle, double fine) { return std::log2(std::abs(coarse - middle) / std::abs(middle - fine)); }

}  // namespace

void print(const std::vector<ReferenceRow>& rows) {
  fmt::print(
      "The reference, extrapolated from two conforming fine meshes: largest relative change from one refinement to the next, over all "
      "depths\n{:<15} {:>9}",
      "path", "slipping");
  for (const char* name : metric_name) fmt::print(" {:>17}", name);
  fmt::print("\n");
  for (const ReferenceRow& r : rows) {
    fmt::print("{:<15} {:>7.1f} %", r.path, 100.0 * r.slipping);
    for (const double each : r.change) fmt::print(" {:>15.3f} %", 100.0 * each);
    fmt::print("\n");
  }
}

void print(const std::vector<ErrorRow>& rows) {
  fmt::print("\nErrors against the reference, root mean square over all depths\n{:<14} {:<5} {:>4} {:<9}", "path", "cells", "side",
             "method");
  for (const char* name : metric_name) fmt::print(" {:>17}", name);
  fmt::print(" {:>8} {:>9}\n", "contacts", "tick [us]");
  for (const ErrorRow& r : rows) {
    fmt::print("{:<14} {:<5} {:>4} {:<9}", r.path, r.element, r.side, r.method);
    for (const double each : r.error) fmt::print(" {:>15.3f} %", 100.0 * each);
    fmt::print(" {:>8} {:>9.2f}", r.contacts, r.tick_us);
    if (r.status != insertion::Status::Ok) fmt::print("  {}", insertion::to_string(r.status));
    fmt::print("\n");
  }
}

void print(const std::vector<Claim>& claims) {
  fmt::print(
      "\nErrors in the geometric mean over meshes and paths, and their ratios (goals: embedded not worse than adapt beyond what the\n"
      "reference may be wrong by; on oblique paths snap / either >= 5)\n");
  fmt::print("{:<6} {:<9} {:<18} {:>10} {:>10} {:>10} {:>16} {:>16} {:>16} {:>13}\n", "cells", "paths", "error of", "snap", "adapt",
             "embedded", "adapt / embedded", "snap / embedded", "snap / adapt", "reference");
  for (const Claim& c : claims) {
    const auto mark = [](bool goal, bool met) { return !goal ? "" : met ? "met" : "MISSED"; };
    const bool counts = c.metric != "slip_tip";
    const bool oblique = c.paths == "oblique" && counts;
    fmt::print("{:<6} {:<9} {:<18} {:>8.3f} % {:>8.3f} % {:>8.3f} % {:>9.2f} {:<6} {:>9.2f} {:<6} {:>9.2f} {:<6} {:>11.3f} %\n", c.element,
               c.paths, c.metric, 100.0 * c.snap, 100.0 * c.adapt, 100.0 * c.embedded, c.adapt / c.embedded,
               mark(counts, c.embedded <= c.adapt + c.tolerance), c.snap / c.embedded, mark(oblique, c.snap >= 5.0 * c.embedded),
               c.snap / c.adapt, mark(oblique, c.snap >= 5.0 * c.adapt), 100.0 * c.tolerance);
  }
}

void print_alone(const std::vector<ErrorRow>& alone, const std::vector<ErrorRow>& errors) {
  fmt::print(
      "\nWhat elements miss of themselves: the reference's own forces put on each mesh, oblique paths; then snap, adapt and embedded "
      "there\n"
      "{:<5} {:>4}",
      "cells", "side");
  for (std::size_t m = first_visible; m < first_visible + 3; ++m) fmt::print("   {:>40}", metric_name[m]);
  fmt::print("\n");
  for (std::size_t first = 0, end = 0; first < alone.size(); first = end) {
    const ErrorRow& row = alone[first];
    const auto same = [&row](const ErrorRow& other) { return other.element == row.element && other.side == row.side; };
    while (end < alone.size() && same(alone[end])) ++end;
    const auto mean = [&](const std::vector<ErrorRow>& rows, std::string_view method, std::size_t metric) {
      double sum = 0.0, count = 0.0;
      for (const ErrorRow& each : rows)
        if (same(each) && each.method == method && each.path.starts_with("oblique")) sum += std::log(each.error[metric]), count += 1.0;
      return 100.0 * std::exp(sum / count);
    };
    fmt::print("{:<5} {:>4}", row.element, row.side);
    for (std::size_t m = first_visible; m < first_visible + 3; ++m)
      fmt::print("   {:>7.3f} % {:>8.3f} {:>8.3f} {:>8.3f} %", mean(alone, "alone", m), mean(errors, "snap", m), mean(errors, "adapt", m),
                 mean(errors, "embedded", m));
    fmt::print("\n");
  }
}

void print_convergence(const std::vector<ErrorRow>& rows, const std::vector<SolidAnswer>& solids) {
  fmt::print(
      "\nEmbedded, plane: errors halve with the elements (segments are an edge long); observed order between meshes of h and h / 2\n");
  fmt::print("{:<14} {:<5} {:>10} {:>17} {:>17} {:>17} {:>17}\n", "path", "cells", "sides", metric_name[0], metric_name[1], metric_name[5],
             metric_name[6]);
  for (const ErrorRow& coarse : rows)
    for (const ErrorRow& fine : rows) {
      if (coarse.method != "embedded" || fine.method != "embedded" || coarse.path != fine.path || coarse.element != fine.element) continue;
      if (fine.side - 1 != 2 * (coarse.side - 1)) continue;
      fmt::print("{:<14} {:<5} {:>4} ->{:>3}", coarse.path, coarse.element, coarse.side, fine.side);
      for (const std::size_t m : {0U, 1U, 5U, 6U}) fmt::print(" {:>17.2f}", std::log2(coarse.error[m] / fine.error[m]));
      fmt::print("\n");
    }
  fmt::print("\nEmbedded, solid 40 x 40 x 11 mm: stuck stiffness, base force and tip in partial slip\n");
  fmt::print("{:>14} {:>9} {:>8} {:>13} {:>15} {:>13} {:>10}\n", "radius/element", "unknowns", "contacts", "axial [N/m]", "lateral [N/m]",
             "force [N]", "tip [mm]");
  for (const SolidAnswer& s : solids)
    fmt::print("{:>14} {:>9} {:>8} {:>13.4f} {:>15.4f} {:>13.6f} {:>10.5f}\n", s.radius_per_element, s.unknowns, s.contacts,
               s.axial_n_per_m, s.lateral_n_per_m, s.slip_force_n, 1e3 * s.tip_m);
  for (std::size_t k = 2; k < solids.size(); ++k) {
    const SolidAnswer &a = solids[k - 2], &b = solids[k - 1], &c = solids[k];
    fmt::print("{:>33} {:>13.2f} {:>15.2f} {:>13.2f} {:>10.2f}\n",
               fmt::format("order {} -> {} -> {}", a.radius_per_element, b.radius_per_element, c.radius_per_element),
               order(a.axial_n_per_m, b.axial_n_per_m, c.axial_n_per_m), order(a.lateral_n_per_m, b.lateral_n_per_m, c.lateral_n_per_m),
               order(a.slip_force_n, b.slip_force_n, c.slip_force_n), order(a.tip_m, b.tip_m, c.tip_m));
  }
}

double print(const std::vector<CourseRow>& rows) {
  fmt::print(
      "\nContinuity: change of the base force along the shaft over 0.1 mm, less the density over what was newly covered; the worst\n");
  fmt::print("{:<14} {:<5} {:>4} {:<9} {:>10} {:>24} {:>12} {:>12}\n", "path", "cells", "side", "method", "jump [mN]",
             "lateral change [mN]", "median [us]", "99 % [us]");
  double worst = 0.0;
  for (const CourseRow& r : rows) {
    const Course& c = r.course;
    fmt::print("{:<14} {:<5} {:>4} {:<9} {:>10.3f} {:>24.3f} {:>12.2f} {:>12.2f}", r.path, r.element, r.side, r.method, c.worst_jump_mn,
               c.worst_lateral_change_mn, c.median_us, c.percentile99_us);
    if (c.status != insertion::Status::Ok) fmt::print("  {}", insertion::to_string(c.status));
    fmt::print("\n");
    if (r.method == "embedded") worst = std::max(worst, c.worst_jump_mn);
  }
  return worst;
}

void write(const std::filesystem::path& folder, const std::vector<ReferenceRow>& references, const std::vector<ErrorRow>& errors,
           const std::vector<CourseRow>& courses, const std::vector<SolidAnswer>& solids) {
  std::filesystem::create_directories(folder);
  std::string names;
  for (const char* name : metric_name) names += fmt::format(",{}", name);
  const auto values = [](const Metrics& metrics) {
    std::string text;
    for (const double each : metrics) text += fmt::format(",{}", each);
    return text + "\n";
  };
  std::string text = "path,slipping" + names + "\n";
  for (const ReferenceRow& r : references) text += fmt::format("{},{}", r.path, r.slipping) + values(r.change);
  write_file(folder / "accuracy_reference.csv", text);
  text = "path,element,nodes_per_side,method,tick_us,contacts,status" + names + "\n";
  for (const ErrorRow& r : errors)
    text += fmt::format("{},{},{},{},{},{},{}", r.path, r.element, r.side, r.method, r.tick_us, r.contacts, static_cast<int>(r.status)) +
            values(r.error);
  write_file(folder / "accuracy_error.csv", text);
  text = "path,element,nodes_per_side,method,worst_jump_mn,worst_lateral_change_mn,median_us,percentile99_us,status\n";
  for (const CourseRow& r : courses)
    text += fmt::format("{},{},{},{},{},{},{},{},{}\n", r.path, r.element, r.side, r.method, r.course.worst_jump_mn,
                        r.course.worst_lateral_change_mn, r.course.median_us, r.course.percentile99_us, static_cast<int>(r.course.status));
  write_file(folder / "accuracy_continuity.csv", text);
  text = "radius_per_element,unknowns,contacts,axial_n_per_m,lateral_n_per_m,slip_force_n,tip_m\n";
  for (const SolidAnswer& s : solids)
    text += fmt::format("{},{},{},{},{},{},{}\n", s.radius_per_element, s.unknowns, s.contacts, s.axial_n_per_m, s.lateral_n_per_m,
                        s.slip_force_n, s.tip_m);
  write_file(folder / "accuracy_solid.csv", text);
  report::run_gnuplot(figure, folder);
}

}  // namespace trocar::bench
