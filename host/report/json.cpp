#include <fmt/format.h>

#include <cmath>

#include "host/report/report.hpp"

namespace trocar::report {

namespace {

std::string text(std::string_view value) {
  std::string out = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      out += '\\';
      out += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      out += c;
    }
  }
  return out + '"';
}

std::string number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }  // shortest that reads back

// {"key": value, …} with values that are JSON already.
std::string object(std::initializer_list<std::pair<const char*, std::string>> members) {
  std::string out = "{";
  for (const auto& [key, value] : members) out += fmt::format("{}\"{}\": {}", out.size() > 1 ? ", " : "", key, value);
  return out + "}";
}

template <class List, class Function>
std::string array(const List& list, Function&& function) {
  std::string out = "[";
  for (const auto& item : list) out += (out.size() > 1 ? ", " : "") + function(item);
  return out + "]";
}

std::string json(const Tracking& t) {
  return object({{"ticks", std::to_string(t.ticks)},
                 {"rms_m", number(t.rms_m)},
                 {"max_m", number(t.max_m)},
                 {"rms_rad", number(t.rms_rad)},
                 {"max_rad", number(t.max_rad)}});
}

std::string json(const Distribution& d) {
  return object({{"count", std::to_string(d.count)}, {"p50", number(d.p50)}, {"p99", number(d.p99)}, {"max", number(d.max)}});
}

std::string json(const Insertion& i) {
  const std::string fit = !i.fit ? "null"
                                 : object({{"ticks", std::to_string(i.fit->ticks)},
                                           {"slope_n_per_m", number(i.fit->slope_n_per_m)},
                                           {"intercept_n", number(i.fit->intercept_n)},
                                           {"residual_rms_n", number(i.fit->residual_rms_n)}});
  return object({{"name", text(i.name)},
                 {"gain_set", text(i.gain_set)},
                 {"speed_m_s", number(i.speed_m_s)},
                 {"depth_m", number(i.depth_m)},
                 {"fit_20_65_mm", fit},
                 {"full_depth_force_n", number(i.full_depth_force_n)},
                 {"withdrawal_force_n", number(i.withdrawal_force_n)},
                 {"tracking_insert", json(i.insert)},
                 {"tracking_withdraw", json(i.withdraw)}});
}

std::string json(const Sag& s) {
  return object({{"phase", text(s.phase)},
                 {"force_n", number(s.force_n)},
                 {"command_n", number(s.command_n)},
                 {"error_m", number(s.error_m)},
                 {"expected_m", number(s.expected_m)},
                 {"expected_command_m", number(s.expected_command_m)}});
}

}  // namespace

std::string to_json(const RunInfo& run, const Summary& s) {
  return object({{"folder", text(run.folder.string())},
                 {"rig", text(run.rig)},
                 {"scene", text(run.scene)},
                 {"gains", text(run.gains)},
                 {"lockstep", run.lockstep ? "true" : "false"},
                 {"samples", std::to_string(s.samples)},
                 {"duration_s", number(s.duration_s)},
                 {"lost_ticks", std::to_string(s.lost_ticks)},
                 {"gaps", std::to_string(s.gaps)},
                 {"restarts", std::to_string(s.restarts)},
                 {"ticks_without_feedback", std::to_string(s.ticks_without_feedback)},
                 {"longest_without_feedback", std::to_string(s.longest_without_feedback)},
                 {"faults", array(s.faults, [](const std::string& f) { return text(f); })},
                 {"insertions", array(s.insertions, [](const Insertion& i) { return json(i); })},
                 {"tracking", array(s.tracking,
                                    [](const GainTracking& t) {
                                      return object({{"gain_set", text(t.gain_set)}, {"air", json(t.air)}, {"phantom", json(t.phantom)}});
                                    })},
                 {"sags", array(s.sags, [](const Sag& sag) { return json(sag); })},
                 {"step_m", number(s.step_m)},
                 {"tick_us", json(s.tick_us)},
                 {"wakeup_late_us", json(s.wakeup_late_us)},
                 {"notes", array(run.notes, [](const std::string& n) { return text(n); })}}) +
         "\n";
}

}  // namespace trocar::report
