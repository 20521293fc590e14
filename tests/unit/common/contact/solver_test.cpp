// The solver against closed forms and against tests/reference/box_qp.hpp, which shares no code with it.
#include "common/contact/solver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <limits>

#include "problem.hpp"

namespace trocar::contact {
namespace {

using namespace testing;
constexpr double infinity = std::numeric_limits<double>::infinity();

// One contact with compliance g along the shaft: f moves by dx / g until it meets a bound, and the rest of dx is slip.
TEST(Solver, FollowsTheTrescaLoopOfOneContact) {
  constexpr double g = 5e-3;
  constexpr double upper = 0.3;
  constexpr double lower = -0.2;
  const double angle = 0.7;
  const Vector2 t{std::cos(angle), std::sin(angle)};
  Eigen::Matrix2d own;
  own << 1.7 * g, 0.0, 0.0, 1.7 * g;
  const Eigen::Vector2d axis{t[0], t[1]};
  own -= 0.7 * g * axis * axis.transpose();  // g along the shaft, 1.7 g across
  const auto solver = solver_of(own);

  double anchor = 0.0;    // where the contact sits on the needle, relative to the start
  double expected = 0.0;  // axial force by the closed form
  double before = 0.0;    // and its base position
  double dissipated = 0.0;
  const auto move_to = [&](double base) {
    const double trial = expected + (base - before) / g;
    const double clipped = std::clamp(trial, lower, upper);
    const double slip = (trial - clipped) * g;
    expected = clipped;
    before = base;
    const double along = base + anchor;
    const std::array<Target, 1> target{{{t, {along * t[0], along * t[1]}, lower, upper}}};
    const Solution solution = solver->solve(target);
    ASSERT_EQ(solution.status, SolverStatus::Ok);
    const Contact& c = solver->contact(0);
    EXPECT_NEAR(c.axial_n, expected, 1e-12) << base;
    EXPECT_NEAR(c.lateral_n, 0.0, 1e-12) << base;
    const bool slips = c.state != State::Stuck;
    EXPECT_NEAR(slips ? c.slip_m : 0.0, slip, 1e-14) << base;
    if (std::abs(slip) > 1e-12) {
      EXPECT_EQ(c.state, slip > 0.0 ? State::SlipForward : State::SlipBackward) << base;
    }
    if (slips) anchor -= c.slip_m;
    dissipated += c.axial_n * (slips ? c.slip_m : 0.0);
  };
  const auto sweep = [&](double from, double to) {
    constexpr int steps = 37;
    for (int k = 1; k <= steps; ++k) move_to(from + (to - from) * k / steps);
  };
  sweep(0.0, 0.004);  // slips forward after 1.5 mm
  EXPECT_EQ(solver->contact(0).state, State::SlipForward);
  move_to(0.0039);
  EXPECT_EQ(solver->contact(0).state, State::Stuck);
  sweep(0.0039, -0.004);  // sticks for g (upper - lower) = 2.5 mm, then slips back
  EXPECT_EQ(solver->contact(0).state, State::SlipBackward);
  sweep(-0.004, 0.004);
  dissipated = 0.0;
  sweep(0.004, -0.004);
  sweep(-0.004, 0.004);
  // Stroke less the stick range, times the bound, in each direction.
  EXPECT_NEAR(dissipated, (0.008 - g * (upper - lower)) * (upper - lower), 1e-14);
}

TEST(Solver, HoldsLaterallyWithoutBound) {
  constexpr double g = 4e-3;
  const auto solver = solver_of(g * Eigen::Matrix2d::Identity());
  const std::array<Target, 1> target{{{{0.0, 1.0}, {-0.02, 0.0}, -0.1, 0.1}}};
  ASSERT_EQ(solver->solve(target).status, SolverStatus::Ok);
  EXPECT_NEAR(solver->contact(0).lateral_n, 5.0, 1e-12);  // n = (-1, 0)
  EXPECT_NEAR(solver->contact(0).force_n[0], -5.0, 1e-12);
  EXPECT_NEAR(solver->displacement_m(0)[0], -0.02, 1e-15);
}

struct Against {
  std::size_t contacts;
  double condition;
  int problems;
};

void expect_reference(const reference::BoxQp& qp, const reference::Solution& known, const Solver& solver, const Solution& found) {
  ASSERT_TRUE(known.solved) << known.residual_n;
  ASSERT_EQ(found.status, SolverStatus::Ok) << found.residual_n;
  const Eigen::VectorXd f = forces_of(solver);
  EXPECT_LT(reference::residual_n(qp, f), Solver::tolerance_n);
  EXPECT_NEAR(found.residual_n, reference::residual_n(qp, f), 1e-11);
  // How far a force may lie from the solution with that residual grows with the condition; the displacements decide.
  const Eigen::VectorXd u = qp.compliance_m_per_n * (f - known.force_n);
  EXPECT_LT(u.lpNorm<Eigen::Infinity>(), 1e-12);
  for (std::size_t i = 0; i < solver.size(); ++i) {
    const Contact& c = solver.contact(i);
    const reference::Contact& at = qp.contact[i];
    const double rounding = 1e-15 * (1.0 + std::hypot(c.force_n[0], c.force_n[1]));
    EXPECT_NEAR(c.axial_n, at.tangent[0] * c.force_n[0] + at.tangent[1] * c.force_n[1], rounding);
    EXPECT_NEAR(c.lateral_n, -at.tangent[1] * c.force_n[0] + at.tangent[0] * c.force_n[1], rounding);
    switch (c.state) {
      case State::Stuck:
        EXPECT_NEAR(c.slip_m, 0.0, 1e-12);
        EXPECT_GE(c.axial_n, at.lower_n - 1e-10);
        EXPECT_LE(c.axial_n, at.upper_n + 1e-10);
        break;
      case State::SlipForward:
        EXPECT_GE(c.slip_m, -1e-12);
        EXPECT_NEAR(c.axial_n, at.upper_n, 1e-12);
        break;
      case State::SlipBackward:
        EXPECT_LE(c.slip_m, 1e-12);
        EXPECT_NEAR(c.axial_n, at.lower_n, 1e-12);
        break;
    }
  }
}

TEST(Solver, MeetsTheEnumeratedSolutionOfFewContacts) {
  reference::Random random(1);
  for (std::size_t s = 1; s <= 6; ++s) {
    for (const double condition : {1.0, 1e3, 1e6}) {
      for (int k = 0; k < (s <= 4 ? 20 : 3); ++k) {
        const reference::BoxQp qp{reference::random_compliance(random, s, condition), random_contacts(random, s)};
        const auto solver = solver_of(qp.compliance_m_per_n);
        const Solution found = solver->solve(targets_of(qp.contact));
        expect_reference(qp, reference::enumerate(qp), *solver, found);
        if (HasFailure()) FAIL() << s << " contacts, condition " << condition << ", problem " << k;
      }
    }
  }
}

TEST(Solver, MeetsGaussSeidelOnManyContacts) {
  reference::Random random(2);
  for (const auto& [s, condition, problems] : {Against{16, 1e2, 6}, Against{24, 1e3, 4}, Against{40, 1e2, 2}}) {
    for (int k = 0; k < problems; ++k) {
      const reference::BoxQp qp{reference::random_compliance(random, s, condition), random_contacts(random, s)};
      const auto solver = solver_of(qp.compliance_m_per_n);
      const Solution found = solver->solve(targets_of(qp.contact));
      EXPECT_LE(found.pivots, Solver::max_pivots);
      expect_reference(qp, reference::projected_gauss_seidel(qp), *solver, found);
      if (HasFailure()) FAIL() << s << " contacts, problem " << k;
    }
  }
}

// The coupling of neighbours in tissue: every contact slips but for some that a reversal sticks.
TEST(Solver, MeetsGaussSeidelOnALineOfContacts) {
  constexpr std::size_t s = 32;
  reference::BoxQp qp{reference::line_compliance(s, 2.5e-3), std::vector<reference::Contact>(s)};
  reference::Random random(3);
  for (int k = 0; k < 5; ++k) {
    const double turn = random.uniform(-0.1, 0.1);
    for (std::size_t i = 0; i < s; ++i) {
      const double along = random.uniform(-0.01, 0.01);
      qp.contact[i] = {{std::cos(turn), std::sin(turn)}, {along, 0.0025 * static_cast<double>(i) * turn}, -0.085, 0.17};
    }
    const auto solver = solver_of(qp.compliance_m_per_n);
    const Solution found = solver->solve(targets_of(qp.contact));
    expect_reference(qp, reference::projected_gauss_seidel(qp), *solver, found);
  }
}

TEST(Solver, DoesNotDependOnTheStatesThatItStartsFrom) {
  reference::Random random(4);
  for (int k = 0; k < 30; ++k) {
    const std::size_t s = 2 + random.below(30);
    const reference::BoxQp qp{reference::random_compliance(random, s, 1e4), random_contacts(random, s)};
    const std::vector<Target> target = targets_of(qp.contact);
    const auto cold = solver_of(qp.compliance_m_per_n);
    ASSERT_EQ(cold->solve(target).status, SolverStatus::Ok);
    const auto warm = solver_of(qp.compliance_m_per_n);
    for (int again = 0; again < 5; ++again) {
      // Forces of another problem, then states at random.
      (void)warm->solve(targets_of(random_contacts(random, s)));
      for (std::size_t i = 0; i < s; ++i) warm->start_from(i, static_cast<State>(random.below(3)));
      ASSERT_EQ(warm->solve(target).status, SolverStatus::Ok);
      const Eigen::VectorXd u = qp.compliance_m_per_n * (forces_of(*warm) - forces_of(*cold));
      EXPECT_LT(u.lpNorm<Eigen::Infinity>(), 1e-12);
      for (std::size_t i = 0; i < s; ++i) EXPECT_EQ(warm->contact(i).state, cold->contact(i).state) << k << ' ' << i;
    }
  }
}

TEST(Solver, LetsAContactWithoutThresholdsSlipFreely) {
  reference::Random random(5);
  reference::BoxQp qp{reference::random_compliance(random, 5, 1e3), random_contacts(random, 5)};
  for (reference::Contact& c : qp.contact) c.lower_n = c.upper_n = 0.0;
  const auto solver = solver_of(qp.compliance_m_per_n);
  const Solution found = solver->solve(targets_of(qp.contact));
  expect_reference(qp, reference::enumerate(qp), *solver, found);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(solver->contact(i).axial_n, 0.0);
    EXPECT_NE(solver->contact(i).state, State::Stuck);
    EXPECT_EQ(solver->contact(i).state, solver->contact(i).slip_m >= 0.0 ? State::SlipForward : State::SlipBackward);
  }
}

TEST(Solver, GluesContactsWithHugeOrInfiniteThresholds) {
  reference::Random random(6);
  for (const double bound : {1e9, 1e300, infinity}) {
    reference::BoxQp qp{reference::random_compliance(random, 6, 1e3), random_contacts(random, 6)};
    for (reference::Contact& c : qp.contact) {
      c.lower_n = -bound;
      c.upper_n = bound;
    }
    const auto solver = solver_of(qp.compliance_m_per_n);
    ASSERT_EQ(solver->solve(targets_of(qp.contact)).status, SolverStatus::Ok) << bound;
    Eigen::VectorXd gap(12);
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_EQ(solver->contact(i).state, State::Stuck);
      gap(static_cast<Eigen::Index>(2 * i)) = qp.contact[i].gap_m[0];
      gap(static_cast<Eigen::Index>(2 * i + 1)) = qp.contact[i].gap_m[1];
    }
    EXPECT_LT((qp.compliance_m_per_n * forces_of(*solver) - gap).lpNorm<Eigen::Infinity>(), 1e-13);
  }
}

