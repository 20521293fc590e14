#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>

#include "host/report/figures.hpp"
#include "host/report/report.hpp"

namespace trocar::report {

namespace {

namespace fs = std::filesystem;

constexpr double thesis_speed_m_s = 0.001;

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

constexpr const char* none = "<span class=\"none\">not measured</span>";

// A number in a unit, or that it was not measured.
std::string number(double value, int digits, const char* unit) {
  return std::isfinite(value) ? fmt::format("{:.{}f}&nbsp;{}", value, digits, unit) : none;
}
std::string millimetres(double metres, int digits = 3) { return number(1e3 * metres, digits, "mm"); }
std::string newtons(double n) { return number(n, 2, "N"); }
std::string micrometres(double metres) { return number(1e6 * metres, 1, "µm"); }

std::string row(const std::vector<std::string>& cells) {
  std::string out = "<tr>";
  for (const std::string& cell : cells) out += "<td>" + cell + "</td>";
  return out + "</tr>\n";
}

std::string table(const std::vector<const char*>& heads, const std::string& rows) {
  std::string out = "<div class=\"wide\"><table>\n<thead><tr>";
  for (const char* head : heads) out += fmt::format("<th>{}</th>", head);
  return out + "</tr></thead>\n<tbody>\n" + rows + "</tbody></table></div>\n";
}

std::string speed(double m_s) { return fmt::format("<span class=\"n\">{:.3g}&nbsp;mm/s</span>", 1e3 * m_s); }

// The insertion whose speed is nearest to the thesis's 1 mm/s, rather with the run's own gains.
const Insertion* nearest_to_thesis(const RunInfo& run, const Summary& summary) {
  const auto distance = [&](const Insertion& i) {
    return std::pair(i.gain_set == run.gains ? 0 : 1, std::abs(i.speed_m_s - thesis_speed_m_s));
  };
  const auto found = std::ranges::min_element(summary.insertions, {}, distance);
  return found == summary.insertions.end() ? nullptr : &*found;
}

std::string beside_thesis(const RunInfo& run, const Summary& summary) {
  std::string rows;
  const Insertion* near = nearest_to_thesis(run, summary);
  const auto measured = [&](bool known, auto&& value) {
    return known ? value() + "<br><small>at " + speed(near->speed_m_s) + "</small>" : std::string(none);
  };
  const bool fitted = near != nullptr && near->fit.has_value();
  rows += row({"Shaft force density", "34&nbsp;N/m at 1&nbsp;mm/s <small>(section 4.2, figure 4.9)</small>",
               measured(fitted, [&] { return fmt::format("{:.2f}&nbsp;N/m", near->fit->slope_n_per_m); }),
               "slope of base force over depth, 20 to 65&nbsp;mm; it grows with speed (figure 4.19)"});
  rows += row({"Force peak at the tip", "68&nbsp;N/m at the most distal node, at 1&nbsp;mm/s",
               measured(fitted, [&] { return fmt::format("{:+.3f}&nbsp;N against a uniform shaft", near->fit->intercept_n); }),
               "the same line at depth 0; a base force shows the tip's total, not its density"});
  rows += row({"Base force at full depth", "2.3 to 2.4&nbsp;N at 70&nbsp;mm, 1&nbsp;mm/s <small>(read from figure 4.10)</small>",
               measured(near != nullptr && std::isfinite(near->full_depth_force_n),
                        [&] { return newtons(near->full_depth_force_n) + " at " + millimetres(near->depth_m, 1); }),
               "mean over the deepest 0.5&nbsp;mm"});
  if (summary.sags.empty()) {
    rows += row({"Sag with the thesis's gains", "F/K<sub>p</sub>: 3&nbsp;mm at 2.5&nbsp;N", none, ""});
  }
  for (const Sag& sag : summary.sags) {
    rows += row(
        {"Sag with the thesis's gains, " + escaped(sag.phase),
         fmt::format("F/K<sub>p</sub> = {} at {}", millimetres(sag.expected_m), newtons(sag.force_n)), millimetres(sag.error_m),
         fmt::format("K<sub>p</sub> = {:g}&nbsp;N/m; the mechanism was asked for {}, which sags by {}: friction in it makes the difference",
                     run.kp_n_per_m, newtons(sag.command_n), millimetres(sag.expected_command_m))});
  }
  rows += row({"Resolution", "40&nbsp;µm", micrometres(summary.step_m), "median motion of the base for one count of one encoder"});
  return table({"Quantity", "Thesis", "This run", "How it was measured"}, rows);
}

std::string insertions_table(const RunInfo& run, const Summary& summary) {
  std::string rows;
  for (const Insertion& i : summary.insertions) {
    rows += row({speed(i.speed_m_s), escaped(i.gain_set.empty() ? run.gains : i.gain_set), millimetres(i.depth_m, 1),
                 i.fit ? fmt::format("<span class=\"n\">{:.2f}&nbsp;N/m</span>", i.fit->slope_n_per_m) : none,
                 i.fit ? fmt::format("{:.3f}&nbsp;N", i.fit->intercept_n) : none, newtons(i.full_depth_force_n),
                 newtons(i.withdrawal_force_n), millimetres(i.insert.rms_m), millimetres(i.withdraw.rms_m)});
  }
  return table(
      {"Speed", "Gains", "Depth", "Slope", "At depth 0", "Force at full depth", "Strongest pull", "Error in (rms)", "Error out (rms)"},
      rows);
}

std::string displays_table(const RunInfo& run, const Summary& summary) {
  if (summary.displays.empty()) return "<p class=\"none\">The run ended before the first display.</p>\n";
  std::vector<const char*> heads{"Display",          "Time",         "Greatest depth", "Greatest model force", "Hand less model, rms",
                                 "The same at rest", "Least energy", "Ticks unsolved", "Contacts, most"};
  const bool known = !run.truth.empty();
  if (known) heads.insert(heads.end(), {"True hand less model, rms", "Estimate less true hand, rms"});
  std::string rows;
  for (const HapticDisplay& d : summary.displays) {
    std::vector<std::string> cells{escaped(d.name),
                                   number(d.duration_s, 1, "s"),
                                   millimetres(d.depth_m, 1),
                                   newtons(d.force_n),
                                   number(d.difference.rms_n, 3, "N"),
                                   number(d.at_rest.rms_n, 3, "N"),
                                   number(1e3 * d.least_energy_j, 2, "mJ"),
                                   fmt::format("{} of {}", d.unsolved_ticks, d.ticks),
                                   fmt::format("{}", d.most_contacts)};
    if (known) {
      const bool rises = std::isfinite(d.observer_rise_s);
      cells.push_back(number(d.true_difference.rms_n, 3, "N"));
      cells.push_back(number(d.observer.rms_n, 3, "N") + (rises ? ", rise " + number(1e3 * d.observer_rise_s, 0, "ms") : std::string()));
    }
    rows += row(cells);
  }
  return table(heads, rows) +
         "<p class=\"sub\">Hand: its force on the handle, as the controller estimates it from encoders and motors, with the noise of that. "
         "At "
         "rest: where the handle goes slower than 5&nbsp;mm/s.</p>\n";
}

std::string tracking_table(const Summary& summary) {
  std::string rows;
  for (const GainTracking& t : summary.tracking) {
    for (const auto& [where, tracking] : {std::pair{"air", t.air}, std::pair{"phantom", t.phantom}}) {
      rows +=
          row({escaped(t.gain_set), where, fmt::format("{}", tracking.ticks), millimetres(tracking.rms_m), millimetres(tracking.max_m),
               number(tracking.rms_rad * 180.0 / std::numbers::pi, 4, "°"), number(tracking.max_rad * 180.0 / std::numbers::pi, 4, "°")});
    }
  }
  return table({"Gains", "Where", "Ticks", "Position, rms", "Position, greatest", "Angle, rms", "Angle, greatest"}, rows);
}

std::string timing_table(const RunInfo& run, const Summary& summary) {
  std::string rows;
  const auto add = [&](const char* name, const Distribution& d) {
    if (d.count == 0) {
      const std::string why = run.lockstep ? "<span class=\"none\">a virtual clock has none</span>" : none;
      rows += row({name, why, why, why, why});
    } else {
      rows += row({name, number(d.p50, 1, "µs"), number(d.p99, 1, "µs"), number(d.p99_99, 1, "µs"), number(d.max, 1, "µs")});
    }
  };
  add("Tick, execution time", summary.tick_us);
  add("Wake-up, lateness", summary.wakeup_late_us);
  return table({"", "Median", "99&nbsp;%", "99.99&nbsp;%", "Greatest"}, rows);
}

std::string machine_table(const RunInfo& run) {
  if (!run.machine) return {};
  const LoopCounters& loop = run.machine->loop;
  std::string rows;
  rows += row({"Controller ran on", escaped(run.machine->text)});
  rows += row({"Verdict", run.machine->real_time ? "real-time set-up complete"
                                                 : "<b>only for simulation</b>: the real-time set-up is not complete (trocar rig check)"});
  rows += row({"Ticks that ended after the next one was due", fmt::format("{}", loop.overruns)});
  rows += row({"Page faults of the loop",
               fmt::format("{} minor, {} major; {} while armed", loop.minor_faults, loop.major_faults, loop.armed_page_faults)});
  rows += row({"Allocations of the loop", fmt::format("{}; {} while armed", loop.allocations, loop.armed_allocations)});
  rows += row({"Loop taken off its core", fmt::format("{} times", loop.preemptions)});
  return table({"Machine", "since the controller's start"}, rows);
}

std::string counts_table(const Summary& s) {
  std::string rows;
  std::string faults;
  for (const std::string& fault : s.faults) faults += (faults.empty() ? "" : ", ") + escaped(fault);
  rows += row({"Ticks in the recording", fmt::format("{} in {:.1f}&nbsp;s", s.samples, s.duration_s)});
  rows += row({"Lost samples", s.lost_ticks == 0 ? "none" : fmt::format("{} in {} gaps", s.lost_ticks, s.gaps)});
  rows +=
      row({"Ticks without complete feedback",
           s.ticks_without_feedback == 0 ? "none"
                                         : fmt::format("{}, at most {} in a row", s.ticks_without_feedback, s.longest_without_feedback)});
  rows += row({"Faults", faults.empty() ? "none" : faults});
  if (s.restarts > 0) {
    rows += row({"Restarts of the controller", fmt::format("{}; this report shows what came after the last", s.restarts)});
  }
  return table({"Recording", ""}, rows);
}

std::string eyes_table(const Eyes& e) {
  std::string rows;
  rows += row({"Frames", fmt::format("{} of {} markers; {} lost, {} dropped", e.frames, e.markers, e.lost, e.dropped)});
  rows += row({"Markers not seen", fmt::format("{} of {} places", e.not_seen, e.frames * e.markers)});
  rows += row({"Greatest displacement of a marker", millimetres(e.most_displacement_m, 2)});
  rows += row({"Time of tracking, a frame",
               fmt::format("median {}, 99&nbsp;% {}", number(1e3 * e.track_s_p50, 1, "ms"), number(1e3 * e.track_s_p99, 1, "ms"))});
  rows +=
      row({"Time of a frame",
           e.clock == "rig" ? "on the rig's clock" +
                                  (e.time_uncertainty_s > 0.0 ? ", held to " + number(1e6 * e.time_uncertainty_s, 0, "µs") : std::string())
                            : "on the clock \"" + escaped(e.clock) + "\", which is not the rig's"});
  if (e.error) {
    rows += row({"Tracked less true place, in the image",
                 fmt::format("{} rms, {} at most", number(e.error->rms_px, 3, "px"), number(e.error->worst_px, 2, "px"))});
    rows += row({"Tracked less true place, in the phantom's plane",
                 fmt::format("{} rms, {} at most", micrometres(e.error->rms_m), micrometres(e.error->worst_m))});
  }
  return table({"Camera", ""}, rows);
}

// RFC 4648: a picture within the page, which stays one file.
std::string base64(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  constexpr std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t have = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) three = (three << 8U) | (k < have ? static_cast<std::uint8_t>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) out += k <= have ? digits[(three >> (18U - 6U * k)) & 63U] : '=';
  }
  return out;
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) text.replace(at, from.size(), to);
}

