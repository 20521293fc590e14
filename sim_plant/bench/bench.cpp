#include "sim_plant/bench/bench.hpp"

#include "hal/canopen/objects.hpp"

namespace trocar::sim_plant {

namespace {

constexpr std::int64_t step_ns = 50'000;  // finer than a frame of 8 bytes at 1 Mbit/s
constexpr std::size_t rig_port = 0;       // drives follow at 1 …

}  // namespace

Bench::Bench(const rig::Rig& rig, const PlantConfig& plant, const std::optional<scene::Scene>& scene, std::uint64_t seed,
             virtual_needle::VirtualNeedle* needle)
    : rig_(rig),
      mail_(std::make_unique<controller::Mailboxes>()),
      drives_bus_(rig.buses.bitrate_bps),
      sensor_bus_(rig.buses.bitrate_bps),
      link_(rig_, drives_bus_.port(rig_port), sensor_bus_.port(rig_port)),
      controller_(rig_, *mail_, true, needle),
      plant_(rig, plant, scene, seed) {
  for (std::size_t i = 0; i < WiredPlant::drives; ++i) (void)drives_bus_.port(i + 1);
  (void)sensor_bus_.port(1);
}

void Bench::step_plant(std::int64_t now_ns) noexcept {
  if (faults_.any()) {
    afflict(now_ns);
    if (faults_.on(Ailment::Frozen, 0, now_ns) != nullptr) return;
  }
  plant_.advance(now_ns);
  for (std::size_t i = 0; i < WiredPlant::drives; ++i)
    exchange(
        Wire::Drives, drives_bus_.port(i + 1), now_ns, [&](const hal::CanFrame& f) { plant_.drive_receives(i, f, now_ns); },
        [&](hal::CanFrame& f) { return plant_.drive_transmits(i, f); });
  exchange(
      Wire::Sensor, sensor_bus_.port(1), now_ns, [&](const hal::CanFrame& f) { plant_.sensor_receives(f, now_ns); },
      [&](hal::CanFrame& f) { return plant_.sensor_transmits(f); });
}

template <class Take, class Give>
void Bench::exchange(Wire wire, hal::MemoryPort& port, std::int64_t now_ns, Take&& take, Give&& give) noexcept {
  hal::CanFrame frame;
  const auto send = [&](const hal::CanFrame& f) { port.send(f, now_ns); };
  while (port.receive(frame, now_ns)) {
    if (faults_.any())
      faults_.carry(wire, Way::ToPlant, frame, now_ns, take);
    else
      take(frame);
  }
  while (give(frame)) {
    if (faults_.any())
      faults_.carry(wire, Way::FromPlant, frame, now_ns, send);
    else
      send(frame);
  }
  if (faults_.any()) faults_.release(wire, now_ns, send);
}

// Troubles of the parts.
void Bench::afflict(std::int64_t now_ns) noexcept {
  for (std::size_t i = 0; i < WiredPlant::drives; ++i) {
    DriveTrouble now;
    now.stuck = faults_.on(Ailment::EncoderStuck, i, now_ns) != nullptr;
    now.backwards = faults_.on(Ailment::EncoderBackwards, i, now_ns) != nullptr;
    if (const Trouble* t = faults_.on(Ailment::EncoderJumped, i, now_ns)) now.jump_rad = t->amount;
    now.dead = faults_.on(Ailment::MotorDead, i, now_ns) != nullptr;
    now.full = faults_.on(Ailment::MotorFull, i, now_ns) != nullptr;
    plant_.trouble(i, now);
    if (const Trouble* t = faults_.once(Ailment::DriveFault, i, now_ns))
      plant_.drive(i).trigger_fault(static_cast<std::uint16_t>(t->amount));
    if (faults_.once(Ailment::PowerCut, i, now_ns) != nullptr) plant_.drive(i).restart();
    hal::MemoryPort& port = drives_bus_.port(i + 1);
    const std::uint8_t node = rig_.buses.drive_node[i];
    if (const Trouble* t = faults_.once(Ailment::Emergency, i, now_ns)) {
      hal::CanFrame emergency{.id = hal::canopen::cob_emergency(node), .length = 8};
      hal::store(emergency, 0, static_cast<std::uint16_t>(t->amount));
      port.send(emergency, now_ns);
    }
    if (faults_.once(Ailment::LeftOperation, i, now_ns) != nullptr)
      plant_.drive_receives(i, hal::canopen::nmt_frame(hal::canopen::NmtCommand::PreOperational, node), now_ns);
  }
  plant_.saturate_sensor(faults_.on(Ailment::SensorSaturated, 0, now_ns) != nullptr);
  if (faults_.once(Ailment::BusOff, 0, now_ns) != nullptr)
    drives_bus_.port(rig_port).report({.id = hal::error_class_bus_off, .error = true});
}

void Bench::tick() noexcept {
  const auto period_ns = static_cast<std::int64_t>(1e9 / rig_.timing.tick_hz);
  const std::int64_t deadline_ns = 1000 * static_cast<std::int64_t>(rig_.timing.feedback_deadline_us);
  const std::int64_t begin_ns = now_ns_;
  link_.begin_tick(begin_ns);
  bool answered = false;
  std::int64_t t = begin_ns;
  while (!answered && t + step_ns <= begin_ns + deadline_ns) {
    t += step_ns;
    step_plant(t);
    answered = link_.poll(t);
  }
  const hal::LinkCommand& command = controller_.tick({begin_ns, 0, &link_.feedback()});
  link_.end_tick(t, late_ ? held_ : command);
  held_ = command;
  while (t + step_ns <= begin_ns + period_ns) {
    t += step_ns;
    step_plant(t);
  }
  now_ns_ = begin_ns + period_ns;
}

}  // namespace trocar::sim_plant
