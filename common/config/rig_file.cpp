#include "common/config/rig_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/config/document.hpp"
#include "common/mechanism/five_bar.hpp"
#include "common/mechanism/twin.hpp"

namespace trocar::config {
namespace {

using rig::Kind;
using rig::Rig;

constexpr double turn_rad = 6.283185307179586;

// Ranges are what a table-top rig can be, wide enough for any of them and narrow enough that a value in mm or g falls outside.
constexpr Range length_range{0.005, 2.0};
constexpr Range mass_range{1e-6, 20.0};  // above 0: the equations of motion divide by inertia
constexpr Range inertia_range{1e-9, 1.0};
constexpr Range offset_range{-2.0, 2.0};

template <std::size_t N>
std::array<char, N> name_of(const Table& table, std::string_view key, std::string_view remedy) {
  const std::string text = table.text(key, remedy);
  if (text.size() >= N) table.fail(key, fmt::format("longer than {} bytes; shorten it", N - 1));
  const auto plain = [](char c) { return c > 0x20 && c < 0x7F && c != '/'; };
  if (!std::all_of(text.begin(), text.end(), plain)) {
    table.fail(key, "holds a space, '/' or a character that is not plain ASCII; use letters, digits, '_', '-' and '.'");
  }
  std::array<char, N> name{};
  std::copy(text.begin(), text.end(), name.begin());
  return name;
}

std::uint32_t count(const Table& table, std::string_view key, std::int64_t min, std::int64_t max, std::string_view remedy) {
  return static_cast<std::uint32_t>(table.integer(key, min, max, remedy));
}

std::array<mechanism::Link, 2> links(const Table& table) {
  const auto length = table.numbers<2>("length_m", length_range, "joint to joint, [left, right], such as [0.12, 0.12]");
  const auto mass = table.numbers<2>("mass_kg", mass_range, "[left, right], such as [0.03, 0.03]");
  const auto com = table.numbers<2>("com_m", offset_range, "centre of mass from the motor-side joint, such as [0.05, 0.05]");
  const auto inertia = table.numbers<2>("inertia_kg_m2", inertia_range, "about the centre of mass, such as [4e-5, 4e-5]");
  std::array<mechanism::Link, 2> pair{};
  for (std::size_t i = 0; i < 2; ++i) {
    // A counterweight may lie behind the joint or beyond the link's end, but not further than a second length.
    if (com[i] < -length[i] || com[i] > 2 * length[i]) {
      table.fail("com_m", fmt::format("the centre of mass must lie between {} and {} (one link length behind its joint, one beyond its "
                                      "end); measure it from the motor-side joint",
                                      -length[i], 2 * length[i]));
    }
    pair[i] = {.length_m = length[i], .mass_kg = mass[i], .com_m = com[i], .inertia_kg_m2 = inertia[i]};
  }
  return pair;
}

mechanism::FiveBarModel linkage(const Table& table) {
  mechanism::FiveBarModel model{};
  model.base_m = table.number("base_m", {0.0, length_range.max}, "the distance between the motor axes, such as 0.08");
  model.end_point_mass_kg = table.number("end_point_mass_kg", {0.0, mass_range.max}, "the joint hardware at the end point, such as 0.02");
  model.proximal = links(table.table("proximal"));
  model.distal = links(table.table("distal"));
  double sum = 0.0;
  for (std::size_t i = 0; i < 2; ++i) sum += model.proximal[i].length_m + model.distal[i].length_m;
  if (model.base_m >= sum) {
    table.fail("base_m", fmt::format("the links cannot reach each other: both arms together are {:.6g} m long; "
                                     "bring the motor axes closer or lengthen the links",
                                     sum));
  }
  // Each end point lies on a ring around either motor axis; the rings must meet.
  const auto inner = [&](std::size_t i) { return std::abs(model.proximal[i].length_m - model.distal[i].length_m); };
  const auto outer = [&](std::size_t i) { return model.proximal[i].length_m + model.distal[i].length_m; };
  for (std::size_t i = 0; i < 2; ++i) {
    if (inner(i) > outer(1 - i) + model.base_m) {
      table.fail("base_m", fmt::format("the {0} arm cannot fold back to the other arm's reach: its links differ by {1:.6g} m; "
                                       "make proximal and distal lengths of the {0} arm more alike",
                                       i == 0 ? "left" : "right", inner(i)));
    }
  }
  return model;
}

void coupling(const Table& root, Rig& rig) {
  if (rig.kind == Kind::Single) {
    if (root.has("coupling")) root.fail("coupling", "a single linkage has no coupling; remove the table, or write kind = \"twin\"");
    return;
  }
  if (!root.has("coupling")) {
    root.fail("kind",
              "a twin needs its coupling; add the table [coupling] with length_m, handle_m, handle_mass_kg, handle_com_m and "
              "handle_inertia_kg_m2, or write kind = \"single\"");
  }
  const Table table = root.table("coupling");
  mechanism::TwinModel& twin = rig.twin;
  twin.linkage[1] = twin.linkage[0];
  twin.coupling_m = table.number("length_m", length_range, "between the two end points, such as 0.06");
  twin.handle_m = table.number("handle_m", offset_range, "handle from the end point of linkage 0 along the coupling, such as 0.06");
  twin.handle_mass_kg = table.number("handle_mass_kg", mass_range, "coupling, handle, sensor and needle together, such as 0.15");
  twin.handle_com_m = table.number("handle_com_m", offset_range, "its centre of mass from the end point of linkage 0, such as 0.05");
  twin.handle_inertia_kg_m2 = table.number("handle_inertia_kg_m2", inertia_range, "about that centre of mass, such as 1e-4");
  const mechanism::FiveBarModel& arms = twin.linkage[0];
  const double reach = std::min(arms.proximal[0].length_m + arms.distal[0].length_m, arms.proximal[1].length_m + arms.distal[1].length_m);
  if (twin.coupling_m >= reach) {
    table.fail("length_m", fmt::format("longer than an arm reaches ({:.6g} m), so the handle cannot turn; shorten the coupling", reach));
  }
}

void actuation(const Table& table, Rig& rig) {
  rig::Actuation& a = rig.actuation;
  a.torque_constant_nm_per_a = table.number("torque_constant_nm_per_a", {1e-4, 10.0}, "the motor's data sheet has it, such as 0.0525");
  a.continuous_current_a = table.number("continuous_current_a", {0.01, 100.0}, "the motor's data sheet has it, such as 2");
  a.peak_current_a = table.number("peak_current_a", {0.01, 500.0}, "the drive's or motor's peak, such as 10");
  a.rotor_inertia_kg_m2 = table.number("rotor_inertia_kg_m2", {0.0, 0.01}, "of the motor itself, such as 6.7e-6");
  a.gear_efficiency = table.number("gear_efficiency", {0.05, 1.0}, "1 for direct drive");
  constexpr Range ratios{0.1, 1000.0};
  constexpr std::string_view ratio_remedy = "motor turns per joint turn of each drive, 1 for direct drive";
  if (rig.kind == Kind::Twin) {
    a.gear_ratio = table.numbers<4>("gear_ratio", ratios, ratio_remedy);
  } else {
    const auto two = table.numbers<2>("gear_ratio", ratios, ratio_remedy);
    std::copy(two.begin(), two.end(), a.gear_ratio.begin());
  }
  a.encoder_counts_per_turn = static_cast<std::int32_t>(
      table.integer("encoder_counts_per_turn", 16, 1 << 28, "per turn of the joint, behind the gear, such as 16000"));
  a.friction_coulomb_nm = table.number("friction_coulomb_nm", {0.0, 10.0}, "at the joint, 0 when unknown");
  a.friction_viscous_nm_s = table.number("friction_viscous_nm_s", {0.0, 10.0}, "at the joint, 0 when unknown");
  if (a.peak_current_a < a.continuous_current_a) {
    table.fail("peak_current_a", fmt::format("below continuous_current_a = {}; the peak is the larger one", a.continuous_current_a));
  }
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    const double inertia = a.rotor_inertia_kg_m2 * a.gear_ratio[i] * a.gear_ratio[i];
    rig.twin.linkage[i / 2].reflected_inertia_kg_m2[i % 2] = inertia;
  }
}

rig::AxisGains axis_gains(const Table& table, std::string_view unit) {
  rig::AxisGains gains{};
  gains.proportional = table.number("proportional", {0.0, 1e6}, fmt::format("{0}/m or {0}/rad, not negative", unit));
  gains.integral = table.number("integral", {0.0, 1e6}, "0 switches integral action off");
  gains.derivative = table.number("derivative", {0.0, 1e5}, "damping, not negative");
  return gains;
}

void gains(const Table& root, Rig& rig) {
  const auto sets = root.tables("gains");
  if (sets.empty()) root.fail("gains", "missing; add one [[gains]] with name, feed_forward, translation and rotation");
  for (const Table& set : sets) {
    if (rig.gain_sets == rig.gain_set.size()) {
      set.fail("name", fmt::format("one set more than the controller has room for ({}); remove one", rig.gain_set.size()));
    }
    rig::GainSet& gain = rig.gain_set[rig.gain_sets];
    gain.name = name_of<capacity::name>(set, "name", "any short name, such as \"default\"");
    for (std::size_t i = 0; i < rig.gain_sets; ++i) {
      if (rig.gain_set[i].name == gain.name) set.fail("name", "another set has this name; give each [[gains]] its own");
    }
    gain.feed_forward = set.flag("feed_forward", "whether the reference motion's inertia and friction are fed forward");
    gain.translation = axis_gains(set.table("translation"), "N");
    gain.rotation = axis_gains(set.table("rotation"), "N m");
    ++rig.gain_sets;
  }
}

void limits(const Table& table, Rig& rig) {
  rig::Limits& l = rig.limits;
  constexpr Range positive{1e-9, 1e9};
  l.torque_slew_nm_per_s = table.number("torque_slew_nm_per_s", positive, "per joint, such as 200");
  l.speed_m_s = table.number("speed_m_s", {1e-6, 10.0}, "the fastest commanded motion, such as 0.2");
  l.angular_speed_rad_s = table.number("angular_speed_rad_s", {1e-6, 100.0}, "the fastest commanded turn, such as 3");
  l.acceleration_m_s2 = table.number("acceleration_m_s2", {1e-6, 1000.0}, "of commanded motions, such as 2");
  l.angular_acceleration_rad_s2 = table.number("angular_acceleration_rad_s2", {1e-6, 1e5}, "of commanded turns, such as 20");
  l.jerk_m_s3 = table.number("jerk_m_s3", {1e-6, 1e6}, "of commanded motions, such as 50");
  l.angular_jerk_rad_s3 = table.number("angular_jerk_rad_s3", {1e-6, 1e7}, "of commanded turns, such as 500");
  l.command_force_n = table.number("command_force_n", {1e-3, 1000.0}, "the largest force asked of the mechanism, such as 30");
  l.command_moment_nm = table.number("command_moment_nm", {1e-4, 100.0}, "the largest moment asked of the mechanism, such as 1");
  l.workspace_x_m = table.numbers<2>("workspace_x_m", offset_range, "[low, high] of the needle base, such as [-0.05, 0.05]");
  l.workspace_y_m = table.numbers<2>("workspace_y_m", offset_range, "[low, high] of the needle base, such as [0.1, 0.2]");
  l.singularity = table.number("singularity", {0.0, 1.0}, "least distance to singularity, from 0 to 1, such as 0.1");
  l.residual_m = table.number("residual_m", {1e-7, 0.1}, "disagreement of the redundant encoders, such as 5e-4");
  l.torque_error_nm = table.number("torque_error_nm", {1e-6, 1000.0}, "at the joint, measured against commanded torque, such as 0.1");
  l.torque_error_ticks = count(table, "torque_error_ticks", 1, 1000, "how many ticks in a row are no fault yet, such as 20");
  l.tracking_m = table.number("tracking_m", {1e-6, 1.0}, "largest position error before a fault, such as 0.01");
  l.tracking_rad = table.number("tracking_rad", {1e-5, turn_rad}, "largest angle error before a fault, such as 0.2");
  l.fault_speed_m_s = table.number("fault_speed_m_s", {1e-6, 100.0}, "beyond speed_m_s, such as 0.5");
  l.fault_angular_speed_rad_s = table.number("fault_angular_speed_rad_s", {1e-6, 1000.0}, "beyond angular_speed_rad_s, such as 10");
  l.fault_force_n = table.number("fault_force_n", {1e-3, 1000.0}, "measured at the base, such as 20");
  l.fault_moment_nm = table.number("fault_moment_nm", {1e-4, 100.0}, "measured at the base, such as 1");
  for (const auto& [key, range] : {std::pair{"workspace_x_m", l.workspace_x_m}, std::pair{"workspace_y_m", l.workspace_y_m}}) {
    if (range[0] >= range[1]) table.fail(key, "the box is empty; write [low, high] with low below high");
  }
  const auto above = [&](std::string_view fault_key, double fault, std::string_view clamp_key, double clamp) {
    if (fault <= clamp) {
      table.fail(fault_key, fmt::format("not above {} = {}, so every fast motion would end in a fault; raise it or lower {}", clamp_key,
                                        clamp, clamp_key));
    }
  };
  above("fault_speed_m_s", l.fault_speed_m_s, "speed_m_s", l.speed_m_s);
  above("fault_angular_speed_rad_s", l.fault_angular_speed_rad_s, "angular_speed_rad_s", l.angular_speed_rad_s);
}

void timing(const Table& table, Rig& rig) {
  rig::Timing& t = rig.timing;
  t.tick_hz = table.number("tick_hz", {100.0, 1300.0}, "1000 is usual; beyond 1300 the frames of a tick do not fit on a 1 Mbit/s bus");
  t.feedback_deadline_us = count(table, "feedback_deadline_us", 1, 1000000, "from SYNC to the last feedback frame, such as 800");
  t.missed_feedback_ticks = count(table, "missed_feedback_ticks", 0, 1000, "ticks without feedback before a fault, such as 3");
  t.missed_sensor_ticks = count(table, "missed_sensor_ticks", 0, 10000, "ticks without force values before a fault, such as 20");
  t.host_timeout_ms = count(table, "host_timeout_ms", 10, 60000, "silence of the host before a hold, such as 500");
  t.late_tick_us = count(table, "late_tick_us", 1, 1000000, "wake-up later than this is a fault, such as 300");
  t.late_tick_best_effort_us =
      count(table, "late_tick_best_effort_us", 1, 10000000, "the same without real-time privileges, such as 50000");
  t.heartbeat_ms = count(table, "heartbeat_ms", 1, 10000, "produced by master and drives, such as 20");
  t.heartbeat_timeout_ms = count(table, "heartbeat_timeout_ms", 1, 60000, "more than one heartbeat, such as 50");
  const double tick_us = 1e6 / t.tick_hz;
  if (t.feedback_deadline_us >= tick_us) {
    table.fail("feedback_deadline_us",
               fmt::format("a tick lasts {:.6g} us; the feedback must be there before it ends: lower the deadline or tick_hz", tick_us));
  }
  if (t.late_tick_best_effort_us < t.late_tick_us) {
    table.fail("late_tick_best_effort_us",
               fmt::format("stricter than late_tick_us = {}; without privileges wake-ups come later: raise it", t.late_tick_us));
  }
  if (t.heartbeat_timeout_ms <= t.heartbeat_ms) {
    table.fail(
        "heartbeat_timeout_ms",
        fmt::format("not longer than heartbeat_ms = {}, so it expires between two beats; make it at least twice as long", t.heartbeat_ms));
  }
}

rig::Planar planar(const Table& table, std::string_view key, const Range& range, std::string_view unit) {
  const auto two = table.numbers<2>(key, range, fmt::format("[x and y, rotation], {}", unit));
  return {two[0], two[1]};
}

rig::Coupling local_controller(const Table& table) {
  return {planar(table, "damping", {0.0, 1e4}, "N s/m and N m s/rad, such as [35, 0.035]"),
          planar(table, "stiffness", {0.0, 1e5}, "N/m and N m/rad, such as [100, 0.1]")};
}

// A rig without the table has no Haptic mode.
void haptic(const Table& root, Rig& rig) {
  if (!root.has("haptic")) return;
  if (rig.kind == Kind::Single)
    root.fail("haptic", "a single linkage has no handle that turns; remove the table, or write kind = \"twin\"");
  const Table table = root.table("haptic");
  rig::Haptic& h = rig.haptic;
  constexpr Range mass{1e-6, 20.0}, damping{0.0, 1e4}, stiffness{0.0, 1e5};
  h.present = true;
  h.fade_s = table.number("fade_s", {0.0, 10.0}, "how long a change of mode, display or model fades, such as 0.5");
  const Table observer = table.table("observer");
  h.observer = observer.one_of("kind", {"nicosia", "momentum"}) == "nicosia" ? rig::ForceObserver::Nicosia : rig::ForceObserver::Momentum;
  h.observer_bandwidth_rad_s = observer.number("bandwidth_rad_s", {1.0, 1e4}, "of the hand's force, such as 390");
  h.observer_count_force_n = observer.number("count_force_n", {1e-6, 100.0}, "RMS that encoder counts alone may feign, such as 0.6");
  const Table desired = table.table("desired");
  h.desired_mass = planar(desired, "mass", mass, "kg and kg m^2, such as [0.3, 2.5e-4]");
  h.desired_damping = planar(desired, "damping", damping, "N s/m and N m s/rad, 0 for none");
  h.desired_stiffness = planar(desired, "stiffness", stiffness, "N/m and N m/rad about the homing pose, 0 for none");
  const Table needle = table.table("needle");
  h.needle_mass = planar(needle, "mass", mass, "kg and kg m^2, such as [0.3, 2.5e-4]");
  h.needle_damping = planar(needle, "damping", damping, "N s/m and N m s/rad, 0 for none");
  const Table four = table.table("four_channel");
  h.master = local_controller(four.table("master"));
  h.slave = local_controller(four.table("slave"));
  h.adaptive_per_force_s_m = four.number("adaptive_per_force_s_m", damping, "K_b of the thesis, such as 60");
  h.adaptive_per_moment_s_rad = four.number("adaptive_per_moment_s_rad", damping, "the same for the rotation, such as 1.9");
  h.adaptive_least = planar(four, "adaptive_least", damping, "B_min, N s/m and N m s/rad, 0 for none");
  h.tracking = local_controller(table.table("admittance").table("tracking"));
  const Table guard = table.table("guard");
  h.guard_credit_j = guard.number("credit_j", {0.0, 1.0}, "energy that the display may give without a force, such as 0.005");
  h.guard_softest_n_m = guard.number("softest_n_m", {0.1, 1e5}, "softest spring that the tissue may store energy in, such as 50");
  h.guard_bound_j = guard.number("bound_j", {1e-6, 1.0}, "energy given beyond that is a fault, such as 0.01");
  h.guard_damping_n_s_m = guard.number("damping_n_s_m", damping, "most that the guard may add, such as 25");
}

rig::BusEndpoint endpoint(const Table& table) {
  rig::BusEndpoint end{};
  const bool udp = table.has("rig_port") || table.has("plant_port") || table.has("host");
  if (table.has("interface")) {
    if (udp) table.fail("interface", "a bus has either an interface or UDP ports; remove one of the two");
    end.interface = name_of<capacity::name>(table, "interface", "such as \"can0\"");
    if (end.interface[15] != '\0') table.fail("interface", "longer than 15 bytes, which no network interface is; `ip link` lists them");
    return end;
  }
  if (!udp) table.fail("interface", "missing; add interface = \"can0\", or rig_port = 20011 and plant_port = 20012 for a simulated bus");
  end.rig_port = static_cast<std::uint16_t>(count(table, "rig_port", 1, 65535, "UDP port on which the rig listens, such as 20011"));
  end.plant_port = static_cast<std::uint16_t>(count(table, "plant_port", 1, 65535, "UDP port on which the plant listens, such as 20012"));
  constexpr std::string_view host_remedy = "an address or a known name, such as \"127.0.0.1\"";
  end.host = table.has("host") ? name_of<sizeof end.host>(table, "host", host_remedy) : std::array<char, 64>{"127.0.0.1"};
  if (end.rig_port == end.plant_port) table.fail("plant_port", "the same as rig_port; give each side its own");
  return end;
}

void buses(const Table& table, Rig& rig) {
  rig::Buses& b = rig.buses;
  b.bitrate_bps = count(table, "bitrate_bps", 125000, 1000000, "1000000 for a rig at 1 kHz");
  constexpr std::string_view node_remedy = "CANopen node id of each drive, from 1 to 127, such as 1, 2, 3, 4";
  if (rig.kind == Kind::Twin) {
    const auto nodes = table.integers<4>("drive_node", 1, 127, node_remedy);
    std::transform(nodes.begin(), nodes.end(), b.drive_node.begin(), [](std::int64_t id) { return static_cast<std::uint8_t>(id); });
  } else {
    const auto nodes = table.integers<2>("drive_node", 1, 127, node_remedy);
    std::transform(nodes.begin(), nodes.end(), b.drive_node.begin(), [](std::int64_t id) { return static_cast<std::uint8_t>(id); });
  }
  b.master_node = static_cast<std::uint8_t>(table.integer("master_node", 1, 127, "of the controller itself, such as 127"));
  b.sensor_base_id = count(table, "sensor_base_id", 0, 0x7F0, "set by the force sensor's switches, a multiple of 16, such as 432");
  if (b.sensor_base_id % 16 != 0) table.fail("sensor_base_id", "not a multiple of 16; the sensor's switches set the upper seven bits only");
  for (std::size_t i = 0; i < rig.drives(); ++i) {
    if (b.drive_node[i] == b.master_node) {
      table.fail("master_node", fmt::format("drive {} has this node id; give the controller its own, such as 127", i));
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (b.drive_node[i] == b.drive_node[k]) {
        table.fail("drive_node", fmt::format("drives {} and {} share node id {}; give each its own", k, i, b.drive_node[i]));
      }
    }
  }
  b.drives = endpoint(table.table("drives"));
  const Table sensor = table.table("sensor");
  b.sensor = endpoint(sensor);
  if (b.sensor.interface[0] != '\0' && b.sensor.interface == b.drives.interface) {
    sensor.fail("interface", "the drives use this bus and fill it; give the force sensor its own");
  }
  if (b.sensor.rig_port != 0 && b.drives.rig_port != 0) {
    const auto taken = [&](std::uint16_t port) { return port == b.drives.rig_port || port == b.drives.plant_port; };
    if (taken(b.sensor.rig_port)) sensor.fail("rig_port", "the drives' bus has this port; take a free one");
    if (taken(b.sensor.plant_port)) sensor.fail("plant_port", "the drives' bus has this port; take a free one");
  }
}

void homing(const Table& table, Rig& rig) {
  rig.homing_pose = table.numbers<3>("pose", {-1000.0, 1000.0}, "[x_m, y_m, theta_rad] in which the homing jig holds the handle");
  const auto inside = [](double value, const std::array<double, 2>& range) { return value >= range[0] && value <= range[1]; };
  if (!inside(rig.homing_pose[0], rig.limits.workspace_x_m) || !inside(rig.homing_pose[1], rig.limits.workspace_y_m)) {
    table.fail("pose", "outside of the box limits.workspace_x_m, limits.workspace_y_m; move the pose or widen the box");
  }
  double distance = 0.0;
  mechanism::Status status{};
  if (rig.kind == Kind::Twin) {
    const mechanism::Vec3 pose(rig.homing_pose[0], rig.homing_pose[1], rig.homing_pose[2]);
    mechanism::TwinState state{};
    status = mechanism::at_pose(rig.twin, pose, mechanism::Vec4::Zero(), state);
    if (status == mechanism::Status::Ok) distance = mechanism::singularity_distance(rig.twin, state);
  } else {
    if (rig.homing_pose[2] != 0.0) table.fail("pose", "a single linkage has no orientation; the third number is 0");
    const mechanism::Vec2 end(rig.homing_pose[0], rig.homing_pose[1]);
    mechanism::Vec2 angles = mechanism::Vec2::Zero();
    mechanism::FiveBarPose state{};
    status = mechanism::inverse(rig.twin.linkage[0], end, mechanism::Vec2::Zero(), angles);
    if (status == mechanism::Status::Ok) status = mechanism::forward(rig.twin.linkage[0], angles, state);
    if (status == mechanism::Status::Ok) distance = mechanism::singularity_distance(rig.twin.linkage[0], angles, state);
  }
  if (status != mechanism::Status::Ok) {
    table.fail("pose",
               "the links cannot take this pose with the elbows outward; move it within reach, or correct the lengths in [linkage]");
  }
  if (distance < rig.limits.singularity) {
    table.fail("pose", fmt::format("its distance to singularity is {:.3g}, below limits.singularity = {}; move the pose towards the middle "
                                   "of the workspace, or lower the limit",
                                   distance, rig.limits.singularity));
  }
}

}  // namespace

