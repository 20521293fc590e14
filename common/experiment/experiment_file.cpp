#include "common/experiment/experiment_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "common/config/document.hpp"
#include "common/config/user_error.hpp"

namespace trocar::experiment {

namespace {

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + '"';
}

constexpr std::array insertion_keys{"speeds_m_s",      "depth_m",       "standoff_m",         "lane_spacing_m", "approach_speed_m_s",
                                    "touch_speed_m_s", "touch_force_n", "withdraw_speed_m_s", "dwell_s",        "thesis_check",
                                    "thesis_speed_m_s"};
constexpr std::array haptic_keys{"hand", "displays", "display_s", "take_s"};

template <class Keys>
void refuse_keys_of(const char* kind, const Keys& keys, const config::Table& t) {
  for (const char* key : keys)
    if (t.has(key)) t.fail(key, fmt::format("belongs to experiments of the other kind; remove it, or write kind = \"{}\"", kind));
}

InsertionCourse read_insertion(const config::Table& t) {
  const config::Range speed{1e-5, 0.2};
  InsertionCourse e;
  e.speeds_m_s = t.list("speeds_m_s", speed, "insertion speeds, such as [0.001, 0.009] for 1 and 9 mm/s");
  e.depth_m = t.number("depth_m", {1e-4, 1.0}, "depth of the tip below the entry face, such as 0.07");
  e.standoff_m = t.number("standoff_m", {1e-4, 0.5}, "gap between tip and entry face before an insertion, such as 0.01");
  e.lane_spacing_m = t.number("lane_spacing_m", {0.0, 0.5}, "distance between insertions, such as 0.01");
  e.approach_speed_m_s = t.number("approach_speed_m_s", speed, "speed in the air, such as 0.03");
  e.touch_speed_m_s = t.number("touch_speed_m_s", speed, "speed while feeling for the surface, such as 0.002");
  e.touch_force_n = t.number("touch_force_n", {0.01, 10.0}, "force that counts as contact, several times the sensor noise, such as 0.06");
  e.withdraw_speed_m_s = t.number("withdraw_speed_m_s", speed, "such as 0.01");
  e.dwell_s = t.number("dwell_s", {0.0, 600.0}, "rest at full depth, such as 0.5");
  e.thesis_check = t.flag_or("thesis_check", false);
  e.thesis_speed_m_s = t.number_or("thesis_speed_m_s", 0.005, speed, "speed of the insertion with the thesis's gains, such as 0.005");
  return e;
}

HapticCourse read_haptic(const config::Table& t) {
  HapticCourse e;
  const auto displays =
      t.texts("displays", {to_string(Display::FourChannel), to_string(Display::Impedance), to_string(Display::Admittance)});
  for (const std::string& name : displays) e.displays.push_back(*display_of(name));
  e.display_s = t.number("display_s", {0.1, 3600.0}, "time that a person has with each display, such as 30");
  e.take_s = t.number("take_s", {0.1, 600.0}, "time to take the handle after the motors came on, such as 5");
  return e;
}

}  // namespace

Experiment read_experiment(const std::filesystem::path& file) {
  const auto document = config::Document::load(file);
  const config::Table t = document.root();
  Experiment e;
  const bool haptic = t.one_of_or("kind", "insertion", {"insertion", "haptic"}) == "haptic";
  if (haptic) refuse_keys_of("insertion", insertion_keys, t);
  if (!haptic) refuse_keys_of("haptic", haptic_keys, t);
  e.name = t.text("name", "a short name for reports");
  e.rig = t.text("rig", "a rig's name, such as \"ubc_twin\", or a path");
  e.scene = t.text("scene", "a scene's name, such as \"phantom\", or a path");
  e.plant = t.text_or("plant", "");
  if (haptic) {
    e.hand = t.text("hand", "who holds the handle of a simulated rig: a name in share/hands, such as \"person\", or a path");
    e.course = read_haptic(t);
  } else {
    e.course = read_insertion(t);
  }
  document.refuse_unknown_keys();
  return e;
}

void replace(Experiment& e, const std::vector<double>& speeds_m_s, const std::string& hand) {
  if (!speeds_m_s.empty() && e.haptic())
    throw config::UserError(fmt::format("--speeds: the experiment {} is haptic and has no insertion speeds; leave it out", e.name));
  if (!hand.empty() && !e.haptic())
    throw config::UserError(
        fmt::format("--hand: nobody holds the handle in the experiment {}; leave it out, or take a haptic one", e.name));
  if (!speeds_m_s.empty()) std::get<InsertionCourse>(e.course).speeds_m_s = speeds_m_s;
  if (!hand.empty()) e.hand = hand;
}

