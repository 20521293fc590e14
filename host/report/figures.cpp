#include "host/report/figures.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "host/report/gnuplot.hpp"
#include "host/report/haptic.hpp"

namespace trocar::report {

namespace {

// Okabe and Ito's set: told apart with every kind of colour vision, and in grey by order.
constexpr std::array<const char*, 7> palette{"#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#000000"};
constexpr const char* dark = "#333333";

struct Shade {
  Phase::Kind kind;
  const char* colour;
  const char* name;
};
constexpr std::array<Shade, 5> shades{{{Phase::Kind::Air, "#DDEAF3", "in the air"},
                                       {Phase::Kind::Touch, "#F3E3EC", "touching"},
                                       {Phase::Kind::Insert, "#FBE8C4", "insertion"},
                                       {Phase::Kind::Dwell, "#E4E4E4", "dwell"},
                                       {Phase::Kind::Withdraw, "#D3EBE1", "withdrawal"}}};

constexpr double depth_bin_m = 0.00025;
constexpr double thesis_shaft_n_per_m = 34.0;

std::string head(const std::string& name, int width, int height) {
  return fmt::format(
      "reset\n"
      "set terminal svg size {},{} dynamic noenhanced font 'sans-serif,15' name '{}' background '#FFFFFF'\n"
      "set output folder.'/{}.svg'\n"
      "set encoding utf8\n"
      "set rmargin 4\nset border 3 lc rgb '#555555'\nset tics nomirror out scale 0.6 textcolor rgb '#333333'\n"
      "set grid lc rgb '#DDDDDD' lw 0.7 lt 1\nset key noautotitle textcolor rgb '#333333'\n",
      width, height, name, name);
}

double seconds(const Sample& s) { return 1e-9 * static_cast<double>(s.time_ns); }

struct DepthBin {
  double depth{}, force{};
  std::uint64_t count{};
};

// Means of force over slices of depth, in the direction of motion.
std::string force_by_depth(const RunInfo& run, std::span<const Sample> samples, const std::string& block) {
  std::map<long, DepthBin> bins;
  for (const Sample& s : samples) {
    const double depth = tip_depth_m(run, s);
    if (depth < -0.002) continue;
    DepthBin& bin = bins[std::lround(std::floor(depth / depth_bin_m))];
    bin.depth += depth;
    bin.force += axial_force_n(run, s);
    ++bin.count;
  }
  std::string out = "$" + block + " << EOD\n";
  for (const auto& [index, bin] : bins) {
    const auto n = static_cast<double>(bin.count);
    out += fmt::format("{:.5g} {:.5g}\n", 1e3 * bin.depth / n, bin.force / n);
  }
  return out + "EOD\n";
}

std::string speed_label(const RunInfo& run, const Phase& phase) {
  std::string label = fmt::format("{:.3g} mm/s", 1e3 * phase.speed_m_s);
  if (phase.gain_set != run.gains && !phase.gain_set.empty()) label += " (" + phase.gain_set + " gains)";
  std::ranges::replace(label, '\'', ' ');
  return label;
}

std::string force_depth_script(const RunInfo& run, std::span<const Sample> samples) {
  std::string blocks, plots;
  std::map<std::pair<double, std::string>, std::size_t> colour;
  std::size_t index = 0;
  for (const Phase& phase : run.phases) {
    const bool in = phase.kind == Phase::Kind::Insert;
    if (!in && phase.kind != Phase::Kind::Withdraw) continue;
    const auto part = samples_of(phase, samples);
    if (part.empty()) continue;
    const std::string block = fmt::format("force{}", index++);
    blocks += force_by_depth(run, part, block);
    const auto [entry, first] = colour.try_emplace({phase.speed_m_s, phase.gain_set}, colour.size());
    const char* rgb = palette[entry->second % palette.size()];
    plots += fmt::format(", ${} using 1:2 with lines lw 2 lc rgb '{}'{}", block, rgb, in ? "" : " dt (8,6)");
    if (first) plots += fmt::format(" title '{}'", speed_label(run, phase));
  }
  if (index == 0) return {};
  return head("force_depth", 900, 520) + blocks +
         fmt::format(
             "set xlabel 'depth of the tip below the surface [mm]'\nset ylabel 'force at the base, along the needle [N]'\n"
             "set xrange [-3:*]\nset autoscale xfixmax\nset samples 500\nset key top left Left reverse samplen 2\nset xzeroaxis lc rgb "
             "'{0}' lt 1 lw 1\n"
             "plot (x < 0 ? 1/0 : {1}*x/1000) with lines lw 1.5 dt (2,4) lc rgb '{0}' title 'thesis: {1} N/m at 1 mm/s'{2}\n",
             dark, thesis_shaft_n_per_m, plots);
}

std::string shading(const RunInfo& run, std::span<const Sample> samples) {
  std::string out;
  for (const Phase& phase : run.phases) {
    const auto shade = std::ranges::find(shades, phase.kind, &Shade::kind);
    const auto part = samples_of(phase, samples);
    if (shade == shades.end() || part.empty()) continue;
    out += fmt::format("set object rectangle from {:.6g}, graph 0 to {:.6g}, graph 1 fc rgb '{}' fs solid noborder behind\n",
                       seconds(part.front()), seconds(part.back()), shade->colour);
  }
  return out;
}

std::string shade_keys(const RunInfo& run) {
  std::string out;
  for (const Shade& shade : shades) {
    if (std::ranges::find(run.phases, shade.kind, &Phase::kind) == run.phases.end()) continue;
    out += fmt::format(", keyentry with boxes fs solid noborder fc rgb '{}' title '{}'", shade.colour, shade.name);
  }
  return out;
}

// Root mean square and greatest value of one quantity in slices of time.
struct TimeSlices {
  static constexpr std::size_t count = 900;
  struct Slice {
    double sum{}, square{}, greatest{};
    std::uint64_t n{};
  };
  std::vector<Slice> slices = std::vector<Slice>(count);
  double start{}, width{};