TEST(Solver, TakesThresholdsOnOneSide) {
  reference::Random random(7);
  for (int k = 0; k < 20; ++k) {
    reference::BoxQp qp{reference::random_compliance(random, 5, 1e3), random_contacts(random, 5)};
    for (reference::Contact& c : qp.contact) {
      switch (random.below(4)) {
        case 0:
          c.lower_n = 0.0;
          break;
        case 1:
          c.upper_n = infinity;
          break;
        case 2:
          c.lower_n = -infinity;
          break;
        default:
          c.upper_n = 1e12;
          break;
      }
    }
    const auto solver = solver_of(qp.compliance_m_per_n);
    const Solution found = solver->solve(targets_of(qp.contact));
    expect_reference(qp, reference::enumerate(qp), *solver, found);
    if (HasFailure()) FAIL() << k;
  }
}

TEST(Solver, TakesBoundsThatDoNotIncludeZero) {
  reference::Random random(8);
  for (int k = 0; k < 20; ++k) {
    reference::BoxQp qp{reference::random_compliance(random, 5, 1e3), random_contacts(random, 5)};
    for (reference::Contact& c : qp.contact) {
      c.lower_n = random.uniform(-0.5, 0.5);
      c.upper_n = c.lower_n + (random.below(3) == 0 ? 0.0 : random.uniform(0.0, 0.5));
    }
    const auto solver = solver_of(qp.compliance_m_per_n);
    const Solution found = solver->solve(targets_of(qp.contact));
    expect_reference(qp, reference::enumerate(qp), *solver, found);
    if (HasFailure()) FAIL() << k;
  }
}

