#include "common/config/rig_file.hpp"

#include "file_fixture.hpp"
#include "rig_text.hpp"

namespace trocar::config {
namespace {

using testing::edited;
using testing::expect_parts;
using testing::twin_rig;

class RigFileTest : public testing::FileFixture {
 protected:
  // The rig with `from` replaced by `to` is refused at the line of `to`, with these parts after it.
  void refused(std::string_view from, std::string_view to, std::initializer_list<std::string> parts) {
    const auto spoiled = edited(twin_rig, from, to);
    const std::string message = error_of(spoiled.text, read_rig);
    expect_parts(message, {spoiled.line});
    expect_parts(message, parts);
  }
};

TEST_F(RigFileTest, FillsEveryMemberFromTheFile) {
  const rig::Rig rig = read_rig(write(twin_rig));
  EXPECT_STREQ(rig.name.data(), "twin");
  EXPECT_EQ(rig.kind, rig::Kind::Twin);
  EXPECT_EQ(rig.dds_domain, 3u);
  for (const auto& arms : rig.twin.linkage) {
    EXPECT_EQ(arms.base_m, 0.08);
    EXPECT_EQ(arms.end_point_mass_kg, 0.02);
    EXPECT_EQ(arms.proximal[1].length_m, 0.106);
    EXPECT_EQ(arms.proximal[1].mass_kg, 0.031);
    EXPECT_EQ(arms.proximal[1].com_m, -0.02);
    EXPECT_EQ(arms.proximal[0].inertia_kg_m2, 5e-5);
    EXPECT_EQ(arms.distal[0].length_m, 0.155);
    EXPECT_EQ(arms.distal[0].mass_kg, 0.02);
    EXPECT_EQ(arms.distal[1].com_m, 0.071);
    EXPECT_EQ(arms.distal[1].inertia_kg_m2, 9e-5);
  }
  EXPECT_EQ(rig.twin.coupling_m, 0.05);
  EXPECT_EQ(rig.twin.handle_m, 0.025);
  EXPECT_EQ(rig.twin.handle_mass_kg, 0.15);
  EXPECT_EQ(rig.twin.handle_com_m, 0.026);
  EXPECT_EQ(rig.twin.handle_inertia_kg_m2, 1e-4);
  EXPECT_EQ(rig.actuation.torque_constant_nm_per_a, 0.0525);
  EXPECT_EQ(rig.actuation.continuous_current_a, 2.0);
  EXPECT_EQ(rig.actuation.peak_current_a, 10.0);
  EXPECT_EQ(rig.actuation.gear_ratio, (std::array{8.0, 9.0, 10.0, 11.0}));
  EXPECT_EQ(rig.actuation.gear_efficiency, 0.85);
  EXPECT_EQ(rig.actuation.encoder_counts_per_turn, 16000);
  EXPECT_EQ(rig.actuation.friction_coulomb_nm, 0.015);
  EXPECT_EQ(rig.actuation.friction_viscous_nm_s, 0.002);
  EXPECT_EQ(rig.homing_pose, (std::array{0.0, 0.11, 1.5707963267948966}));
  ASSERT_EQ(rig.gain_sets, 2u);
  EXPECT_STREQ(rig.gain_set[0].name.data(), "default");
  EXPECT_TRUE(rig.gain_set[0].feed_forward);
  EXPECT_EQ(rig.gain_set[0].translation.integral, 2000.0);
  EXPECT_EQ(rig.gain_set[0].rotation.derivative, 0.03);
  EXPECT_STREQ(rig.gain_set[1].name.data(), "thesis");
  EXPECT_FALSE(rig.gain_set[1].feed_forward);
  EXPECT_EQ(rig.gain_set[1].translation.proportional, 801.0);
  EXPECT_EQ(rig.gain_set[1].translation.derivative, 11.0);
  EXPECT_EQ(rig.gain_set[1].rotation.proportional, 1.0);
  EXPECT_EQ(rig.gain_set[1].rotation.integral, 3.9e-6);
  EXPECT_EQ(rig.sensor.counts_per_n, 640.0);
  EXPECT_EQ(rig.sensor.counts_per_nm, 128000.0);
  EXPECT_EQ(rig.sensor.angle_rad, 0.5);
  EXPECT_EQ(rig.buses.bitrate_bps, 1000000u);
  EXPECT_EQ(rig.buses.drive_node, (std::array<std::uint8_t, 4>{1, 2, 3, 4}));
  EXPECT_EQ(rig.buses.master_node, 127);
  EXPECT_EQ(rig.buses.sensor_base_id, 0x430u);
  EXPECT_STREQ(rig.buses.drives.interface.data(), "");
  EXPECT_STREQ(rig.buses.drives.host.data(), "127.0.0.1");
  EXPECT_EQ(rig.buses.drives.rig_port, 20001);
  EXPECT_EQ(rig.buses.drives.plant_port, 20000);
  EXPECT_STREQ(rig.buses.sensor.interface.data(), "can1");
  EXPECT_EQ(rig.buses.sensor.rig_port, 0);
}

TEST_F(RigFileTest, FillsLimitsAndTimingFromTheFile) {
  const rig::Rig rig = read_rig(write(twin_rig));
  const rig::Limits& l = rig.limits;
  EXPECT_EQ(l.torque_slew_nm_per_s, 100.0);
  EXPECT_EQ(l.speed_m_s, 0.1);
  EXPECT_EQ(l.angular_speed_rad_s, 2.0);
  EXPECT_EQ(l.acceleration_m_s2, 1.0);
  EXPECT_EQ(l.angular_acceleration_rad_s2, 20.0);
  EXPECT_EQ(l.jerk_m_s3, 21.0);
  EXPECT_EQ(l.angular_jerk_rad_s3, 400.0);
  EXPECT_EQ(l.command_force_n, 12.0);
  EXPECT_EQ(l.command_moment_nm, 0.3);
  EXPECT_EQ(l.workspace_x_m, (std::array{-0.052, 0.053}));
  EXPECT_EQ(l.workspace_y_m, (std::array{0.098, 0.202}));
  EXPECT_EQ(l.singularity, 0.25);
  EXPECT_EQ(l.residual_m, 0.001);
  EXPECT_EQ(l.tracking_m, 0.006);
  EXPECT_EQ(l.tracking_rad, 0.15);
  EXPECT_EQ(l.fault_speed_m_s, 0.26);
  EXPECT_EQ(l.fault_angular_speed_rad_s, 6.0);
  EXPECT_EQ(l.fault_force_n, 9.0);
  EXPECT_EQ(l.fault_moment_nm, 0.11);
  const rig::Timing& t = rig.timing;
  EXPECT_EQ(t.tick_hz, 1000.0);
  EXPECT_EQ(t.feedback_deadline_us, 700u);
  EXPECT_EQ(t.missed_feedback_ticks, 20u);
  EXPECT_EQ(t.missed_sensor_ticks, 50u);
  EXPECT_EQ(t.host_timeout_ms, 80u);
  EXPECT_EQ(t.late_tick_us, 2000u);
  EXPECT_EQ(t.late_tick_best_effort_us, 50000u);
  EXPECT_EQ(t.heartbeat_ms, 25u);
  EXPECT_EQ(t.heartbeat_timeout_ms, 60u);
}

TEST_F(RigFileTest, ReflectsRotorInertiaThroughTheSquareOfEachGear) {
  const rig::Rig rig = read_rig(write(twin_rig));
  EXPECT_DOUBLE_EQ(rig.twin.linkage[0].reflected_inertia_kg_m2[0], 6.5e-6 * 64);
  EXPECT_DOUBLE_EQ(rig.twin.linkage[0].reflected_inertia_kg_m2[1], 6.5e-6 * 81);
  EXPECT_DOUBLE_EQ(rig.twin.linkage[1].reflected_inertia_kg_m2[0], 6.5e-6 * 100);
  EXPECT_DOUBLE_EQ(rig.twin.linkage[1].reflected_inertia_kg_m2[1], 6.5e-6 * 121);
}

TEST_F(RigFileTest, ReadsEveryRigThatIsShipped) {
  std::size_t read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(TROCAR_SHARE "/rigs")) {
    if (entry.path().extension() != ".toml") continue;
    const rig::Rig rig = read_rig(entry.path());
    EXPECT_EQ(entry.path().stem().string(), rig.name.data());
    ++read;
  }
  EXPECT_GE(read, 3u);
}

TEST_F(RigFileTest, ReadsASingleLinkageWithTwoDrivesAndNoCoupling) {
  const rig::Rig rig = read_rig(TROCAR_SHARE "/rigs/five_bar.toml");
  EXPECT_EQ(rig.kind, rig::Kind::Single);
  EXPECT_EQ(rig.drives(), 2u);
  EXPECT_EQ(rig.twin.linkage[0].distal[0].length_m, 0.165);
  EXPECT_EQ(rig.buses.drive_node, (std::array<std::uint8_t, 4>{1, 2, 0, 0}));
  EXPECT_EQ(rig.actuation.gear_ratio[2], 0.0);
}

TEST_F(RigFileTest, ReadsTheHapticTableOfARigThatHasOne) {
  EXPECT_FALSE(read_rig(write(twin_rig)).haptic.present);
  const rig::Haptic h = read_rig(TROCAR_SHARE "/rigs/ubc_twin_haptic.toml").haptic;
  EXPECT_TRUE(h.present);
  EXPECT_EQ(h.observer, rig::ForceObserver::Nicosia);
  EXPECT_EQ(h.observer_bandwidth_rad_s, 390.0);
  EXPECT_EQ(h.observer_count_force_n, 0.6);
  EXPECT_EQ(h.desired_mass.rotation, 2.5e-4);
  EXPECT_EQ(h.master.damping.translation, 35.0);
  EXPECT_EQ(h.slave.stiffness.rotation, 0.1);
  EXPECT_EQ(h.tracking.stiffness.translation, 400.0);
  EXPECT_EQ(h.guard_bound_j, 0.01);
  expect_parts(error_of(std::string(twin_rig) + "[haptic]\nfade_s = -1.0\n", read_rig), {"haptic.fade_s = -1: must be from 0 to 10"});
  expect_parts(error_of(std::string(twin_rig) + "[haptic]\nfade_s = 0.5\n[haptic.observer]\nkind = \"kalman\"\n", read_rig),
               {"haptic.observer.kind = \"kalman\": not known here", "\"nicosia\", \"momentum\""});
}

TEST_F(RigFileTest, RefusesARigThatIsNoHapticDevice) {
  expect_parts(error_from([&] { refuse_haptic(write(twin_rig), ""); }), {"file.toml", "haptic: missing: this rig is no haptic device"});
  expect_parts(error_from([&] { refuse_haptic(TROCAR_SHARE "/rigs/ubc_twin_haptic.toml", "too high; lower it"); }),
               {"ubc_twin_haptic.toml:", "haptic.observer.bandwidth_rad_s = 390: too high; lower it"});
}

TEST_F(RigFileTest, RefusesBadInputOfEveryClass) {
  refused("base_m = 0.08", "base_m = -0.08", {"linkage.base_m = -0.08: must be from 0 to 2; the distance between the motor axes"});
  refused("base_m = 0.08", "base_m = \"wide\"", {"linkage.base_m = \"wide\": expected a number, got a text"});
  refused("base_m = 0.08", "base_mm = 80.0", {"linkage.base_mm = 80: unknown key; lengths are in metres: write base_m = 0.08 for 80 mm"});
  refused("base_m = 0.08", "base_m = 80",
          {"linkage.base_m = 80: must be from 0 to 2; lengths are in metres; if that is 80 mm, write 0.08"});
  refused("base_m = 0.08", "base_m = = 0.08", {":5:10: not valid TOML"});
}

TEST_F(RigFileTest, RefusesAKeyThatItDoesNotKnow) {
  const std::string message = error_of(std::string(twin_rig) + "bitrate_kbps = 1000\n", read_rig);
  expect_parts(message, {"file.toml:92: buses.sensor.bitrate_kbps = 1000: unknown key; remove it; known here: host, interface"});
  expect_parts(error_of("nmae = \"x\"\n", read_rig), {"file.toml: name: missing", "Line 1 has nmae: was name meant?"});
}

TEST_F(RigFileTest, RefusesLinkagesThatCannotClose) {
  refused("base_m = 0.08", "base_m = 0.6",
          {"linkage.base_m = 0.6: the links cannot reach each other", "0.522 m", "bring the motor axes closer"});
  const auto stiff = edited(edited(twin_rig, "[0.105, 0.106]", "[0.9, 0.106]").text, "[0.05, -0.02]", "[0.0, 0.0]");
  expect_parts(error_of(stiff.text, read_rig), {"file.toml:5: linkage.base_m = 0.08: the left arm cannot fold back", "more alike"});
}

TEST_F(RigFileTest, BoundsTheCentreOfMassBeyondTheLink) {
  refused("com_m = [0.05, -0.02]", "com_m = [0.05, -0.12]",
          {"linkage.proximal.com_m = [0.05, -0.12]: the centre of mass must lie between -0.106 and 0.212"});
  refused("com_m = [0.07, 0.071]", "com_m = [0.4, 0.071]", {"linkage.distal.com_m = [0.4, 0.071]", "between -0.155 and 0.31"});
}

TEST_F(RigFileTest, MatchesCouplingToKind) {
  refused("length_m = 0.05", "length_m = 0.3", {"coupling.length_m = 0.3: longer than an arm reaches (0.26 m)", "shorten the coupling"});
  refused("kind = \"twin\"", "kind = \"triple\"", {"kind = \"triple\": not known here", "\"twin\", \"single\""});
  std::string without(twin_rig);
  without.erase(without.find("[coupling]"), without.find("[actuation]") - without.find("[coupling]"));
  expect_parts(error_of(without, read_rig), {"file.toml:2: kind = \"twin\": a twin needs its coupling; add the table [coupling]"});
  const auto single = edited(twin_rig, "kind = \"twin\"", "kind = \"single\"");
  expect_parts(error_of(single.text, read_rig), {"file.toml:17: coupling: a single linkage has no coupling; remove the table"});
}

TEST_F(RigFileTest, CountsDrivesByKind) {
  refused("gear_ratio = [8.0, 9.0, 10.0, 11.0]", "gear_ratio = [8.0, 9.0]",
          {"actuation.gear_ratio = [8, 9]: expected an array of 4 numbers, got 2"});
  refused("drive_node = [1, 2, 3, 4]", "drive_node = [1, 2, 3]",
          {"buses.drive_node = [1, 2, 3]: expected an array of 4 whole numbers, got 3"});
}

TEST_F(RigFileTest, RefusesCurrentsAndLimitsInTheWrongOrder) {
  refused("peak_current_a = 10.0", "peak_current_a = 1.0", {"actuation.peak_current_a = 1: below continuous_current_a = 2"});
  refused("fault_speed_m_s = 0.26", "fault_speed_m_s = 0.1",
          {"limits.fault_speed_m_s = 0.1: not above speed_m_s = 0.1", "raise it or lower speed_m_s"});
  refused("fault_angular_speed_rad_s = 6.0", "fault_angular_speed_rad_s = 1.0", {"not above angular_speed_rad_s = 2"});
  refused("workspace_x_m = [-0.052, 0.053]", "workspace_x_m = [0.05, -0.05]", {"limits.workspace_x_m = [0.05, -0.05]: the box is empty"});
}

TEST_F(RigFileTest, RefusesTimingThatContradictsItself) {
  refused("feedback_deadline_us = 700", "feedback_deadline_us = 1000",
          {"timing.feedback_deadline_us = 1000: a tick lasts 1000 us", "lower the deadline"});
  refused("late_tick_best_effort_us = 50000", "late_tick_best_effort_us = 500", {"stricter than late_tick_us = 2000"});
  refused("heartbeat_timeout_ms = 60", "heartbeat_timeout_ms = 25", {"not longer than heartbeat_ms = 25", "twice as long"});
  refused("tick_hz = 1000.0", "tick_hz = 2000.0", {"timing.tick_hz = 2000: must be from 100 to 1300", "1 Mbit/s"});
  refused("host_timeout_ms = 80", "host_timeout_s = 0.08", {"timing.host_timeout_s = 0.08", "write host_timeout_ms = 80 for 0.08 s"});
}

TEST_F(RigFileTest, RefusesAddressesThatAreTakenOrAmbiguous) {
  refused("drive_node = [1, 2, 3, 4]", "drive_node = [1, 2, 3, 2]", {"buses.drive_node = [1, 2, 3, 2]: drives 1 and 3 share node id 2"});
  refused("master_node = 127", "master_node = 3", {"buses.master_node = 3: drive 2 has this node id"});
  refused("sensor_base_id = 0x430", "sensor_base_id = 0x431", {"not a multiple of 16"});
  refused("plant_port = 20000", "plant_port = 20001", {"buses.drives.plant_port = 20001: the same as rig_port"});
  refused("plant_port = 20000", "plant_port = 70000", {"must be from 1 to 65535"});
  refused("interface = \"can1\"", "rig_port = 20000\nplant_port = 20003", {"buses.sensor.rig_port = 20000: the drives' bus has this port"});
  refused("interface = \"can1\"", "interface = \"can1\"\nrig_port = 9", {"either an interface or UDP ports"});
  refused("interface = \"can1\"", "interface = \"an-interface-name\"", {"longer than 15 bytes"});
  const auto shared =
      edited(edited(twin_rig, "rig_port = 20001\nplant_port = 20000\n", "").text, "host = \"127.0.0.1\"", "interface = \"can1\"");
  expect_parts(error_of(shared.text, read_rig), {"buses.sensor.interface = \"can1\": the drives use this bus", "its own"});
  const auto none = edited(twin_rig, "interface = \"can1\"", "");
  expect_parts(error_of(none.text, read_rig), {"file.toml:90: buses.sensor.interface: missing; add interface = \"can0\", or rig_port"});
}

TEST_F(RigFileTest, RefusesNamesThatAreTakenOrTooLong) {
  refused("name = \"thesis\"", "name = \"default\"", {"gains.name = \"default\": another set has this name"});
  refused("name = \"twin\"", "name = \"a_name_that_is_far_too_long_for_the_wire\"", {"longer than 31 bytes"});
  refused("name = \"twin\"", "name = \"a b\"", {"name = \"a b\": holds a space"});
}

TEST_F(RigFileTest, RefusesMoreGainSetsThanTheControllerHolds) {
  std::string many(twin_rig);
  const auto begin = many.find("[[gains]]\nname = \"thesis\"");
  const std::string set = many.substr(begin, many.find("[limits]") - begin);
  for (const char* name : {"\"c\"", "\"d\"", "\"e\""}) many.insert(begin, edited(set, "\"thesis\"", name).text);
  expect_parts(error_of(many, read_rig), {"gains.name = \"thesis\": one set more than the controller has room for (4)"});
  std::string none(twin_rig);
  none.erase(none.find("[[gains]]"), none.find("[limits]") - none.find("[[gains]]"));
  expect_parts(error_of(none, read_rig), {"gains: missing; add one [[gains]]"});
}

TEST_F(RigFileTest, RefusesAHomingPoseOutsideOfTheWorkspace) {
  refused("pose = [0.0, 0.11, 1.5707963267948966]", "pose = [0.0, 0.3, 1.5]",
          {"homing.pose = [0, 0.3, 1.5]: outside of the box", "widen the box"});
  refused("pose = [0.0, 0.11, 1.5707963267948966]", "pose = [0.0, 0.11]",
          {"homing.pose = [0, 0.11]: expected an array of 3 numbers, got 2"});
}

TEST_F(RigFileTest, RefusesAHomingPoseThatTheLinksCannotTake) {
  std::string wide = edited(twin_rig, "[0.098, 0.202]", "[-0.5, 0.5]").text;
  expect_parts(error_of(edited(wide, "[0.0, 0.11, 1.5707963267948966]", "[0.0, 0.4, 1.5]").text, read_rig),
               {"file.toml:34: homing.pose = [0, 0.4, 1.5]: the links cannot take this pose", "move it within reach"});
  expect_parts(error_of(edited(wide, "[0.0, 0.11, 1.5707963267948966]", "[0.0, 0.23, 1.5707963267948966]").text, read_rig),
               {"file.toml:34: homing.pose", "its distance to singularity is 0.", "below limits.singularity = 0.25"});
}

TEST_F(RigFileTest, KeepsASingleLinkageHomeWithoutOrientation) {
  std::ifstream file(TROCAR_SHARE "/rigs/five_bar.toml");
  const std::string text((std::istreambuf_iterator<char>(file)), {});
  expect_parts(error_of(edited(text, "pose = [0.0, 0.149223285959824, 0.0]", "pose = [0.0, 0.149223285959824, 1.57]").text, read_rig),
               {"homing.pose", "a single linkage has no orientation; the third number is 0"});
  expect_parts(error_of(edited(text, "pose = [0.0, 0.149223285959824, 0.0]", "pose = [0.0, -0.1, 0.0]").text, read_rig),
               {"outside of the box"});
}

}  // namespace
}  // namespace trocar::config
