// Cost of the wire: frames, bit counting, datagrams, and one whole tick of the link without contact.
#include <benchmark/benchmark.h>

#include <memory>

#include "hal/can/bits.hpp"
#include "hal/can/cannelloni.hpp"
#include "wired_rig.hpp"

namespace trocar::hal {
namespace {

CanFrame feedback_frame() {
  CanFrame frame{.id = 0x181, .length = 8};
  store(frame, 0, std::int32_t{-123456});
  store(frame, 4, std::int16_t{250});
  store(frame, 6, std::uint16_t{0x1237});
  return frame;
}

void encode_torque_frame(benchmark::State& state) {
  OutputGate gate{make_test_rig()};
  std::array<double, capacity::drives> torque_nm{0.1, -0.2, 0.3, -0.4};
  for (auto _ : state) {
    benchmark::DoNotOptimize(torque_nm);
    benchmark::DoNotOptimize(torque_frame(gate.pass(torque_nm, true)));
  }
}
BENCHMARK(encode_torque_frame);

void decode_feedback_frame(benchmark::State& state) {
  canopen::Master master{make_test_rig()};
  const CanFrame frame = feedback_frame();
  for (auto _ : state) {
    benchmark::DoNotOptimize(master.receive(frame, 0));
    benchmark::ClobberMemory();
  }
}
BENCHMARK(decode_feedback_frame);

void count_stuffed_bits(benchmark::State& state) {
  CanFrame frame = feedback_frame();
  for (auto _ : state) {
    benchmark::DoNotOptimize(frame);
    benchmark::DoNotOptimize(can_bits(frame));
  }
}
BENCHMARK(count_stuffed_bits);

void encode_and_decode_datagram(benchmark::State& state) {
  cannelloni::Writer writer;
  cannelloni::Reader reader;
  CanFrame frame = feedback_frame();
  for (auto _ : state) {
    writer.clear();
    for (int i = 0; i < 4; ++i) benchmark::DoNotOptimize(writer.append(frame));
    benchmark::DoNotOptimize(reader.open(writer.finish(0)));
    while (reader.next(frame)) benchmark::DoNotOptimize(frame);
  }
}
BENCHMARK(encode_and_decode_datagram);

// The link alone: the answers of the drives and the sensor are made beforehand, the bus is a queue without time.
class QueueBus {
 public:
  bool send(const CanFrame&, std::int64_t) noexcept {
    ++counters_.sent;
    return true;
  }
  void flush(std::int64_t) noexcept {}
  bool receive(CanFrame& frame, std::int64_t) noexcept { return answers.pop(frame); }
  [[nodiscard]] const BusCounters& counters() const noexcept { return counters_; }
  [[nodiscard]] int file_descriptor() const noexcept { return -1; }
  Fifo<CanFrame, 16> answers;

 private:
  BusCounters counters_;
};

void tick_of_the_link(benchmark::State& state) {
  QueueBus drives;
  QueueBus sensor;
  RigLink<QueueBus> link{make_test_rig(), drives, sensor};
  CanFrame feedback = feedback_frame();
  const CanFrame first{.id = 0x1B5, .length = 8};
  const CanFrame second{.id = 0x1B6, .length = 8};
  LinkCommand command{.request = DriveRequest::Enable};
  command.joint_torque_nm.fill(0.1);
  std::int64_t now_ns = 0;
  for (auto _ : state) {
    link.begin_tick(now_ns);
    for (std::uint32_t node = 1; node <= 4; ++node) {
      feedback.id = 0x180 + node;
      benchmark::DoNotOptimize(drives.answers.push(feedback));
    }
    benchmark::DoNotOptimize(sensor.answers.push(first) && sensor.answers.push(second));
    benchmark::DoNotOptimize(link.poll(now_ns));
    link.end_tick(now_ns, command);
    now_ns += 1'000'000;
  }
}
BENCHMARK(tick_of_the_link);

// Link, both buses with bit times and arbitration, four drives and the sensor: what the lock-step bench pays for the wire.
void tick_of_link_buses_and_nodes(benchmark::State& state) {
  const auto wired = std::make_unique<WiredRig>();
  if (!wired->enable()) state.SkipWithError("not enabled");
  for (auto _ : state) wired->tick();
}
BENCHMARK(tick_of_link_buses_and_nodes)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace trocar::hal