// An SVG file as part of a page: without its prolog, and with names of its own, since every file defines the same ones.
std::string inlined(const fs::path& path, const std::string& prefix) {
  std::ifstream in(path, std::ios::binary);
  std::string svg{std::istreambuf_iterator<char>(in), {}};
  const std::size_t start = svg.find("<svg");
  if (start == std::string::npos) throw ReportError("gnuplot wrote no figure to " + path.string());
  svg.erase(0, start);
  for (const char quote : {'\'', '"'}) {
    replace_all(svg, std::string(" id=") + quote, std::string(" id=") + quote + prefix + "_");
    replace_all(svg, std::string("href=") + quote + "#", std::string("href=") + quote + "#" + prefix + "_");
  }
  replace_all(svg, "url(#", "url(#" + prefix + "_");
  return svg;
}

constexpr const char* style = R"(
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; margin-bottom: 0.2rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; }
.wide { overflow-x: auto; } table { border-collapse: collapse; width: 100%; font-size: 0.92rem; }
th { text-align: left; font-weight: 600; border-bottom: 2px solid #555; } td, th { padding: 0.3rem 0.8rem 0.3rem 0; vertical-align: top; }
td { border-bottom: 1px solid #ddd; } small, .none, figcaption, .sub { color: #666; }
.n { white-space: nowrap; }
figure { margin: 1rem 0; } figure svg, figure img { width: 100%; height: auto; } figcaption { font-size: 0.9rem; }
)";

std::string page(const RunInfo& run, const Summary& summary, const std::vector<Figure>& figures, const fs::path& drawn) {
  const bool haptic = run.kind == RunInfo::Kind::Haptic;
  std::string out = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" content=\"width=device-width\">\n"
      "<title>{5}: {0}, {1}</title>\n<style>{2}</style>\n</head>\n<body>\n<h1>{5}</h1>\n"
      "<p class=\"sub\">Rig {0}, scene {1}, gains {3}, {4}.</p>\n",
      escaped(run.rig), escaped(run.scene), style, escaped(run.gains), run.lockstep ? "in lock-step on a virtual clock" : "in real time",
      haptic ? "A virtual needle in the hand" : "Needle insertion");
  const auto figure = [&](const char* file) {
    for (const Figure& f : figures) {
      if (f.file != file) continue;
      out += fmt::format("<figure>\n{}\n<figcaption><b>{}.</b> {}</figcaption>\n</figure>\n",
                         inlined(drawn / f.file, fs::path(f.file).stem().string()), f.title, f.caption);
    }
  };
  if (haptic) {
    out += "<h2>Displays</h2>\n" + displays_table(run, summary);
    for (const char* file : {"felt_time.svg", "felt_depth.svg", "display_energy.svg"}) figure(file);
  } else {
    figure("force_depth.svg");
    out += "<h2>Beside the thesis</h2>\n" + beside_thesis(run, summary);
    out += "<h2>Insertions</h2>\n" + insertions_table(run, summary);
    out += "<h2>Tracking</h2>\n" + tracking_table(summary);
    figure("tracking.svg");
    out += "<h2>Course of the run</h2>\n";
    figure("overview.svg");
  }
  if (run.eyes) {
    out += "<h2>What the camera saw</h2>\n";
    if (!run.eyes->picture.empty())
      out += fmt::format(
          "<figure>\n<img alt=\"markers of the phantom and their displacements\" "
          "src=\"data:image/jpeg;base64,{}\">\n<figcaption><b>Markers "
          "of the phantom.</b> The frame in which they are furthest from the first one; crosses where they were found, arrows from where "
          "they "
          "were then. As figure 3.7&nbsp;(b) of the thesis.</figcaption>\n</figure>\n",
          base64(run.eyes->picture));
    out += eyes_table(*run.eyes);
    figure("markers.svg");
  }
  out += "<h2>Timing</h2>\n" + timing_table(run, summary) + machine_table(run);
  figure("tick_time.svg");
  figure("wakeup.svg");
  out += "<h2>Completeness</h2>\n" + counts_table(summary);
  if (!run.notes.empty()) {
    out += "<h2>Notes</h2>\n<ul>\n";
    for (const std::string& note : run.notes) out += "<li>" + escaped(note) + "</li>\n";
    out += "</ul>\n";
  }
  return out + "<p class=\"sub\">Every number of this run was computed from its samples (capture.mcap, samples.csv)" +
         (haptic ? (run.truth.empty() ? "." : " and what the simulation knew (truth.csv).")
                 : ". Thesis: S. P. DiMaio, Modelling, Simulation and Planning of Needle Motion in Soft Tissues, University of British "
                   "Columbia, 2003.") +
         "</p>\n</body>\n</html>\n";
}

// A folder beside the results that goes away with what was not renamed out of it.
class Scratch {
 public:
  explicit Scratch(const fs::path& parent) {
    std::string name = (parent / ".report-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw ReportError("cannot write into " + parent.string() + ": " + std::strerror(errno) +
                        "; choose a run folder that exists and that you may write to");
    }
    path_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

}  // namespace

void write_report(const RunInfo& run, const Summary& summary, std::span<const Sample> all) {
  const Scratch scratch(run.folder);
  const auto figures = draw_figures(run, summary, after_last_restart(all), scratch.path());
  {
    std::ofstream file(scratch.path() / "report.html", std::ios::binary);
    file << page(run, summary, figures, scratch.path());
    if (!file.flush()) throw ReportError("cannot write " + (run.folder / "report.html").string() + ": free some space");
  }
  try {
    fs::create_directories(run.folder / "figures");
    for (const Figure& figure : figures) fs::rename(scratch.path() / figure.file, run.folder / "figures" / figure.file);
    fs::rename(scratch.path() / "report.html", run.folder / "report.html");
  } catch (const fs::filesystem_error& error) {
    throw ReportError(std::string("cannot write the report: ") + error.what());
  }
}

}  // namespace trocar::report
