#include "host/cli/rig_commands.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/config/user_error.hpp"
#include "common/experiment/experiment.hpp"
#include "common/mechanism/capability.hpp"
#include "common/rig/bus_budget.hpp"
#include "host/rig/client.hpp"

namespace trocar::cli {

namespace {

constexpr double find_rig_s = 3.0;
constexpr double answer_s = 3.0;
constexpr double deg = 180.0 / std::numbers::pi;

int say(const host::RigReply& r) {
  const bool good = r.reply.code == ReplyCode::Done || r.reply.code == ReplyCode::Accepted;
  if (good) {
    fmt::print("{}: done, mode {}\n", to_string(r.reply.kind), to_string(r.reply.mode));
    return 0;
  }
  fmt::print(stderr, "trocar: the rig refused {}: {}\n", to_string(r.reply.kind), r.text.empty() ? to_string(r.reply.code) : r.text);
  return 1;
}

int one_command(std::uint32_t domain, CommandKind kind) {
  host::RigClient client(domain);
  client.wait_for_rig(find_rig_s);
  return say(client.ask(kind, answer_s));
}

}  // namespace

int rig_info(const std::string& name, bool json) {
  const auto file = config::find_share("rigs", name);
  const rig::Rig r = config::read_rig(file);
  mechanism::DriveLimits drives;
  for (std::size_t i = 0; i < r.drives(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    drives.peak_torque_nm[k] = r.actuation.joint_torque_nm(r.actuation.peak_current_a, i);
    drives.continuous_torque_nm[k] = r.actuation.joint_torque_nm(r.actuation.continuous_current_a, i);
  }
  drives.encoder_counts_per_turn = r.actuation.encoder_counts_per_turn;
  const bool twin = r.kind == rig::Kind::Twin;
  const mechanism::Square square = twin ? mechanism::largest_square(r.twin, r.limits.singularity, 0.002)
                                        : mechanism::largest_square(r.twin.linkage[0], r.limits.singularity, 0.002);
  const mechanism::Rectangle box{r.limits.workspace_x_m, r.limits.workspace_y_m};
  const mechanism::Capability c = twin ? mechanism::capability(r.twin, drives, box) : mechanism::capability(r.twin.linkage[0], drives, box);
  if (c.status != mechanism::Status::Ok)
    throw config::UserError(
        fmt::format("{}: [limits] workspace_x_m, workspace_y_m: part of this box is out of reach; make it smaller (the largest square is "
                    "{:.0f} mm around ({:.0f}, {:.0f}) mm)",
                    file.string(), 1e3 * square.side_m, 1e3 * square.centre_m[0], 1e3 * square.centre_m[1]));
  const rig::BusBudget budget = rig::bus_budget(r);
  if (json) {
    fmt::print(
        "{{\"name\": \"{}\", \"kind\": \"{}\", \"largest_square_m\": {}, \"largest_square_centre_m\": [{}, {}], \"workspace_x_m\": [{}, "
        "{}], "
        "\"workspace_y_m\": [{}, {}], \"position_step_m\": {}, \"position_rms_m\": {}, \"angle_step_rad\": {}, \"peak_force_n\": {}, "
        "\"continuous_force_n\": {}, \"mass_least_kg\": {}, \"mass_most_kg\": {}, \"inertia_kg_m2\": {}, \"drives_bus_percent\": {}, "
        "\"drives_bus_peak_percent\": {}, \"sensor_bus_percent\": {}}}\n",
        r.name.data(), twin ? "twin" : "single", square.side_m, square.centre_m[0], square.centre_m[1], box.x_m[0], box.x_m[1], box.y_m[0],
        box.y_m[1], c.worst.position_step_m, c.worst.position_rms_m, c.worst.angle_step_rad, c.worst.peak_force_n,
        c.worst.continuous_force_n, c.worst.mass_least_kg, c.worst.mass_most_kg, c.worst.inertia_kg_m2, budget.drives_cyclic_percent,
        budget.drives_peak_percent, budget.sensor_percent);
    return 0;
  }
  fmt::print("{} ({}), {} drives\n\n", r.name.data(), twin ? "twin pantograph: x, y, unlimited rotation" : "single five-bar: x, y",
             r.drives());
  fmt::print("largest square workspace, every orientation   {:.0f} x {:.0f} mm around ({:.0f}, {:.0f}) mm\n", 1e3 * square.side_m,
             1e3 * square.side_m, 1e3 * square.centre_m[0], 1e3 * square.centre_m[1]);
  fmt::print("workspace limits of the rig file              x {:.0f} … {:.0f} mm, y {:.0f} … {:.0f} mm\n\n", 1e3 * box.x_m[0],
             1e3 * box.x_m[1], 1e3 * box.y_m[0], 1e3 * box.y_m[1]);
  fmt::print("worst place and direction within the limits, and in their centre:\n");
  fmt::print("  distance to singularity (0 … 1)             {:10.2f} {:10.2f}\n", c.worst.singularity, c.centre.singularity);
  fmt::print("  position, one encoder count                 {:10.1f} {:10.1f} um\n", 1e6 * c.worst.position_step_m,
             1e6 * c.centre.position_step_m);
  fmt::print("  position, quantisation RMS                  {:10.1f} {:10.1f} um\n", 1e6 * c.worst.position_rms_m,
             1e6 * c.centre.position_rms_m);
  if (twin)
    fmt::print("  rotation, one encoder count                 {:10.3f} {:10.3f} deg\n", deg * c.worst.angle_step_rad,
               deg * c.centre.angle_step_rad);
  fmt::print("  force, continuous, weakest direction        {:10.1f} {:10.1f} N\n", c.worst.continuous_force_n,
             c.centre.continuous_force_n);
  fmt::print("  force, peak, weakest direction              {:10.1f} {:10.1f} N\n", c.worst.peak_force_n, c.centre.peak_force_n);
  fmt::print("  moving mass, lightest … heaviest            {:.2f} … {:.2f} kg\n", c.worst.mass_least_kg, c.worst.mass_most_kg);
  if (twin)
    fmt::print("  moment of inertia at the handle             {:10.5f} {:10.5f} kg m^2\n", c.worst.inertia_kg_m2, c.centre.inertia_kg_m2);
  fmt::print("\nbus load at {:g} Hz, worst-case bit stuffing: drives {:.0f} % (peak {:.0f} %), sensor {:.0f} %{}\n", r.timing.tick_hz,
             budget.drives_cyclic_percent, budget.drives_peak_percent, budget.sensor_percent, budget.fits() ? "" : ": DOES NOT FIT");
  if (twin && std::string(r.name.data()) == "ubc_twin")
    fmt::print("\nthesis (3.1), for manipulation: > 100 x 100 mm, about 40 um and 0.05 deg, > 30 N peak, 12 N continuous\n");
  return 0;
}

namespace {
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) out += (c == '"' || c == '\\') ? fmt::format("\\{}", c) : std::string(1, c);
  return out;
}
}  // namespace