Rig read_rig(const std::filesystem::path& file) {
  const Document document = Document::load(file);
  const Table root = document.root();
  Rig rig{};
  rig.name = name_of<capacity::name>(root, "name", "any short name, such as \"ubc_twin\"");
  rig.kind = root.one_of("kind", {"twin", "single"}) == "twin" ? Kind::Twin : Kind::Single;
  rig.dds_domain = static_cast<std::uint32_t>(root.integer_or("dds_domain", 0, 0, 230, "0 unless several rigs share a network"));
  rig.twin.linkage[0] = linkage(root.table("linkage"));
  coupling(root, rig);
  actuation(root.table("actuation"), rig);
  gains(root, rig);
  limits(root.table("limits"), rig);
  timing(root.table("timing"), rig);
  const Table sensor = root.table("force_sensor");
  rig.sensor.counts_per_n = sensor.number("counts_per_n", {1e-3, 1e9}, "from the sensor's calibration sheet, such as 80");
  rig.sensor.counts_per_nm = sensor.number("counts_per_nm", {1e-3, 1e9}, "from the sensor's calibration sheet, such as 4000");
  rig.sensor.angle_rad = sensor.number("angle_rad", {-turn_rad, turn_rad}, "sensor x axis from the needle axis, counter-clockwise");
  haptic(root, rig);
  buses(root.table("buses"), rig);
  homing(root.table("homing"), rig);
  document.refuse_unknown_keys();
  return rig;
}

Rig read_twin(const std::filesystem::path& file) {
  const Rig rig = read_rig(file);
  if (rig.kind != Kind::Twin) {
    Document::load(file).root().fail("kind", fmt::format("a handle that moves in x, y and rotation needs a twin; take ubc_twin, or look "
                                                         "at this rig with: trocar rig info {}",
                                                         file.string()));
  }
  return rig;
}

void refuse_bus(const std::filesystem::path& file, std::string_view bus, std::string_view port_key, std::string_view problem) {
  const Table table = Document::load(file).root().table("buses").table(bus);
  table.fail(table.has("interface") ? "interface" : port_key, problem);
}

void refuse_haptic(const std::filesystem::path& file, std::string_view problem) {
  const Document document = Document::load(file);
  const Table root = document.root();
  if (!root.has("haptic"))
    root.fail("haptic", "missing: this rig is no haptic device; take ubc_twin_haptic, or add the table as that rig's file has it");
  root.table("haptic").table("observer").fail("bandwidth_rad_s", problem);
}

}  // namespace trocar::config
