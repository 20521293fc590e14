// The solver over many changes: contacts come, go and change; what it keeps between ticks must never show.
#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "problem.hpp"

namespace trocar::contact {
namespace {

using namespace testing;
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double denormal = std::numeric_limits<double>::denorm_min();

Eigen::MatrixXd leading(const Eigen::MatrixXd& g, std::size_t contacts) {
  const auto n = static_cast<Eigen::Index>(2 * contacts);
  return g.topLeftCorner(n, n);
}

TEST(SolverSequence, ContactsComeAndGoAndChange) {
  constexpr std::size_t most = 24;
  reference::Random random(11);
  Eigen::MatrixXd g = reference::random_compliance(random, most, 1e4);
  auto solver = std::make_unique<Solver>();
  std::vector<reference::Contact> contact = random_contacts(random, most);
  for (int step = 0; step < 3000; ++step) {
    const std::size_t s = solver->size();
    switch (random.below(6)) {
      case 0:
      case 1:
        if (s < most) solver->push(row_of(g, s));
        break;
      case 2:
        if (s > 0) solver->pop();
        break;
      case 3: {  // another tissue, told row by row
        if (random.below(20) != 0) break;
        g = reference::random_compliance(random, most, 1e4);
        for (std::size_t i = 0; i < s; ++i) solver->replace(i, row_of(g, i));
        break;
      }
      case 4: {  // a tie grows softer
        if (s == 0) break;
        const std::size_t i = random.below(s);
        const auto at = static_cast<Eigen::Index>(2 * i);
        g.block<2, 2>(at, at) += 1e-4 * Eigen::Matrix2d::Identity();
        solver->replace_own(i, block_of(g, i, i));
        break;
      }
      default:
        if (random.below(50) == 0) solver->clear();
    }
    for (reference::Contact& c : contact) {
      c.gap_m[0] += random.uniform(-1e-4, 1e-4);
      c.gap_m[1] += random.uniform(-1e-4, 1e-4);
    }
    if (random.below(4) == 0) contact = random_contacts(random, most);
    const reference::BoxQp qp{leading(g, solver->size()), {contact.begin(), contact.begin() + static_cast<std::ptrdiff_t>(solver->size())}};
    const Solution found = solver->solve(targets_of(qp.contact));
    ASSERT_EQ(found.status, SolverStatus::Ok) << step << ' ' << found.residual_n;
    if (solver->size() > 0) {
      ASSERT_LT(reference::residual_n(qp, forces_of(*solver)), Solver::tolerance_n) << step;
    }
    for (std::size_t i = 0; i < solver->size(); ++i)
      for (std::size_t j = 0; j <= i; ++j) ASSERT_EQ(solver->compliance(i, j), block_of(g, i, j));
  }
}

TEST(SolverSequence, StartsANewContactForceFree) {
  reference::Random random(12);
  const Eigen::MatrixXd g = reference::random_compliance(random, 4, 1e2);
  const auto solver = solver_of(leading(g, 3));
  ASSERT_EQ(solver->solve(targets_of(random_contacts(random, 3))).status, SolverStatus::Ok);
  solver->push(row_of(g, 3));
  EXPECT_EQ(solver->contact(3).force_n, (Vector2{}));
  EXPECT_EQ(solver->contact(3).state, State::SlipForward);
  // With a threshold of zero its neighbours do not notice it.
  solver->pop();
  std::vector<reference::Contact> contact = random_contacts(random, 4);
  contact[3].lower_n = contact[3].upper_n = 0.0;
  const std::vector<Target> target = targets_of(contact);
  ASSERT_EQ(solver->solve({target.data(), 3}).status, SolverStatus::Ok);
  const Eigen::VectorXd three = forces_of(*solver);
  solver->push(row_of(g, 3));
  std::vector<Target> free = target;
  const Vector2 u{(g.middleRows(6, 1).leftCols(6) * three)(0), (g.middleRows(7, 1).leftCols(6) * three)(0)};
  free[3].gap_m = u;  // it lies on the needle where it is
  ASSERT_EQ(solver->solve(free).status, SolverStatus::Ok);
  EXPECT_LT((forces_of(*solver).head(6) - three).lpNorm<Eigen::Infinity>(), 1e-11);
}

TEST(SolverSequence, KeepsForcesWhenNothingChanges) {
  reference::Random random(13);
  const std::size_t s = 20;
  const auto solver = solver_of(reference::random_compliance(random, s, 1e2));
  const std::vector<Target> target = targets_of(random_contacts(random, s));
  for (int k = 0; k < 3; ++k) (void)solver->solve(target);  // rounding has settled
  const std::vector<double> before = bits_of(*solver);
  const Solution again = solver->solve(target);
  EXPECT_EQ(again.pivots, 0);
  EXPECT_EQ(again.rows_factored, 0);
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(bits_of(*solver)[i], before[i], 1e-13);
}

TEST(SolverSequence, SameInputsGiveTheSameBits) {
  const auto run = [] {
    reference::Random random(14);
    const std::size_t s = 30;
    const auto solver = solver_of(reference::random_compliance(random, s, 1e4));
    for (int k = 0; k < 50; ++k) (void)solver->solve(targets_of(random_contacts(random, s)));
    return bits_of(*solver);
  };
  EXPECT_EQ(run(), run());
}

TEST(SolverSequence, ForgettingTheFactorChangesNoBit) {
  reference::Random random(15);
  const std::size_t s = 30;
  const Eigen::MatrixXd g = reference::random_compliance(random, s, 1e5);
  const auto keeps = solver_of(g);
  const auto forgets = solver_of(g);
  std::vector<reference::Contact> contact = random_contacts(random, s);
  int kept_rows = 0;
  int forgotten_rows = 0;
  for (int k = 0; k < 300; ++k) {
    const double turn = k % 10 == 0 ? random.uniform(-0.01, 0.01) : 0.0;
    for (reference::Contact& c : contact) {
      c.gap_m[0] += random.uniform(-1e-4, 1e-4);
      if (turn != 0.0) c.tangent = {std::cos(turn), std::sin(turn)};
    }
    // And single ones, as a contact that is new has another frame than those that were there.
    if (k % 7 == 6) contact[random.below(s)].tangent = {std::cos(0.02), std::sin(0.02)};
    if (k % 37 == 36) {  // another history: the contact goes and comes back
      for (Solver* solver : {keeps.get(), forgets.get()}) {
        solver->pop();
        solver->push(row_of(g, s - 1));
      }
    }
    forgets->forget_factor();
    kept_rows += keeps->solve(targets_of(contact)).rows_factored;
    forgotten_rows += forgets->solve(targets_of(contact)).rows_factored;
    ASSERT_EQ(bits_of(*keeps), bits_of(*forgets)) << k;
  }
  EXPECT_LT(kept_rows, forgotten_rows);  // the comparison compares something
}

// To and fro along one direction, at uneven speed, with bounds that some contacts reach: mostly the last correction is repeated, and what
// it finds is what a solve finds.
TEST(SolverSequence, RepeatingTheCorrectionChangesRoundingAlone) {
  reference::Random random(24);
  const std::size_t s = 30;
  const Eigen::MatrixXd g = reference::random_compliance(random, s, 1e4);
  const auto repeats = solver_of(g);
  const auto solves = solver_of(g);
  std::vector<reference::Contact> contact = random_contacts(random, s);
  std::vector<std::array<double, 2>> way(s);
  for (std::size_t i = 0; i < s; ++i) way[i] = {random.uniform(-1e-4, 1e-4), random.uniform(-1e-4, 1e-4)};
  int repeated = 0, exchanged = 0;
  double last = 0.0;
  for (int k = 1; k <= 2000; ++k) {
    const double now = 3.0 * std::sin(k / 150.0);
    for (std::size_t i = 0; i < s; ++i)
      for (std::size_t c = 0; c < 2; ++c) contact[i].gap_m[c] += (now - last) * way[i][c];
    last = now;
    solves->forget_correction();
    const Solution a = repeats->solve(targets_of(contact)), b = solves->solve(targets_of(contact));
    repeated += a.repeated ? 1 : 0;
    exchanged += a.pivots;
    ASSERT_FALSE(b.repeated);
    ASSERT_EQ(a.status, SolverStatus::Ok);
    ASSERT_LE(a.residual_n, 1e-10);
    double largest = 0.0, apart = 0.0, off = 0.0;
    for (std::size_t i = 0; i < s; ++i) {
      ASSERT_EQ(repeats->contact(i).state, solves->contact(i).state) << k;
      for (std::size_t c = 0; c < 2; ++c) {
        largest = std::max(largest, std::abs(solves->contact(i).force_n[c]));
        apart = std::max(apart, std::abs(repeats->contact(i).force_n[c] - solves->contact(i).force_n[c]));
        // The displacements that it carries along are those of its forces.
        double u = 0.0;
        for (std::size_t j = 0; j < s; ++j)
          for (std::size_t d = 0; d < 2; ++d)
            u += g(static_cast<Eigen::Index>(2 * i + c), static_cast<Eigen::Index>(2 * j + d)) * repeats->contact(j).force_n[d];
        off = std::max(off, std::abs(u - repeats->displacement_m(i)[c]));
      }
    }
    ASSERT_LE(apart, 1e-9 * largest) << k;
    ASSERT_LE(off, 1e-14) << k;
  }
  EXPECT_GT(repeated, 1000);
  EXPECT_GT(exchanged, 20);
}

// Rows of L depend on G and the order alone: a solver that went another way to the same order has the same bits.
TEST(SolverSequence, HistoryDoesNotShow) {
  reference::Random random(16);
  const std::size_t s = 16;
  const Eigen::MatrixXd g = reference::random_compliance(random, s, 1e5);
  const std::vector<Target> target = targets_of(random_contacts(random, s));
  const auto fresh = solver_of(g);
  const auto used = solver_of(g);
  for (int k = 0; k < 40; ++k) (void)used->solve(targets_of(random_contacts(random, s)));
  while (used->size() > 0) used->pop();
  push_all(*used, g);
  const Solution a = fresh->solve(target);
  const Solution b = used->solve(target);
  EXPECT_EQ(a.pivots, b.pivots);
  EXPECT_EQ(bits_of(*fresh), bits_of(*used));
  const auto cleared = solver_of(g);
  for (int k = 0; k < 40; ++k) (void)cleared->solve(targets_of(random_contacts(random, s)));
  cleared->clear();
  push_all(*cleared, g);
  (void)cleared->solve(target);
  EXPECT_EQ(bits_of(*fresh), bits_of(*cleared));
}

TEST(SolverSequence, TheFactorDoesNotDrift) {
  reference::Random random(17);
  const std::size_t s = 24;
  const auto solver = solver_of(reference::random_compliance(random, s, 1e6));
  long pivots = 0;
  for (int k = 0; k < 2000; ++k) pivots += solver->solve(targets_of(random_contacts(random, s))).pivots;
  EXPECT_GT(pivots, 20'000);
  EXPECT_EQ(solver->factor_drift(), 0.0);
}

TEST(SolverSequence, RefusesWhatIsNoNumberAndChangesNothing) {
  reference::Random random(18);
  const std::size_t s = 6;
  const auto solver = solver_of(reference::random_compliance(random, s, 1e3));
  const std::vector<Target> good = targets_of(random_contacts(random, s));
  ASSERT_EQ(solver->solve(good).status, SolverStatus::Ok);
  const std::vector<double> before = bits_of(*solver);
  const auto refused = [&](auto&& spoil) {
    for (const std::size_t i : {std::size_t{0}, s - 1}) {
      std::vector<Target> bad = targets_of(random_contacts(random, s));
      spoil(bad[i]);
      EXPECT_EQ(solver->solve(bad).status, SolverStatus::NotFinite);
      EXPECT_EQ(bits_of(*solver), before);
    }
  };
  for (const double bad : {nan, infinity, -infinity}) {
    for (std::size_t k = 0; k < 2; ++k) {
      refused([&](Target& t) { t.gap_m[k] = bad; });
      refused([&](Target& t) { t.tangent[k] = bad; });
    }
  }
  refused([](Target& t) { t.lower_n = nan; });
  refused([](Target& t) { t.upper_n = nan; });
  refused([](Target& t) { t.lower_n = t.upper_n + 1e-3; });
  // A force that must be infinite.
  refused([](Target& t) { t.lower_n = t.upper_n = infinity; });
  refused([](Target& t) { t.lower_n = t.upper_n = -infinity; });
  // And the next good tick is as if nothing had been.
  const auto untouched = solver_of(leading(reference::random_compliance(*std::make_unique<reference::Random>(18), s, 1e3), s));
  ASSERT_EQ(untouched->solve(good).status, SolverStatus::Ok);
  (void)untouched->solve(good);
  (void)solver->solve(good);
  EXPECT_EQ(bits_of(*solver), bits_of(*untouched));
}

TEST(SolverSequence, TakesDenormalInputsForTheZerosThatTheyAre) {
  reference::Random random(19);
  const std::size_t s = 5;
  const auto solver = solver_of(reference::random_compliance(random, s, 1e3));
  std::vector<Target> target(s);
  for (Target& t : target) t = {{1.0, denormal}, {denormal, -denormal}, -denormal, denormal};
  const Solution found = solver->solve(target);
  EXPECT_EQ(found.status, SolverStatus::Ok);
  for (std::size_t i = 0; i < s; ++i)
    for (const double f : solver->contact(i).force_n) EXPECT_LT(std::abs(f), 1e-300);
}

// Gaps beyond all sense overflow on the way: named, finite, and gone with the next sensible tick.
TEST(SolverSequence, RecoversFromGapsThatOverflow) {
  reference::Random random(20);
  const std::size_t s = 8;
  const reference::BoxQp qp{reference::random_compliance(random, s, 1e3), random_contacts(random, s)};
  const auto solver = solver_of(qp.compliance_m_per_n);
  for (const double huge : {1e10, 1e100, 1e300, std::numeric_limits<double>::max()}) {
    std::vector<Target> target = targets_of(qp.contact);
    for (Target& t : target) t.gap_m = {huge, -huge};
    const Solution found = solver->solve(target);
    EXPECT_NE(found.status, SolverStatus::Ok) << huge;
    for (std::size_t i = 0; i < s; ++i)
      for (const double f : solver->contact(i).force_n) EXPECT_TRUE(std::isfinite(f)) << huge;
    const Solution next = solver->solve(targets_of(qp.contact));
    EXPECT_EQ(next.status, SolverStatus::Ok) << huge;
    EXPECT_LT(reference::residual_n(qp, forces_of(*solver)), Solver::tolerance_n) << huge;
  }
}

// No order along the shaft, states at random, every place taken: as hard as it gets.
TEST(SolverSequence, NeverExceedsTheBoundOnPivots) {
  reference::Random random(21);
  const std::size_t s = Solver::capacity;
  int most = 0;
  for (int k = 0; k < 60; ++k) {
    const double condition = std::pow(10.0, random.uniform(0.0, 9.0));
    const reference::BoxQp qp{reference::random_compliance(random, s, condition), random_contacts(random, s)};
    const auto solver = solver_of(qp.compliance_m_per_n);
    for (std::size_t i = 0; i < s; ++i) solver->start_from(i, static_cast<State>(random.below(3)));
    const Solution found = solver->solve(targets_of(qp.contact));
    most = std::max(most, found.pivots);
    EXPECT_LE(found.pivots, Solver::max_pivots);
    EXPECT_LE(found.iterations, Solver::max_iterations);
    const double residual_n = reference::residual_n(qp, forces_of(*solver));
    if (found.status == SolverStatus::Ok) {
      EXPECT_LT(residual_n, Solver::tolerance_n);
    } else {
      // Out of pivots is a named result, and one for problems that no tissue poses.
      EXPECT_EQ(found.status, SolverStatus::PivotLimit) << condition;
      EXPECT_GT(condition, 1e6);
      EXPECT_NEAR(found.residual_n, residual_n, 1e-3 * residual_n);
      for (std::size_t i = 0; i < s; ++i) {
        EXPECT_GE(solver->contact(i).axial_n, qp.contact[i].lower_n);
        EXPECT_LE(solver->contact(i).axial_n, qp.contact[i].upper_n);
      }
    }
  }
  EXPECT_GT(most, static_cast<int>(Solver::capacity));
}

}  // namespace
}  // namespace trocar::contact
