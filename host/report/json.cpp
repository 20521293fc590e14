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
using Members = std::vector<std::pair<const char*, std::string>>;
std::string object(const Members& members) {
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
  return object({{"count", std::to_string(d.count)},
                 {"p50", number(d.p50)},
                 {"p99", number(d.p99)},
                 {"p99_99", number(d.p99_99)},
                 {"max", number(d.max)}});
}

std::string json(const Machine& m) {
  return object({{"text", text(m.text)},
                 {"real_time", m.real_time ? "true" : "false"},
                 {"overruns", std::to_string(m.loop.overruns)},
                 {"minor_faults", std::to_string(m.loop.minor_faults)},
                 {"major_faults", std::to_string(m.loop.major_faults)},
                 {"preemptions", std::to_string(m.loop.preemptions)},
                 {"allocations", std::to_string(m.loop.allocations)},
                 {"armed_page_faults", std::to_string(m.loop.armed_page_faults)},
                 {"armed_allocations", std::to_string(m.loop.armed_allocations)}});
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

std::string json(const Difference& d) { return object({{"ticks", std::to_string(d.ticks)}, {"rms_n", number(d.rms_n)}}); }

std::string json(const HapticDisplay& d) {
  return object({{"display", text(d.name)},
                 {"ticks", std::to_string(d.ticks)},
                 {"duration_s", number(d.duration_s)},
                 {"depth_m", number(d.depth_m)},
                 {"model_force_n", number(d.force_n)},
                 {"handle_less_model", json(d.difference)},
                 {"handle_less_model_at_rest", json(d.at_rest)},
                 {"least_energy_j", number(d.least_energy_j)},
                 {"unsolved_ticks", std::to_string(d.unsolved_ticks)},
                 {"most_contacts", std::to_string(d.most_contacts)},
                 {"observer_error", json(d.observer)},
                 {"true_hand_less_model", json(d.true_difference)},
                 {"observer_rise_s", number(d.observer_rise_s)}});
}

std::string json(const Sag& s) {
  return object({{"phase", text(s.phase)},
                 {"force_n", number(s.force_n)},
                 {"command_n", number(s.command_n)},
                 {"error_m", number(s.error_m)},
                 {"expected_m", number(s.expected_m)},
                 {"expected_command_m", number(s.expected_command_m)}});
}

std::string json(const Eyes& e) {
  const std::string error = !e.error ? "null"
                                     : object({{"places", std::to_string(e.error->places)},
                                               {"rms_px", number(e.error->rms_px)},
                                               {"worst_px", number(e.error->worst_px)},
                                               {"rms_m", number(e.error->rms_m)},
                                               {"worst_m", number(e.error->worst_m)}});
  return object({{"source", text(e.source)},
                 {"clock", text(e.clock)},
                 {"time_uncertainty_s", number(e.time_uncertainty_s)},
                 {"frames", std::to_string(e.frames)},
                 {"frames_lost", std::to_string(e.lost)},
                 {"frames_dropped", std::to_string(e.dropped)},
                 {"markers", std::to_string(e.markers)},
                 {"markers_not_seen", std::to_string(e.not_seen)},
                 {"most_displacement_m", number(e.most_displacement_m)},
                 {"track_s_p50", number(e.track_s_p50)},
                 {"track_s_p99", number(e.track_s_p99)},
                 {"error", error}});
}

}  // namespace

std::string to_json(const RunInfo& run, const Summary& s) {
  const bool haptic = run.kind == RunInfo::Kind::Haptic;
  Members members{{"folder", text(run.folder.string())},
                  {"kind", haptic ? "\"haptic\"" : "\"insertion\""},
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
                  {"faults", array(s.faults, [](const std::string& f) { return text(f); })}};
  if (haptic) {
    members.emplace_back("displays", array(s.displays, [](const HapticDisplay& d) { return json(d); }));
  } else {
    members.emplace_back("insertions", array(s.insertions, [](const Insertion& i) { return json(i); }));
    members.emplace_back("tracking", array(s.tracking, [](const GainTracking& t) {
                           return object({{"gain_set", text(t.gain_set)}, {"air", json(t.air)}, {"phantom", json(t.phantom)}});
                         }));
    members.emplace_back("sags", array(s.sags, [](const Sag& sag) { return json(sag); }));
  }
  members.emplace_back("step_m", number(s.step_m));
  members.emplace_back("tick_us", json(s.tick_us));
  members.emplace_back("wakeup_late_us", json(s.wakeup_late_us));
  members.emplace_back("machine", run.machine ? json(*run.machine) : "null");
  members.emplace_back("camera", run.eyes ? json(*run.eyes) : "null");
  members.emplace_back("notes", array(run.notes, [](const std::string& n) { return text(n); }));
  return object(members) + "\n";
}

}  // namespace trocar::report
