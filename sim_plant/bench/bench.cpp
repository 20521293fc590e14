#include "sim_plant/bench/bench.hpp"

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
  plant_.advance(now_ns);
  hal::CanFrame frame;
  for (std::size_t i = 0; i < WiredPlant::drives; ++i) {
    hal::MemoryPort& port = drives_bus_.port(i + 1);
    while (port.receive(frame, now_ns)) plant_.drive_receives(i, frame, now_ns);
    while (plant_.drive_transmits(i, frame)) port.send(frame, now_ns);
  }
  hal::MemoryPort& port = sensor_bus_.port(1);
  while (port.receive(frame, now_ns)) plant_.sensor_receives(frame, now_ns);
  while (plant_.sensor_transmits(frame)) port.send(frame, now_ns);
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