// Two contacts a nanometre apart respond alike to a part in 2e8: their sum is well defined, their difference hardly.
TEST(Solver, SolvesContactsANanometreApart) {
  constexpr std::size_t s = 12;
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(2 * s, 2 * s);
  const auto place = [](std::size_t i) { return 0.005 * static_cast<double>(i / 2) + 1e-9 * static_cast<double>(i % 2); };
  for (std::size_t i = 0; i < s; ++i)
    for (std::size_t j = 0; j < s; ++j)
      for (Eigen::Index k = 0; k < 2; ++k)
        g(static_cast<Eigen::Index>(2 * i) + k, static_cast<Eigen::Index>(2 * j) + k) =
            5e-3 * std::exp(-std::abs(place(i) - place(j)) / 0.03);
  reference::BoxQp qp{g, std::vector<reference::Contact>(s)};
  for (const double turn : {0.0, 0.03}) {
    for (std::size_t i = 0; i < s; ++i) {
      const double at = place(i);
      qp.contact[i] = {{std::cos(turn), std::sin(turn)}, {2e-3 - 0.01 * at, at * turn}, -0.1, 0.1 + 0.01 * static_cast<double>(i % 2)};
    }
    const auto solver = solver_of(g);
    const Solution found = solver->solve(targets_of(qp.contact));
    EXPECT_EQ(found.status, SolverStatus::Ok) << found.residual_n;
    EXPECT_LT(reference::residual_n(qp, forces_of(*solver)), Solver::tolerance_n);
  }
}

}  // namespace
}  // namespace trocar::contact