int rig_status(std::uint32_t domain, bool json) {
  host::RigClient client(domain);
  const host::RigStatus s = client.wait_for_rig(find_rig_s);
  if (json) {
    fmt::print(
        "{{\"rig\": \"{}\", \"mode\": \"{}\", \"fault\": \"{}\", \"homed\": {}, \"tared\": {}, \"real_time\": {}, \"armed_by\": "
        "\"{:016x}\", \"tick\": {}, "
        "\"ticks_late\": {}, \"ticks_without_feedback\": {}, \"drives_bus_percent\": {:.1f}, \"sensor_bus_percent\": {:.1f}, \"overruns\": "
        "{}, \"minor_faults\": {}, \"major_faults\": {}, "
        "\"preemptions\": "
        "{}, \"allocations\": {}, \"armed_page_faults\": {}, \"armed_allocations\": {}, \"machine\": \"{}\", \"gains\": \"{}\", \"text\": "
        "\"{}\"}}\n",
        s.rig, to_string(s.mode), to_string(s.fault), s.homed, s.tared, s.real_time, s.session, s.tick, s.ticks_late,
        s.ticks_without_feedback, s.drives_bus_percent, s.sensor_bus_percent, s.loop.overruns, s.loop.minor_faults, s.loop.major_faults,
        s.loop.preemptions, s.loop.allocations, s.loop.armed_page_faults, s.loop.armed_allocations, escaped(s.machine), s.gain_set,
        escaped(s.text));
    return 0;
  }
  fmt::print("{}: mode {}", s.rig, to_string(s.mode));
  if (s.fault != Fault::None) fmt::print(", fault {}", to_string(s.fault));
  fmt::print(", {}, {}, gains {}\n", s.homed ? "homed" : "not homed", s.tared ? "tared" : "not tared", s.gain_set);
  fmt::print("tick {}, {} late, {} without feedback; {}\n", s.tick, s.ticks_late, s.ticks_without_feedback,
             s.session != 0 ? fmt::format("armed by session {:016x}", s.session) : "nobody is armed");
  fmt::print("measured bus load: drives {:.1f} %, sensor {:.1f} % (trocar rig info has the budget)\n", s.drives_bus_percent,
             s.sensor_bus_percent);
  fmt::print(
      "loop: {} overruns, {} preemptions; page faults {} minor, {} major; {} allocations; while armed {} page faults, {} allocations\n",
      s.loop.overruns, s.loop.preemptions, s.loop.minor_faults, s.loop.major_faults, s.loop.allocations, s.loop.armed_page_faults,
      s.loop.armed_allocations);
  if (!s.machine.empty()) fmt::print("on {}\n", s.machine);
  if (!s.text.empty()) fmt::print("{}\n", s.text);
  return 0;
}

