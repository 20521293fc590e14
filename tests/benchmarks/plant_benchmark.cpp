// What one simulated millisecond costs, and the parts of it. The lock-step bench runs the plant and the controller five times
// faster than real time, so that a millisecond of both has 200 us.
#include <benchmark/benchmark.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "common/config/rig_file.hpp"
#include "sim_plant/plant/plant.hpp"
#include "sim_plant/plant/plant_file.hpp"

namespace {

using namespace trocar;
using namespace trocar::sim_plant;

std::filesystem::path shared(const char* file) { return std::filesystem::path(TROCAR_SHARE) / file; }
scene::Scene shipped_scene() { return scene::read_scene(shared("scenes/phantom.toml")); }

// range(0): depth of the tip in the tissue in mm, 0 in the air. A hand moves the handle to and fro by 3 mm, past stick and slip.
void PlantMillisecond(benchmark::State& run) {
  rig::Rig rig = config::read_rig(shared("rigs/ubc_twin.toml"));
  const scene::Scene phantom = shipped_scene();
  if (run.range(0) > 0)
    rig.homing_pose[1] = phantom.tissue.grid->axis_m[1].front() - phantom.needle->length_m + 1e-3 * static_cast<double>(run.range(0));
  Plant plant(rig, read_plant(shared("plants/ubc_twin.toml")), phantom, 1);
  const double home = rig.homing_pose[1];
  for (auto _ : run) {
    const double time = 1e-9 * static_cast<double>(plant.time_ns());
    const double goal = home + 0.003 * std::sin(2 * std::numbers::pi * time);
    const auto x = plant.pose();
    const auto v = plant.velocity();
    plant.set_hand_wrench({-2000 * x[0] - 30 * v[0], 2000 * (goal - x[1]) - 30 * v[1], 2 * (rig.homing_pose[2] - x[2]) - 0.03 * v[2]});
    plant.advance_to(plant.time_ns() + 1'000'000, {});
  }
  run.counters["contacts"] = static_cast<double>(plant.phantom().contacts());
  run.counters["rows_per_ms"] =
      benchmark::Counter(static_cast<double>(plant.phantom().counters().rows_factored), benchmark::Counter::kAvgIterations);
  if (plant.phantom().counters().unconverged != 0 || plant.body().counters().caught != 0) run.SkipWithError("the simulation failed");
}
BENCHMARK(PlantMillisecond)->Arg(0)->Arg(20)->Arg(40)->Arg(70)->Unit(benchmark::kMicrosecond);

// One call with 1 um of motion; range(1) = 1: the needle turns as well, which changes every contact's frame.
void PhantomStep(benchmark::State& run) {
  Phantom phantom(shipped_scene());
  const double home = 0.115 + 1e-3 * static_cast<double>(run.range(0));
  std::int64_t k = 0;
  for (auto _ : run) {
    const double phase = 1e-3 * static_cast<double>(++k);
    const double turn = run.range(1) != 0 ? 0.01 * std::sin(0.7 * phase) : 0.0;
    benchmark::DoNotOptimize(phantom.advance({0.0, home + 0.001 * std::sin(phase), std::numbers::pi / 2 + turn}, 1e-4));
  }
  run.counters["contacts"] = static_cast<double>(phantom.contacts());
}
BENCHMARK(PhantomStep)->Args({20, 0})->Args({70, 0})->Args({20, 1})->Args({70, 1});

void PhantomConstruction(benchmark::State& run) {
  const scene::Scene config = shipped_scene();
  for (auto _ : run) {
    const Phantom phantom(config);
    benchmark::DoNotOptimize(&phantom);
  }
}
BENCHMARK(PhantomConstruction)->Unit(benchmark::kMillisecond);

}  // namespace