  explicit TimeSlices(std::span<const Sample> samples)
      : start(seconds(samples.front())), width(std::max(1e-3, (seconds(samples.back()) - start) / (count - 1))) {}
  void add(const Sample& s, double value) {
    const auto index = static_cast<std::size_t>(std::clamp((seconds(s) - start) / width, 0.0, static_cast<double>(count - 1)));
    Slice& slice = slices[index];
    slice.sum += value;
    slice.square += value * value;
    slice.greatest = std::max(slice.greatest, value);
    ++slice.n;
  }
  template <class Row>
  [[nodiscard]] std::string block(const std::string& name, Row&& row) const {
    std::string out = "$" + name + " << EOD\n";
    for (std::size_t i = 0; i < count; ++i) {
      if (slices[i].n > 0) out += fmt::format("{:.6g} {}\n", start + (static_cast<double>(i) + 0.5) * width, row(slices[i]));
    }
    return out + "EOD\n";
  }
};

std::string tracking_script(const RunInfo& run, std::span<const Sample> samples) {
  TimeSlices error(samples);
  bool any = false;
  for (const Phase& phase : run.phases) {
    if (phase.kind == Phase::Kind::Other) continue;
    for (const Sample& s : samples_of(phase, samples)) {
      error.add(s, std::hypot(s.setpoint_pose[0] - s.pose[0], s.setpoint_pose[1] - s.pose[1]));
      any = true;
    }
  }
  if (!any) return {};
  // A logarithm has no place for an exact zero; a tenth of a micrometre is far below an encoder's count.
  const auto millimetres = [](double metres) { return std::max(1e-4, 1e3 * metres); };
  return head("tracking", 900, 420) + shading(run, samples) +
         error.block("error",
                     [&](const TimeSlices::Slice& s) {
                       return fmt::format("{:.4g} {:.4g}", millimetres(std::sqrt(s.square / static_cast<double>(s.n))),
                                          millimetres(s.greatest));
                     }) +
         fmt::format(
             "set xlabel 'time since the controller started [s]'\nset ylabel 'position error of the base [mm]'\n"
             "set logscale y\nset format y '%g'\nset yrange [*:*]\nset xrange [{:.6g}:{:.6g}]\n"
             "set key outside top center horizontal Left reverse samplen 1.5 width -1\n"
             "plot $error using 1:3 with points pt 7 ps 0.25 lc rgb '{}' title 'greatest', "
             "$error using 1:2 with points pt 7 ps 0.3 lc rgb '{}' title 'root mean square'{}\n",
             seconds(samples.front()), seconds(samples.back()), palette[5], palette[0], shade_keys(run));
}

std::string markers_script(const Eyes& eyes) {
  std::string block = "$markers << EOD\n";
  bool known = false;
  for (const SeenFrame& f : eyes.course) {
    known = known || std::isfinite(f.error_px);
    block += fmt::format("{:.6g} {:.5g} {:.5g}\n", f.t_s, 1e3 * f.displacement_m, f.error_px);
  }
  return head("markers", 900, 420) + block +
         fmt::format(
             "EOD\nset xlabel 'time [s]'\nset ylabel 'mean displacement of the markers [mm]'\nset autoscale xfix\nset yrange [0:*]\n"
             "set key top left Left reverse samplen 2\n{1}plot $markers using 1:2 with lines lw 2 lc rgb '{0}' title "
             "'displacement'{2}\n",
             palette[0],
             known ? "set border 11 lc rgb '#555555'\nset rmargin 10\nset y2tics out scale 0.6 textcolor rgb '#333333'\nset y2range [0:*]\n"
                     "set y2label 'tracked less true place, rms [px]'\n"
                   : "",
             known ? fmt::format(", $markers using 1:3 axes x1y2 with lines lw 1.5 lc rgb '{}' title 'error (right)'", palette[3]) : "");
}

std::string overview_script(const RunInfo& run, std::span<const Sample> samples) {
  // A run that ended before homing has no poses, and gnuplot refuses a curve without a point.
  if (std::ranges::none_of(samples, [&](const Sample& s) { return std::isfinite(tip_depth_m(run, s)); })) return {};
  TimeSlices depth(samples), force(samples);
  for (const Sample& s : samples) {
    depth.add(s, 1e3 * tip_depth_m(run, s));
    force.add(s, axial_force_n(run, s));
  }
  const auto mean = [](const TimeSlices::Slice& s) { return fmt::format("{:.5g}", s.sum / static_cast<double>(s.n)); };
  const std::string range = fmt::format("set xrange [{:.6g}:{:.6g}]\n", seconds(samples.front()), seconds(samples.back()));
  return head("overview", 900, 520) + depth.block("depth", mean) + force.block("force", mean) + shading(run, samples) + range +
         fmt::format(
             "set multiplot\nset lmargin at screen 0.09\nset rmargin at screen 0.98\n"
             "set tmargin at screen 0.90\nset bmargin at screen 0.55\nset format x ''\nset ylabel 'depth of the tip [mm]'\n"
             "set key at screen 0.535,0.98 center top horizontal Left reverse samplen 1.5 width -1\nset xzeroaxis lc rgb '{0}' lt 1 lw 1\n"
             "plot $depth using 1:2 with lines lw 2 lc rgb '{1}'{2}\n"
             "set tmargin at screen 0.50\nset bmargin at screen 0.17\nset format x '%g'\nset nokey\n"
             "set xlabel 'time since the controller started [s]'\nset ylabel 'axial force [N]'\n"
             "plot $force using 1:2 with lines lw 1.5 lc rgb '{3}'\nunset multiplot\n",
             dark, palette[0], shade_keys(run), palette[3]);
}

// Of one display: along the needle, means in slices of time.
struct Felt {
  std::string name;
  std::vector<Sample> samples;
};

std::vector<Felt> felt_displays(const RunInfo& run, std::span<const Sample> samples) {
  std::vector<Felt> all;
  for (const Phase& phase : run.phases) {
    if (phase.kind != Phase::Kind::Haptic) continue;
    Felt felt{phase.name, felt_samples(phase, samples)};
    std::ranges::replace(felt.name, '\'', ' ');
    if (felt.samples.size() > 1) all.push_back(std::move(felt));
  }
  return all;
}

template <class Value>
std::string slice_means(const std::string& block, const Felt& felt, Value&& value) {
  TimeSlices slices(felt.samples);
  for (const Sample& s : felt.samples)
    if (const double v = value(s); std::isfinite(v)) slices.add(s, v);
  return slices.block(block, [](const TimeSlices::Slice& s) { return fmt::format("{:.5g}", s.sum / static_cast<double>(s.n)); });
}

// One panel below the other, one curve of force each for the hand, its estimate and the model.
std::string felt_time_script(const RunInfo& run, const std::vector<Felt>& displays) {
  if (displays.empty()) return {};
  const auto n = static_cast<double>(displays.size());
  const double top = 46.0, row = 210.0, bottom = 40.0, gap = 44.0;
  const double height = top + n * row + bottom;
  std::string blocks, panels;
  for (std::size_t i = 0; i < displays.size(); ++i) {
    const Felt& felt = displays[i];
    std::size_t at = 0;  // truth and samples both go by increasing ticks
    bool known = false;
    blocks += slice_means(fmt::format("true{}", i), felt, [&](const Sample& s) {
      while (at < run.truth.size() && run.truth[at].tick < s.tick) ++at;
      if (at == run.truth.size() || run.truth[at].tick != s.tick) return not_measured;
      known = true;
      return along_needle(run, run.truth[at].hand_wrench);
    });
    blocks += slice_means(fmt::format("handle{}", i), felt, [&](const Sample& s) { return along_needle(run, s.handle_wrench); });
    blocks += slice_means(fmt::format("model{}", i), felt, [&](const Sample& s) { return along_needle(run, s.virtual_wrench); });
    const double upper = 1.0 - (top + static_cast<double>(i) * row) / height;
    const double lower = 1.0 - (top + static_cast<double>(i + 1) * row - gap) / height;
    panels += fmt::format(
        "set tmargin at screen {:.5f}\nset bmargin at screen {:.5f}\nset label 1 '{}' at graph 0.01, graph 0.92 textcolor rgb '{}'\n"
        "set xrange [{:.6g}:{:.6g}]\nset ylabel 'force [N]'\n{}{}plot ",
        upper, lower, felt.name, dark, seconds(felt.samples.front()), seconds(felt.samples.back()),
        i == 0 ? "set key at screen 0.535,0.985 center top horizontal Left reverse samplen 2 width -1\n" : "set nokey\n",
        i + 1 == displays.size() ? "set xlabel 'time since the controller started [s]'\n" : "");
    panels += fmt::format("$handle{} using 1:2 with lines lw 1.5 lc rgb '{}' title 'hand, estimated', ", i, palette[5]);
    if (known) panels += fmt::format("$true{} using 1:2 with lines lw 1.5 lc rgb '{}' title 'hand, true', ", i, dark);
    panels += fmt::format("$model{} using 1:2 with lines lw 1.5 lc rgb '{}' title 'model'\n", i, palette[3]);
  }
  return head("felt_time", 900, static_cast<int>(height)) + blocks +
         fmt::format(
             "set multiplot\nset lmargin at screen 0.08\nset rmargin at screen 0.98\nset xzeroaxis lc rgb '{}' lt 1 lw 1\n{}unset "
             "multiplot\n",
             dark, panels);
}

// Panels side by side, three in a row, on the same scales.
std::string felt_depth_script(const RunInfo& run, const std::vector<Felt>& displays) {
  if (displays.empty()) return {};
  const std::size_t columns = std::min<std::size_t>(3, displays.size());
  const std::size_t rows = (displays.size() + columns - 1) / columns;
  double least = 0.0, most = 0.0, deepest = 0.0, highest = 0.0;
  std::string blocks, panels;
  for (std::size_t i = 0; i < displays.size(); ++i) {
    TimeSlices depth(displays[i].samples), handle(displays[i].samples), model(displays[i].samples);
    for (const Sample& s : displays[i].samples) {
      const double d = 1e3 * virtual_depth_m(run, s), h = along_needle(run, s.handle_wrench), m = along_needle(run, s.virtual_wrench);
      if (!std::isfinite(d + h + m)) continue;
      depth.add(s, d);
      handle.add(s, h);
      model.add(s, m);
    }
    blocks += fmt::format("$depth{} << EOD\n", i);
    for (std::size_t k = 0; k < TimeSlices::count; ++k) {
      if (depth.slices[k].n == 0) continue;
      const auto n = static_cast<double>(depth.slices[k].n);
      const double d = depth.slices[k].sum / n, h = handle.slices[k].sum / n, m = model.slices[k].sum / n;
      blocks += fmt::format("{:.5g} {:.5g} {:.5g}\n", d, h, m);
      least = std::min({least, h, m});
      most = std::max({most, h, m});
      deepest = std::max(deepest, d);
      highest = std::min(highest, d);
    }
    blocks += "EOD\n";
    panels += fmt::format(
        "set title '{1}'\n{2}plot $depth{0} using 1:2 with lines lw 1.5 lc rgb '{3}' title 'hand, estimated', "
        "$depth{0} using 1:3 with lines lw 1.5 lc rgb '{4}' title 'model'\n",
        i, displays[i].name, i % columns == 0 ? "set ylabel 'force along the needle [N]'\n" : "unset ylabel\n", palette[5], palette[3]);
  }
  const double margin = 0.05 * (most - least) + 1e-3;
  const double height = 60.0 + 340.0 * static_cast<double>(rows);
  return head("felt_depth", 900, static_cast<int>(height)) + blocks +
         fmt::format(
             "set multiplot layout {},{} margins screen 0.08, screen 0.98, screen {:.4f}, screen {:.4f} spacing screen 0.05, screen "
             "{:.4f}\n"
             "set xrange [{:.5g}:{:.5g}]\nset yrange [{:.5g}:{:.5g}]\nset key top left Left reverse samplen 1.5 width -1\n"
             "set xlabel 'depth of the virtual tip [mm]'\nset xzeroaxis lc rgb '{}' lt 1 lw 1\n{}unset multiplot\n",
             rows, columns, 80.0 / height, 1.0 - 40.0 / height, 110.0 / height, std::floor(highest - 1.0), std::ceil(deepest + 1.0),
             least - margin, most + margin, dark, panels);
}

std::string display_energy_script(const std::vector<Felt>& displays) {
  if (displays.empty()) return {};
  std::string blocks, plots;
  for (std::size_t i = 0; i < displays.size(); ++i) {
    blocks += slice_means(fmt::format("energy{}", i), displays[i], [](const Sample& s) { return 1e3 * s.display_energy_j; });
    plots += fmt::format("{}$energy{} using ($1-{:.6g}):2 with lines lw 2 lc rgb '{}' title '{}'", i == 0 ? "plot " : ", ", i,
                         seconds(displays[i].samples.front()), palette[i % palette.size()], displays[i].name);
  }
  return head("display_energy", 900, 360) + blocks +
         fmt::format(
             "set xlabel 'time with the display [s]'\nset ylabel 'energy taken from the hand [mJ]'\nset autoscale xfixmax\n"
             "set xzeroaxis lc rgb '{}' lt 1 lw 1\nset key outside top center horizontal Left reverse samplen 2\n{}\n",
             dark, plots);
}

template <class Value>
std::string histogram_script(const std::string& name, const std::string& what, std::span<const Sample> samples, const Distribution& d,
                             Value&& value) {
  if (d.count == 0) return {};
  constexpr double bins_per_decade = 24.0;
  constexpr double least_us = 0.1;
  std::map<long, std::uint64_t> bins;
  for (const Sample& s : samples) ++bins[std::lround(std::floor(bins_per_decade * std::log10(std::max(least_us, value(s)))))];
  std::string block = "$bins << EOD\n";
  for (const auto& [index, count] : bins) {
    const double low = std::pow(10.0, static_cast<double>(index) / bins_per_decade);
    const double high = std::pow(10.0, static_cast<double>(index + 1) / bins_per_decade);
    block += fmt::format("{:.6g} {:.6g} {:.6g} {}\n", std::sqrt(low * high), low, high, count);
  }
  block += "EOD\n";
  // The three numbers stand in the legend, where they cannot run into one another.
  std::string marks, keys;
  const auto mark = [&](const char* label, double at, const char* colour, const char* dash) {
    const double where = std::max(least_us, at);
    marks += fmt::format("set arrow from {0:.6g}, graph 0 to {0:.6g}, graph 1 nohead lw 1.5 lc rgb '{1}' {2} front\n", where, colour, dash);
    keys += fmt::format(", keyentry with lines lw 1.5 lc rgb '{}' {} title '{} {:.1f} µs'", colour, dash, label, at);
  };
  mark("median", d.p50, dark, "dt 1");
  mark("99 %", d.p99, palette[3], "dt (8,5)");
  mark("greatest", d.max, palette[4], "dt (2,4)");
  return head(name, 900, 360) + block + marks +
         fmt::format(
             "set xlabel '{} [µs]'\nset ylabel 'ticks'\nset logscale xy\nset format y '%g'\nset format x '%g'\nset yrange [0.7:*]\n"
             "set style fill solid 0.75 noborder\nset key outside top center horizontal Left reverse samplen 2\n"
             "plot $bins using 1:4:2:3:(0.7):4 with boxxyerror lc rgb '{}'{}\n",
             what, palette[0], keys);
}

}  // namespace

std::vector<Figure> draw_figures(const RunInfo& run, const Summary& summary, std::span<const Sample> samples,
                                 const std::filesystem::path& folder) {
  std::vector<Figure> figures;
  std::string script;
  if (samples.empty()) return figures;
  const auto add = [&](const std::string& part, Figure figure) {
    if (part.empty()) return;
    script += part;
    figures.push_back(std::move(figure));
  };
  if (run.kind == RunInfo::Kind::Haptic) {
    const std::vector<Felt> displays = felt_displays(run, samples);
    add(felt_time_script(run, displays),
        {"felt_time.svg", "Force against time",
         "Along the needle, means in slices of time. Hand: on the handle, as the controller estimated it, and as it was where a simulation "
         "knows it. Model: what the virtual needle's base pushes with; at rest the hand pushes the same."});
    add(felt_depth_script(run, displays),
        {"felt_depth.svg", "Force against depth", "The same forces over the depth of the virtual tip: in above, out below."});
    add(display_energy_script(displays),
        {"display_energy.svg", "Energy of the display",
         "The guard's account of what a display took from the hand less what it gave. It opens with a small credit, and no more is kept in "
         "it "
         "than a spring could give back at the present force; where it would fall below zero the guard damps."});
  } else {
    add(force_depth_script(run, samples), {"force_depth.svg", "Base force against depth",
                                           "Solid: insertion. Dashed: withdrawal. Each point is the mean of a 0.25 mm slice of depth. "
                                           "Dotted: the shaft force density that the "
                                           "thesis found at 1 mm/s, from zero at the surface."});
    add(tracking_script(run, samples), {"tracking.svg", "Tracking error",
                                        "Distance between commanded and measured position of the needle's base, in slices of time; below "
                                        "0.1 µm counts as 0.1 µm. The scale "
                                        "is logarithmic."});
    add(overview_script(run, samples),
        {"overview.svg", "The run", "Depth of the tip and force along the needle, means in slices of time."});
  }
  if (run.eyes)
    add(markers_script(*run.eyes),
        {"markers.svg", "Markers against time",
         run.eyes->error ? "Mean displacement of the markers, and how far the tracked places are off the true ones."
                         : "Mean displacement of the markers."});
  add(histogram_script("tick_time", "execution time of the tick", samples, summary.tick_us,
                       [](const Sample& s) { return static_cast<double>(s.tick_us); }),
      {"tick_time.svg", "Tick time", "How long the controller computed in each tick. Both axes are logarithmic."});
  add(histogram_script("wakeup", "lateness of the wake-up", samples, summary.wakeup_late_us,
                       [](const Sample& s) { return static_cast<double>(s.wakeup_late_us); }),
      {"wakeup.svg", "Wake-up lateness",
       "How long after its due time each tick began; below 0.1 µs counts as 0.1 µs. Both axes are logarithmic."});
  if (!script.empty()) run_gnuplot(script + "unset output\n", folder);
  return figures;
}

}  // namespace trocar::report
