// The whole insertion experiment on two real CAN buses, at the full tick rate: controller and plant in one process with a virtual
// clock, each with sockets of its own. The kernel carries every frame; how fast it does so plays no part.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <variant>

#include "common/config/rig_file.hpp"
#include "common/config/share.hpp"
#include "common/experiment/experiment.hpp"
#include "common/experiment/experiment_file.hpp"
#include "common/rig/bus_budget.hpp"
#include "common/scene/scene.hpp"
#include "firmware/controller/controller.hpp"
#include "hal/can/socketcan_bus.hpp"
#include "hal/rig_link.hpp"
#include "sim_plant/plant/plant_file.hpp"
#include "sim_plant/wired/wired_plant.hpp"

namespace trocar {
namespace {

constexpr std::uint64_t session = 1;

struct Machine {
  Machine(const rig::Rig& rig, const scene::Scene& scene, const experiment::Experiment& e)
      : plant{rig, sim_plant::read_plant(config::find_share("plants", e.plant)), scene, 1} {
    EXPECT_TRUE(drives.open(rig.buses.drives.interface.data()).ok());
    EXPECT_TRUE(sensor.open(rig.buses.sensor.interface.data()).ok());
  }
  void step(std::int64_t now_ns) {
    plant.advance(now_ns);
    hal::CanFrame frame;
    while (drives.receive(frame, now_ns))
      for (std::size_t i = 0; i < plant.drives; ++i) plant.drive_receives(i, frame, now_ns);
    for (std::size_t i = 0; i < plant.drives; ++i)
      while (plant.drive_transmits(i, frame)) drives.send(frame, now_ns);
    while (sensor.receive(frame, now_ns)) plant.sensor_receives(frame, now_ns);
    while (plant.sensor_transmits(frame)) sensor.send(frame, now_ns);
  }
  sim_plant::WiredPlant plant;
  hal::SocketCanBus drives, sensor;
};

TEST(ExperimentOnCan, RunsWithoutFaultOrLossAndWithinTheBusBudget) {
  const rig::Rig rig = config::read_twin(TROCAR_VCAN_RIG);
  experiment::Experiment e = experiment::read_experiment(config::find_share("experiments", "insertion"));
  auto& course = std::get<experiment::InsertionCourse>(e.course);
  course.speeds_m_s = {0.02};
  course.depth_m = 0.02;
  course.dwell_s = 0.1;
  course.touch_speed_m_s = 0.004;
  course.approach_speed_m_s = 0.06;
  course.thesis_check = false;
  const scene::Scene scene = scene::read_scene(config::find_share("scenes", e.scene));
  const auto entry = scene::entry_m(scene);
  experiment::Sequencer sequencer(e, {entry[1], entry[0], scene.needle->length_m}, rig, session);

  auto machine = std::make_unique<Machine>(rig, scene, e);
  hal::SocketCanBus drives;
  hal::SocketCanBus sensor;
  ASSERT_TRUE(drives.open(rig.buses.drives.interface.data(), hal::canopen::received_ids(rig).all()).ok());
  ASSERT_TRUE(sensor.open(rig.buses.sensor.interface.data()).ok());
  hal::RigLink<hal::SocketCanBus> link{rig, drives, sensor};
  auto mail = std::make_unique<controller::Mailboxes>();
  auto controller = std::make_unique<controller::Controller>(rig, *mail, true, nullptr);

  constexpr std::int64_t period_ns = 1'000'000;
  constexpr std::int64_t feedback_ns = 650'000;  // as after four frames on a bus with bit times
  double deepest_m = -1.0;
  double most_n = 0.0;
  std::int64_t now_ns = 0;
  for (; !sequencer.finished() && now_ns < 60'000'000'000; now_ns += period_ns) {
    if (const auto command = sequencer.next()) mail->commands.push(*command);
    if (now_ns % (20 * period_ns) == 0) mail->commands.push({.session = session, .kind = CommandKind::KeepAlive});
    link.begin_tick(now_ns);
    machine->step(now_ns);
    link.poll(now_ns + feedback_ns);
    const hal::LinkCommand& command = controller->tick({now_ns, 0, &link.feedback()});
    link.end_tick(now_ns + feedback_ns, command);
    machine->step(now_ns + feedback_ns);
    const Sample& sample = controller->sample();
    if (std::isfinite(sample.pose[1])) deepest_m = std::max(deepest_m, sequencer.tip_depth_m(sample));
    most_n = std::max(most_n, std::abs(sample.base_wrench[1]));
    sequencer.on_sample(sample);
    Reply reply;
    while (mail->replies.pop(reply)) sequencer.on_reply(reply);
    Event event;
    while (mail->events.pop(event)) EXPECT_NE(event.kind, EventKind::FaultLatched) << to_string(event.fault);
  }
  ASSERT_TRUE(sequencer.finished() && !sequencer.failed()) << sequencer.failure();
  EXPECT_NEAR(deepest_m, course.depth_m, 0.001);
  EXPECT_GT(most_n, 0.3);

  const hal::LinkCounters counters = link.counters();
  EXPECT_EQ(counters.missed_feedback + counters.late_feedback + counters.missed_ends, 0u);
  EXPECT_EQ(counters.foreign_frames, 0u);
  for (const hal::BusCounters* bus :
       {&counters.drives_bus, &counters.sensor_bus, &machine->drives.counters(), &machine->sensor.counters()}) {
    EXPECT_EQ(bus->send_dropped + bus->receive_dropped + bus->error_frames + bus->unsupported, 0u);
    EXPECT_GT(bus->sent, 0u);
  }

  // Bits as they would be on a wire, stuffing included, against the worst case that was computed beforehand.
  const rig::BusBudget budget = rig::bus_budget(rig);
  const hal::BusReport& report = link.bus_report();
  const std::uint32_t heartbeats = static_cast<std::uint32_t>(rig.drives()) * rig::worst_case_can_bits(1);
  EXPECT_LE(report.drives_load.most_in_a_tick(), budget.drives_peak_bits + heartbeats);
  EXPECT_GT(report.drives_load.most_in_a_tick(), budget.drives_cyclic_bits * 3 / 4);
  EXPECT_LE(report.sensor_load.most_in_a_tick(), budget.sensor_bits);
  const double ticks = static_cast<double>(report.ticks);
  const double drives_percent = 100.0 * static_cast<double>(report.drives_load.bits()) / (ticks * budget.bits_per_tick);
  const double sensor_percent = 100.0 * static_cast<double>(report.sensor_load.bits()) / (ticks * budget.bits_per_tick);
  EXPECT_LE(drives_percent, budget.drives_peak_percent + budget.heartbeat_percent);
  EXPECT_GT(drives_percent, 50.0);  // six frames of at least 47 bits and their data
  EXPECT_LE(sensor_percent, budget.sensor_percent);
  EXPECT_GT(sensor_percent, 25.0);
  RecordProperty("drives_percent", std::to_string(drives_percent));
  RecordProperty("sensor_percent", std::to_string(sensor_percent));
  std::printf("bus load over %.1f s: drives %.1f %% (budget %.1f %%), sensor %.1f %% (budget %.1f %%)\n",
              1e-9 * static_cast<double>(now_ns), drives_percent, budget.drives_peak_percent, sensor_percent, budget.sensor_percent);
}

}  // namespace
}  // namespace trocar
