// What one tick pays for the mechanism: kinematics from four angles, maps, torque distribution, dynamics.
// Poses go round the workspace, so that no branch or number is always the same.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <numbers>

#include "common/mechanism/redundancy.hpp"
#include "common/mechanism/twin.hpp"

namespace {

using namespace trocar::mechanism;

constexpr std::size_t poses = 64;

TwinModel example() {
  TwinModel twin;
  for (FiveBarModel& linkage : twin.linkage) {
    linkage.base_m = 0.08;
    for (Link& link : linkage.proximal) link = {0.105, 0.024, 0.048, 5.4e-5};
    for (Link& link : linkage.distal) link = {0.155, 0.020, 0.074, 8.3e-5};
    linkage.end_point_mass_kg = 0.02;
    linkage.reflected_inertia_kg_m2 = {4e-4, 4e-4};
  }
  twin.coupling_m = 0.05;
  twin.handle_m = 0.025;
  twin.handle_mass_kg = 0.15;
  twin.handle_com_m = 0.025;
  twin.handle_inertia_kg_m2 = 1e-4;
  return twin;
}

// Calls body(model, state); a pose that fails ends the run with an error, so that a broken case cannot look fast.
template <class Body>
void over_poses(benchmark::State& run, const Body& body) {
  const TwinModel model = example();
  std::array<TwinState, poses> states;
  bool good = true;
  for (std::size_t k = 0; k < poses; ++k) {
    const double turn = 2.0 * std::numbers::pi * static_cast<double>(k) / poses;
    const Vec3 x(0.04 * std::cos(turn), 0.15 + 0.04 * std::sin(turn), 3.0 * turn);
    good = good && at_pose(model, x, Vec4::Zero(), states[k]) == Status::Ok;
  }
  std::size_t k = 0;
  for (auto _ : run) {
    good = body(model, states[k]) == Status::Ok && good;
    k = (k + 1) % poses;
  }
  if (!good) run.SkipWithError("a pose failed");
}

void TwinForward(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    TwinState state;
    const Status status = forward(model, at.q, at.x(2), state);
    benchmark::DoNotOptimize(state);
    return status;
  });
}
BENCHMARK(TwinForward);

void TwinInverse(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    Vec4 q;
    const Status status = inverse(model, at.x, at.q, q);
    benchmark::DoNotOptimize(q);
    return status;
  });
}
BENCHMARK(TwinInverse);

void TwinVelocityMap(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    Mat43 H;
    const Status status = velocity_map(model, at, H);
    benchmark::DoNotOptimize(H);
    return status;
  });
}
BENCHMARK(TwinVelocityMap);

void TwinDynamics(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    Mat3 M, C;
    const Status status = dynamics(model, at, {0.01, 0.02, 0.3}, M, C);
    benchmark::DoNotOptimize(M);
    benchmark::DoNotOptimize(C);
    return status;
  });
}
BENCHMARK(TwinDynamics);

void FiveBarDynamics(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    Mat2 D, C;
    const Status status = dynamics(model.linkage[0], at.q.head<2>(), {0.1, 0.2}, D, C);
    benchmark::DoNotOptimize(D);
    benchmark::DoNotOptimize(C);
    return status;
  });
}
BENCHMARK(FiveBarDynamics);

void ActuatorTorque(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    Mat43 H;
    const Status status = velocity_map(model, at, H);
    benchmark::DoNotOptimize(actuator_torque(H, Vec4::Constant(8.0), {1.0, 2.0, 0.01}));
    return status;
  });
}
BENCHMARK(ActuatorTorque);

// All of it, as a tick does it.
void WholeMechanismTick(benchmark::State& run) {
  over_poses(run, [](const TwinModel& model, const TwinState& at) {
    TwinState state;
    Mat43 H;
    Mat34 F;
    Mat3 M, C;
    const bool good = forward(model, at.q, at.x(2), state) == Status::Ok && velocity_map(model, state, H) == Status::Ok &&
                      pose_map(model, state, F) == Status::Ok && dynamics(model, state, {0.01, 0.02, 0.3}, M, C) == Status::Ok;
    benchmark::DoNotOptimize(singularity_distance(model, state));
    benchmark::DoNotOptimize(actuator_torque(H, Vec4::Constant(8.0), M * Vec3(0.1, 0.2, 1.0) + C * Vec3(0.01, 0.02, 0.3)));
    return good ? Status::Ok : Status::Singular;
  });
}
BENCHMARK(WholeMechanismTick);

}  // namespace
