// Factoring and compliance columns of the two meshes that scenes are compiled from: what ordering, how many columns a block.
#include <benchmark/benchmark.h>

#include <map>
#include <memory>

#include "common/fem/statics.hpp"

namespace {

using namespace trocar;

struct Model {
  fem::Mesh mesh;
  fem::Tissue tissue;
};

// 10,201 nodes in the plane, or 61 x 61 x 9 nodes of bricks (100,467 unknowns).
Model model(bool solid) {
  Model m;
  m.tissue.model = solid ? fem::Model::Solid : fem::Model::PlaneStress;
  m.tissue.integration = fem::Integration::BBar;
  m.tissue.thickness_m = 0.011;
  m.tissue.grid = solid ? fem::uniform_grid(fem::Type::Hex8, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.011}, {61, 61, 9})
                        : fem::uniform_grid(fem::Type::Quad4, {-0.05, 0.0, 0.0}, {0.1, 0.1, 0.0}, {101, 101, 1});
  m.tissue.zones = {{{25300.0, 0.48}, {}, {}}};
  m.tissue.supports = {{fem::Side::YMax, {true, true, solid}}};
  m.mesh = fem::make_mesh(m.tissue);
  return m;
}

void assemble(benchmark::State& run) {
  const Model m = model(run.range(0) == 3);
  for (auto _ : run) benchmark::DoNotOptimize(fem::assemble_stiffness(m.mesh, m.tissue).nonZeros());
}
BENCHMARK(assemble)->ArgName("dimension")->Arg(2)->Arg(3)->Unit(benchmark::kMillisecond);

Eigen::SparseMatrix<double> free_stiffness(const Model& m) {
  const fem::Equations equations(fem::supported_degrees_of_freedom(m.mesh, m.tissue.supports));
  return equations.reduce(fem::assemble_stiffness(m.mesh, m.tissue));
}

void factor(benchmark::State& run) {
  const Eigen::SparseMatrix<double> k = free_stiffness(model(run.range(0) == 3));
  fem::Factor::Info info;
  for (auto _ : run) info = fem::Factor(k, static_cast<fem::Ordering>(run.range(1))).info();
  run.counters["nonzeros"] = static_cast<double>(info.nonzeros);
  run.counters["megabytes"] = 1e-6 * static_cast<double>(info.bytes);
}
BENCHMARK(factor)->ArgNames({"dimension", "ordering"})->ArgsProduct({{2, 3}, {0, 1, 2}})->Unit(benchmark::kMillisecond)->UseRealTime();

// Columns of the needle's plane within 15 mm of the axis. Rows wanted: 0 all, 1 those nodes and (in the solid) the top face, 2 those nodes.
void columns(benchmark::State& run) {
  const Model m = model(run.range(0) == 3);
  static std::map<std::int64_t, std::unique_ptr<fem::Statics>> made;
  auto& statics = made[run.range(0)];
  if (!statics) statics = std::make_unique<fem::Statics>(m.mesh, m.tissue);
  const double z = run.range(0) == 3 ? 0.0055 : 0.0;
  std::vector<Eigen::Triplet<double>> loads;
  int count = 0;
  for (const int n : fem::nodes_at(m.mesh, fem::Box{{-0.015, -1.0, z}, {0.015, 1.0, z}}))
    for (int a = 0; a < 2; ++a) {
      const Eigen::Index i = static_cast<Eigen::Index>(n) * m.mesh.dimension() + a;
      if (!statics->supported(i)) loads.emplace_back(static_cast<int>(i), count++, 1.0);
    }
  std::vector<bool> wanted(static_cast<std::size_t>(statics->degrees_of_freedom()), run.range(2) == 0);
  const auto want = [&](const fem::Where& where) {
    for (const int n : fem::nodes_at(m.mesh, where))
      for (int a = 0; a < m.mesh.dimension(); ++a) wanted[static_cast<std::size_t>(n * m.mesh.dimension() + a)] = true;
  };
  want(fem::Box{{-0.015, -1.0, z}, {0.015, 1.0, z}});
  if (run.range(2) == 1 && m.mesh.dimension() == 3) want(fem::Side::ZMax);
  Eigen::SparseMatrix<double> right(statics->degrees_of_freedom(), count);
  right.setFromTriplets(loads.begin(), loads.end());
  for (auto _ : run) {
    double sum = 0.0;
    statics->solve_columns(right, run.range(1), wanted, [&](Eigen::Index, const auto& u) { sum += u(0, 0); });
    benchmark::DoNotOptimize(sum);
  }
  run.counters["columns"] = count;
  run.counters["seconds_per_column"] =
      benchmark::Counter(count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
  benchmark::Counter(1e-3 * count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(columns)
    ->ArgNames({"dimension", "block", "wanted"})
    ->ArgsProduct({{2, 3}, {16, 32, 64, 128}, {0, 1, 2}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime()
    ->Iterations(1);

}  // namespace
