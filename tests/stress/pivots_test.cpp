// Millions of exchanges on random compliances: nothing may build up.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/contact/solver.hpp"
#include "stress.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::stress {
namespace {

using contact::Block;
using contact::Solver;
using contact::SolverStatus;
using contact::Target;

struct Outcome {
  long pivots{};
  long solves{};
  long not_ok{};
  int most_pivots{};
  double worst_residual_n{};
  double drift{};
  std::size_t allocations{};
  std::uint64_t fingerprint{};
};

// Half of the time the targets wander, as they do from tick to tick; half of the time they are new altogether.
Outcome exchange(std::uint64_t seed, std::size_t s, double condition, long pivots) {
  reference::Random random(seed);
  const Eigen::MatrixXd g = reference::random_compliance(random, s, condition);
  std::vector<std::vector<Block>> rows(s);
  for (std::size_t i = 0; i < s; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const auto r = static_cast<Eigen::Index>(2 * i);
      const auto c = static_cast<Eigen::Index>(2 * j);
      rows[i].push_back({g(r, c), g(r, c + 1), g(r + 1, c), g(r + 1, c + 1)});
    }
  }
  const auto solver = std::make_unique<Solver>();
  std::vector<Target> target(s);
  Outcome outcome;
  Fingerprint bits;
  const std::size_t before = allocations();
  while (outcome.pivots < pivots) {
    const bool anew = outcome.solves % 2 == 0;
    for (Target& t : target) {
      if (anew) {
        const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
        t = {{std::cos(angle), std::sin(angle)}, {}, -random.uniform(0.0, 0.5), random.uniform(0.0, 0.5)};
      }
      t.gap_m[0] += random.uniform(-5e-3, 5e-3);
      t.gap_m[1] += random.uniform(-5e-3, 5e-3);
    }
    if (solver->size() > 0 && random.below(8) == 0) solver->pop();
    if (random.below(8) == 0 && solver->size() > 0)
      solver->start_from(random.below(solver->size()), static_cast<contact::State>(random.below(3)));
    while (solver->size() < s && random.below(8) != 0) solver->push(rows[solver->size()]);
    const contact::Solution found = solver->solve({target.data(), solver->size()});
    ++outcome.solves;
    outcome.pivots += found.pivots;
    outcome.most_pivots = std::max(outcome.most_pivots, found.pivots);
    if (found.status != SolverStatus::Ok)
      ++outcome.not_ok;
    else
      outcome.worst_residual_n = std::max(outcome.worst_residual_n, found.residual_n);
    for (std::size_t i = 0; i < solver->size(); ++i) bits.add(solver->contact(i).axial_n);
    if (outcome.solves % 1000 == 0) outcome.drift = std::max(outcome.drift, solver->factor_drift());
  }
  outcome.drift = std::max(outcome.drift, solver->factor_drift());
  outcome.allocations = allocations() - before;
  outcome.fingerprint = bits.value();
  return outcome;
}

TEST(PivotsStress, NothingBuildsUp) {
  const long pivots = counts(500'000, 2'500'000);
  for (const auto& [s, condition] :
       {std::pair{std::size_t{8}, 1e2}, {std::size_t{16}, 1e4}, {std::size_t{24}, 1e6}, {std::size_t{40}, 1e3}}) {
    const Outcome outcome = exchange(s, s, condition, pivots);
    EXPECT_EQ(outcome.not_ok, 0) << s;
    EXPECT_LE(outcome.worst_residual_n, Solver::tolerance_n);
    EXPECT_LE(outcome.most_pivots, Solver::max_pivots);
    EXPECT_LT(outcome.drift, 1e-9);
    EXPECT_EQ(outcome.allocations, 0u);
    RecordProperty("most_pivots_of_" + std::to_string(s), outcome.most_pivots);
  }
}

TEST(PivotsStress, SameInputsGiveTheSameBits) {
  EXPECT_EQ(exchange(7, 20, 1e4, 50'000).fingerprint, exchange(7, 20, 1e4, 50'000).fingerprint);
  EXPECT_NE(exchange(7, 20, 1e4, 50'000).fingerprint, exchange(8, 20, 1e4, 50'000).fingerprint);
}

// Beyond what tissue can be: named when the tolerance is out of reach, never unbounded, never a number that is none.
TEST(PivotsStress, HopelessConditionsAreNamed) {
  reference::Random random(3);
  for (const double condition : {1e9, 1e12, 1e15}) {
    const Outcome outcome = exchange(random.below(1000), 32, condition, counts(20'000, 500'000));
    EXPECT_LE(outcome.most_pivots, Solver::max_pivots);
    EXPECT_LE(outcome.worst_residual_n, Solver::tolerance_n);  // of those called Ok
    EXPECT_LT(outcome.drift, 1e-9);
  }
}

}  // namespace
}  // namespace trocar::stress
