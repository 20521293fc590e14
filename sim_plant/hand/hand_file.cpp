#include "sim_plant/hand/hand_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include "common/config/document.hpp"
#include "common/config/user_error.hpp"

namespace trocar::sim_plant {
namespace {

std::vector<std::string_view> fields(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  std::vector<std::string_view> all;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    all.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return all;
}

ArmAxis translation(const config::Table& t) {
  ArmAxis a;
  a.mass = t.number("mass_kg", {1e-3, 100.0}, "moving mass of the arm, such as 1.0");
  a.damping = t.number("damping_n_s_per_m", {0.0, 1e4}, "of the arm about what it wants, such as 10");
  a.stiffness = t.number("stiffness_n_per_m", {0.0, 1e5}, "of the arm about what it wants, such as 200");
  a.grip_damping = t.number("grip_damping_n_s_per_m", {0.0, 1e4}, "between arm and handle, such as 30");
  a.grip_stiffness = t.number("grip_stiffness_n_per_m", {1.0, 1e6}, "between arm and handle, such as 2000");
  a.largest = t.number("largest_n", {0.1, 1e3}, "force at which the grip slips, such as 40");
  a.tremor = t.number("tremor_n", {0.0, 100.0}, "root mean square, such as 0.05; 0 for a hand of stone");
  return a;
}

ArmAxis rotation(const config::Table& t) {
  ArmAxis a;
  a.mass = t.number("inertia_kg_m2", {1e-6, 1.0}, "of hand and wrist about the handle, such as 0.001");
  a.damping = t.number("damping_nm_s_per_rad", {0.0, 100.0}, "of the wrist, such as 0.01");
  a.stiffness = t.number("stiffness_nm_per_rad", {0.0, 1e3}, "of the wrist, such as 0.3");
  a.grip_damping = t.number("grip_damping_nm_s_per_rad", {0.0, 100.0}, "between wrist and handle, such as 0.02");
  a.grip_stiffness = t.number("grip_stiffness_nm_per_rad", {1e-3, 1e4}, "between wrist and handle, such as 3");
  a.largest = t.number("largest_nm", {1e-3, 100.0}, "moment at which the grip slips, such as 1");
  a.tremor = t.number("tremor_nm", {0.0, 1.0}, "root mean square, such as 0.0005");
  return a;
}

RecordedArm recorded_arm(const config::Table& t) {
  return {t.number("stiffness_n_per_m", {0.0, 1e4}, "about the recorded way, such as 200"),
          t.number("damping_n_s_per_m", {0.0, 1e3}, "about the recorded way, such as 10"),
          t.number("stiffness_nm_per_rad", {0.0, 100.0}, "about the recorded angle, such as 0.3"),
          t.number("damping_nm_s_per_rad", {0.0, 10.0}, "about the recorded angle, such as 0.01")};
}

Habit intention(const config::Table& t) {
  const config::Range speed{1e-4, 1.0};
  const config::Range rest{0.0, 600.0};
  const double forward = t.number("forward_m", {1e-3, 1.0}, "along the needle, from where the handle was taken, such as 0.075");
  const double push = t.number("push_speed_m_s", speed, "mean speed on the way in, such as 0.025");
  const double draw = t.number("draw_speed_m_s", speed, "mean speed on the way out, such as 0.025");
  const double rest_out = t.number("rest_out_s", rest, "before each push, such as 1.0");
  const double rest_in = t.number("rest_in_s", rest, "between push and draw, such as 1.0");
  Habit habit;
  const auto go = [&](double seconds, double along) {
    if (seconds > 0.0) habit.way.push_back({habit.way.back().time_s + seconds, {along, 0.0, 0.0}});
  };
  habit.way.push_back({});
  go(rest_out, 0.0);
  go(forward / push, forward);
  go(rest_in, forward);
  go(forward / draw, 0.0);
  habit.period_s = habit.way.back().time_s;
  return habit;
}

}  // namespace

std::vector<RecordedWrench> read_recording(const std::filesystem::path& file) {
  const auto fail = [&](std::size_t line, const std::string& what) {
    throw config::UserError(fmt::format("{}:{}: {}", file.string(), line, what));
  };
  constexpr const char* remedy = "give the truth.csv or samples.csv of a haptic run";
  std::ifstream in(file, std::ios::binary);
  std::string line;
  if (!in || !std::getline(in, line)) throw config::UserError(fmt::format("{}: cannot be read, or is empty; {}", file.string(), remedy));
  const std::string header = line;  // the names are views of it
  const auto names = fields(header);
  const auto column = [&](const std::string& name) { return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin()); };
  const std::string who = column("hand_fx_n") < names.size() ? "hand_" : "handle_";
  const std::array<std::string, 7> wanted{"time_ns", who + "fx_n", who + "fy_n", who + "tau_nm", "x_m", "y_m", "theta_rad"};
  std::array<std::size_t, wanted.size()> at{};
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    at[k] = column(wanted[k]);
    if (at[k] == names.size()) fail(1, fmt::format("there is no column {}; {}", wanted[k], remedy));
  }

  std::vector<RecordedWrench> all;
  double begin_s = 0.0;
  for (std::size_t number = 2; std::getline(in, line); ++number) {
    const auto words = fields(line);
    if (words.size() != names.size())
      fail(number, fmt::format("{} fields instead of {}; was the file cut off?", words.size(), names.size()));
    std::array<double, wanted.size()> value{};
    for (std::size_t k = 0; k < wanted.size(); ++k) {
      const std::string_view word = words[at[k]];
      const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value[k]);
      if (error != std::errc{} || end != word.data() + word.size())
        fail(number, fmt::format("{} = {}: no number; {}", wanted[k], word, remedy));
    }
    const bool pushes = std::isfinite(value[1]) && std::isfinite(value[2]) && std::isfinite(value[3]);
    RecordedWrench r{1e-9 * value[0], {}, {value[4], value[5], value[6]}};
    if (pushes) r.wrench = {value[1], value[2], value[3]};
    if (all.empty()) {
      if (r.wrench == std::array<double, 3>{}) continue;
      begin_s = r.time_s;
    }
    r.time_s -= begin_s;
    if (!std::isfinite(r.time_s) || (!all.empty() && r.time_s <= all.back().time_s))
      fail(number, fmt::format("time_ns = {}: times have to increase; {}", words[at[0]], remedy));
    if (!std::ranges::all_of(r.pose, [](double x) { return std::isfinite(x); }))
      fail(number, "the handle's pose is no number; cut the recording off before this line");
    all.push_back(r);
  }
  if (all.empty()) throw config::UserError(fmt::format("{}: no hand pushes in it; {}", file.string(), remedy));
  return all;
}

Hand read_hand(const std::filesystem::path& file, std::uint64_t seed) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  HandConfig config;
  config.seed = ~seed;  // the machine's own noise has that seed
  Habit habit;
  const double take_after_s = root.number("take_after_s", {0.0, 600.0}, "when the handle is taken after the motors came on, such as 0.5");
  if (root.has("replay")) {
    std::filesystem::path recording = root.text("replay", "the truth.csv or samples.csv of a haptic run");
    if (recording.is_relative()) recording = file.parent_path() / recording;
    if (const auto arm = root.optional_table("arm")) habit.recorded_arm = recorded_arm(*arm);
    document.refuse_unknown_keys();
    habit.recording = read_recording(recording);
  } else {
    config.tremor_hz = root.number("tremor_hz", {1.0, 50.0}, "middle of the tremor's band, such as 10");
    config.translation = translation(root.table("translation"));
    config.rotation = rotation(root.table("rotation"));
    habit = intention(root.table("intention"));
    document.refuse_unknown_keys();
  }
  habit.take_after_s = take_after_s;
  return Hand(config, std::move(habit));
}

}  // namespace trocar::sim_plant
