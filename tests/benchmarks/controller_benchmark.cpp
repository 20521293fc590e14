// What one tick of the controller costs, alone and with bus and plant in lock-step. A tick has 1 ms.
#include <benchmark/benchmark.h>

#include "common/scene/scene.hpp"
#include "fake_rig.hpp"
#include "sim_plant/bench/bench.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace {

using namespace trocar;

void ControllerTick(benchmark::State& run) {
  controller::FakeRig f;
  f.positioned();
  for (auto _ : run) {
    f.now_ns += controller::FakeRig::ms;
    f.mail->commands.push({.session = controller::FakeRig::host, .kind = CommandKind::KeepAlive});
    benchmark::DoNotOptimize(f.controller->tick({f.now_ns, 0, &f.feedback}));
  }
  if (f.mode() != Mode::Position) run.SkipWithError("the controller left Position");
}
BENCHMARK(ControllerTick);

void LockStepTick(benchmark::State& run) {
  const std::filesystem::path share{TROCAR_SHARE};
  const rig::Rig rig = config::read_rig(share / "rigs/ubc_twin.toml");
  sim_plant::Bench bench(rig, sim_plant::read_plant(share / "plants/ubc_twin.toml"), scene::read_scene(share / "scenes/phantom.toml"), 1);
  const auto send = [&](CommandKind kind, int ticks) {
    bench.mail().commands.push({.session = 1, .id = 1, .kind = kind});
    for (int i = 0; i < ticks; ++i) bench.tick();
  };
  send(CommandKind::KeepAlive, 1500);
  send(CommandKind::Home, 100);
  send(CommandKind::Arm, 50);
  send(CommandKind::Hold, 50);
  for (auto _ : run) bench.tick();
  if (bench.sample().mode != Mode::Hold) run.SkipWithError("the rig does not hold");
}
BENCHMARK(LockStepTick)->Unit(benchmark::kMicrosecond);

}  // namespace
