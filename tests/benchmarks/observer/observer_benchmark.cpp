// The force observers of firmware/control against plain inverse dynamics on ubc_twin_haptic: force error and step response over bandwidth,
// with encoders of 16,000 counts and friction, at 1 and 4 kHz, and over the real bus protocol in the lock-step bench. Exit code 1 when the
// Nicosia observer misses 0.6 N and 10 ms at the shipped rig's bandwidth, on the machine as modelled at 1 kHz or in the bench.
//   observer_benchmark [--out FOLDER] [--quick]
#include <fmt/core.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "common/config/rig_file.hpp"
#include "sim_plant/mechanism/imperfection.hpp"
#include "sim_plant/plant/plant_file.hpp"
#include "tests/benchmarks/observer/course.hpp"
#include "tests/benchmarks/observer/judge.hpp"
#include "tests/benchmarks/observer/output.hpp"
#include "tests/benchmarks/observer/times.hpp"
#include "tests/benchmarks/program/program.hpp"

namespace trocar::bench {
namespace {

sim_plant::StopConfig stops(const rig::Rig& rig) { return {rig.limits.workspace_x_m, rig.limits.workspace_y_m, 5e4, 150.0, 0.2}; }

// Geometry, inertia and friction are what the observer believes. Bristles bend by the plant file's 0.25 mrad.
Machine as_modelled(const rig::Rig& rig) {
  Machine machine{"as modelled", {rig.twin, {}, stops(rig)}, 0.0};
  const auto& a = rig.actuation;
  machine.body.friction.fill({a.friction_coulomb_nm, a.friction_viscous_nm_s, a.friction_coulomb_nm / 2.5e-4, 0.0});
  return machine;
}

// Lengths, masses and current loop as the plant file says; friction differs from the rig's by its factors (`own` is the rig that it is
// for).
Machine as_built(const rig::Rig& rig, const rig::Rig& own, const sim_plant::PlantConfig& plant) {
  Machine machine{"as built", {sim_plant::imperfect(rig.twin, plant.imperfection), plant.friction, stops(rig)}, plant.current_loop_hz};
  const double coulomb = rig.actuation.friction_coulomb_nm / own.actuation.friction_coulomb_nm;
  for (sim_plant::JointFrictionConfig& f : machine.body.friction) {
    f.coulomb_nm *= coulomb;
    f.stiffness_nm_per_rad *= coulomb;
    f.bristle_damping_nm_s *= coulomb;
    f.viscous_nm_s *= rig.actuation.friction_viscous_nm_s / own.actuation.friction_viscous_nm_s;
  }
  return machine;
}

// The plant file taken literally, as the simulated plant does: friction of the geared machine in the direct drive, ten times the rig's.
Machine geared_friction(const rig::Rig& rig, const sim_plant::PlantConfig& plant) {
  return {"gear friction", {sim_plant::imperfect(rig.twin, plant.imperfection), plant.friction, stops(rig)}, plant.current_loop_hz};
}

void run_course(const Course& course, rig::Rig rig, const std::vector<double>& bandwidths, std::vector<Trial>& rows) {
  rig.timing.tick_hz = std::round(1.0 / course.tick_s);
  for (const std::string& method : methods)
    for (const double bandwidth : bandwidths) {
      Trial row{course.machine, method, rig.timing.tick_hz, bandwidth, judge(course, estimator(method, rig, bandwidth)), {}};
      if (method != "inverse") {
        const auto kind = method == "nicosia" ? control::ObserverKind::Nicosia : control::ObserverKind::Momentum;
        row.admission = control::admit(control::force_observer_config(rig, kind, bandwidth), rig, force_goal_n);
      }
      rows.push_back(row);
    }
}

std::vector<TraceRow> trace_of(const Course& course, const rig::Rig& rig) {
  std::vector<Estimator> estimators;
  for (const std::string& method : methods) estimators.push_back(estimator(method, rig, 390.0));
  const double from = course.steps[2].time_s - 0.02;
  std::vector<TraceRow> trace;
  for (const Sample& sample : course.samples) {
    TraceRow row{sample.time_s, sample.hand(0), {}};
    for (Estimator& estimate : estimators) row.found_n.push_back(estimate(sample, course.tick_s)(0));
    if (sample.time_s >= from && sample.time_s < from + 0.12) trace.push_back(row);
  }
  return trace;
}

int run(const Options& options) {
  const std::filesystem::path share(TROCAR_SHARE);
  const rig::Rig rig = config::read_twin(share / "rigs/ubc_twin_haptic.toml");
  const rig::Rig own = config::read_twin(share / "rigs/ubc_twin.toml");
  const sim_plant::PlantConfig plant = sim_plant::read_plant(share / "plants/ubc_twin.toml");

  std::vector<double> bandwidths{50, 75, 100, 150, 200, 250, 300, 325, 350, 390, 420, 450, 500, 550, 600, 650, 700, 800, 900, 1000};
  if (options.quick) bandwidths = {200, 350, 390, 450};
  std::vector<Trial> rows;
  std::vector<TraceRow> trace;
  std::vector<Machine> machines{as_modelled(rig)};
  if (!options.quick) machines.insert(machines.end(), {as_built(rig, own, plant), geared_friction(rig, plant)});
  for (const Machine& machine : machines)
    for (const double tick_s : {1e-3, 2.5e-4}) {
      fmt::print(stderr, "observer_benchmark: {}, {:.0f} Hz …\n", machine.name, 1.0 / tick_s);
      const Course course = record(rig, machine, tick_s);
      run_course(course, rig, bandwidths, rows);
      if (trace.empty()) trace = trace_of(course, rig);
      print(rows, machine.name, std::round(1.0 / tick_s));
      fmt::print("handle up to {:.2f} m/s, motors up to {:.2f} N m\n", course.fastest_m_s, course.most_torque_nm);
      if (rows.size() == methods.size() * bandwidths.size()) print_times(course, rig, options.quick ? 3 : 20);
    }
  {
    fmt::print(stderr, "observer_benchmark: in the lock-step bench …\n");
    const Course course = record_on_bus(rig, sim_plant::read_plant(share / "plants/ubc_twin_haptic.toml"));
    run_course(course, rig, bandwidths, rows);
    print(rows, course.machine, 1000.0);
    fmt::print("handle up to {:.2f} m/s, motors up to {:.2f} N m\n", course.fastest_m_s, course.most_torque_nm);
  }
  print_summary(rows);
  write(options.out, rows, trace);
  fmt::print("\ntables and figures: {}\n", options.out.string());
  int met = 0;
  for (const Trial& r : rows)
    met += (r.machine == "as modelled" || r.machine == "on the bus") && r.method == "nicosia" && r.tick_hz == 1000.0 &&
                   r.bandwidth_rad_s == rig.haptic.observer_bandwidth_rad_s && r.met() && r.admission.verdict == control::Admissible::Yes
               ? 1
               : 0;
  return met == 2 ? 0 : 1;
}

}  // namespace
}  // namespace trocar::bench

int main(int count, char** argument) { return trocar::bench::run_program("observer_benchmark", count, argument, trocar::bench::run); }