void write_run(const std::filesystem::path& folder, const Run& run) {
  std::string s;
  s += fmt::format("experiment = {}\nkind = \"{}\"\nrig = {}\nscene = {}\nlockstep = {}\n", quoted(run.experiment),
                   run.haptic ? "haptic" : "insertion", quoted(run.rig), quoted(run.scene), run.lockstep);
  s += fmt::format("surface_y_m = {:.17g}\ncentre_x_m = {:.17g}\nneedle_length_m = {:.17g}\n", run.placement.surface_y_m,
                   run.placement.centre_x_m, run.placement.needle_length_m);
  s += fmt::format("thesis_stiffness_n_per_m = {:.17g}\nsimulated_s = {:.17g}\nwall_s = {:.17g}\ncompleted = {}\n",
                   run.thesis_stiffness_n_per_m, run.simulated_s, run.wall_s, run.completed);
  if (!run.outcome.empty()) s += fmt::format("outcome = {}\n", quoted(run.outcome));
  for (const auto& note : run.notes) s += fmt::format("\n[[note]]\ntext = {}\n", quoted(note));
  for (const Phase& p : run.phases) {
    s += fmt::format("\n[[phase]]\nname = {}\nkind = \"{}\"\nspeed_m_s = {:.17g}\ngain_set = {}\nfirst_tick = {}\nlast_tick = {}\n",
                     quoted(p.name), to_string(p.kind), p.speed_m_s, quoted(p.gain_set), p.first_tick, p.last_tick);
    if (p.kind == PhaseKind::Haptic) s += fmt::format("display = \"{}\"\n", to_string(p.display));
  }
  const auto path = folder / "run.toml";
  const auto aside = folder / ".run.toml.part";
  {
    std::ofstream out(aside);
    out << s;
    out.flush();
    if (!out)
      throw config::UserError(
          fmt::format("{}: cannot be written ({}): give a folder with room that you may write to", path.string(), std::strerror(errno)));
  }
  std::filesystem::rename(aside, path);
}

Run read_run(const std::filesystem::path& folder) {
  const auto document = config::Document::load(folder / "run.toml");
  const config::Table t = document.root();
  const config::Range any{-1e9, 1e9};
  constexpr const char* remedy = "a run.toml is written by trocar; run the experiment again";
  Run run;
  run.experiment = t.text("experiment", remedy);
  run.haptic = t.one_of_or("kind", "insertion", {"insertion", "haptic"}) == "haptic";
  run.rig = t.text("rig", remedy);
  run.scene = t.text("scene", remedy);
  run.lockstep = t.flag("lockstep");
  run.placement = {t.number("surface_y_m", any, remedy), t.number("centre_x_m", any, remedy), t.number("needle_length_m", any, remedy)};
  run.thesis_stiffness_n_per_m = t.number("thesis_stiffness_n_per_m", any, remedy);
  run.simulated_s = t.number("simulated_s", any, remedy);
  run.wall_s = t.number("wall_s", any, remedy);
  run.completed = t.flag("completed");
  run.outcome = t.text_or("outcome", "");
  for (const config::Table& note : t.tables("note")) run.notes.push_back(note.text("text", remedy));
  for (const config::Table& p : t.tables("phase")) {
    const std::string kind = p.text("kind", remedy);
    const auto known = phase_kind(kind);
    if (!known) p.fail("kind", std::string("no such phase; ") + remedy);
    run.phases.push_back({p.text("name", remedy),
                          *known,
                          p.number("speed_m_s", any, remedy),
                          p.text("gain_set", remedy),
                          static_cast<std::uint64_t>(p.integer("first_tick", 0, INT64_MAX, remedy)),
                          static_cast<std::uint64_t>(p.integer("last_tick", 0, INT64_MAX, remedy)),
                          {}});
    if (*known != PhaseKind::Haptic) continue;
    const auto display = display_of(p.text("display", remedy));
    if (!display) p.fail("display", std::string("no such display; ") + remedy);
    run.phases.back().display = *display;
  }
  document.refuse_unknown_keys();
  return run;
}

}  // namespace trocar::experiment