int rig_home(std::uint32_t domain) { return one_command(domain, CommandKind::Home); }
int rig_hold(std::uint32_t domain) { return one_command(domain, CommandKind::Hold); }
int rig_stop(std::uint32_t domain) { return one_command(domain, CommandKind::Stop); }
int rig_reset(std::uint32_t domain) { return one_command(domain, CommandKind::ResetFault); }

namespace {

// Keeps the session alive and prints what happens until `stop`; then disarms.
int stay_armed(host::RigClient& client, Mode mode, const std::atomic<bool>& stop) {
  bool lost = false;
  while (!stop.load() && !lost) {
    client.poll(0.01, {.status = [&](const host::RigStatus& s) {
                  if (s.mode != mode) {
                    fmt::print("mode {}{}\n", to_string(s.mode), s.text.empty() ? "" : ": " + s.text);
                    std::fflush(stdout);
                  }
                  mode = s.mode;
                  lost = s.mode == Mode::Off || s.mode == Mode::Fault || s.session != client.session();
                }});
    client.keep_alive();
  }
  if (lost) {
    fmt::print(stderr, "trocar: the rig is not armed by this command any more (mode {})\n", to_string(mode));
    return 1;
  }
  return say(client.ask(CommandKind::Disarm, answer_s));
}

}  // namespace

int rig_arm(std::uint32_t domain, std::atomic<bool>& stop) {
  host::RigClient client(domain);
  client.wait_for_rig(find_rig_s);
  const host::RigReply armed = client.ask(CommandKind::Arm, answer_s);
  if (say(armed) != 0) return 1;
  fmt::print("armed; Ctrl-C disarms\n");
  std::fflush(stdout);
  return stay_armed(client, armed.reply.mode, stop);
}

int rig_haptic(std::uint32_t domain, const std::string& display, std::atomic<bool>& stop) {
  host::RigClient client(domain);
  client.wait_for_rig(find_rig_s);
  if (say(client.ask(CommandKind::Arm, answer_s)) != 0) return 1;
  Command command;
  command.kind = CommandKind::Haptic;
  command.display = experiment::display_of(display).value_or(Display::FourChannel);
  const host::RigReply shown = client.ask(command, answer_s);
  if (say(shown) != 0) {
    (void)client.ask(CommandKind::Disarm, answer_s);
    return 1;
  }
  fmt::print("the handle is the virtual needle's ({}); Ctrl-C disarms\n", display);
  std::fflush(stdout);
  return stay_armed(client, shown.reply.mode, stop);
}

}  // namespace trocar::cli
