// The comparison partner has to be right as well, or beating it means nothing.
#include "tests/benchmarks/partner/thesis_contact.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <memory>
#include <numbers>
#include <vector>

#include "tests/reference/random_tissue.hpp"
#include "tests/reference/rigid_needle.hpp"

namespace trocar::partner {
namespace {

using reference::BoxQp;
using reference::Pose;
using reference::Random;
using reference::RigidNeedle;

std::vector<Eigen::Matrix2d> row_of(const Eigen::MatrixXd& g, std::size_t contact) {
  std::vector<Eigen::Matrix2d> row;
  for (std::size_t j = 0; j <= contact; ++j)
    row.emplace_back(g.block<2, 2>(static_cast<Eigen::Index>(2 * contact), static_cast<Eigen::Index>(2 * j)));
  return row;
}

Eigen::MatrixXd leading(const Eigen::MatrixXd& g, std::size_t contacts) {
  const auto m = static_cast<Eigen::Index>(2 * contacts);
  return g.topLeftCorner(m, m);
}

Target random_target(Random& random) {
  const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
  return {{std::cos(angle), std::sin(angle)},
          {random.uniform(-1e-3, 1e-3), random.uniform(-1e-3, 1e-3)},
          -random.uniform(0.0, 0.3),
          random.uniform(0.0, 0.3)};
}

std::vector<State> states(const ThesisContact& thesis) {
  std::vector<State> state;
  for (std::size_t i = 0; i < thesis.size(); ++i) state.push_back(thesis.state(i));
  return state;
}

Eigen::VectorXd forces(const ThesisContact& thesis) {
  Eigen::VectorXd f(static_cast<Eigen::Index>(2 * thesis.size()));
  for (std::size_t i = 0; i < thesis.size(); ++i) f.segment<2>(static_cast<Eigen::Index>(2 * i)) = thesis.force_n(i);
  return f;
}

Eigen::VectorXd displacements(const ThesisContact& thesis) {
  Eigen::VectorXd u(static_cast<Eigen::Index>(2 * thesis.size()));
  for (std::size_t i = 0; i < thesis.size(); ++i) u.segment<2>(static_cast<Eigen::Index>(2 * i)) = thesis.displacement_m(i);
  return u;
}

double relative(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  return (a - b).lpNorm<Eigen::Infinity>() / (1e-3 + b.lpNorm<Eigen::Infinity>());
}

// Contacts join and leave, every frame turns, states change by the automaton and by force: the forces are always those of a dense solve
// with the states of the moment.
TEST(ThesisContact, ForcesAreThoseOfADenseSolveWithTheSameStates) {
  Random random(1);
  int transitions = 0, slipping = 0;
  for (const std::size_t most : {1U, 2U, 3U, 8U, 17U, 32U}) {
    const Eigen::MatrixXd g = reference::random_compliance(random, most, 100.0);
    const auto thesis = std::make_unique<ThesisContact>();
    std::vector<Target> target;
    for (int tick = 0; tick < 60; ++tick) {
      for (Target& t : target) t = random_target(random);
      if (target.size() < most && random.uniform(0.0, 1.0) < 0.6) {
        target.push_back(random_target(random));
        ASSERT_TRUE(thesis->append(row_of(g, thesis->size()), target.back()));
      } else if (!target.empty() && random.uniform(0.0, 1.0) < 0.2) {
        target.pop_back();
        thesis->pop();
      }
      if (!target.empty() && tick % 5 == 0) thesis->force_state(random.below(target.size()), static_cast<State>(random.below(3)));
      transitions += thesis->solve(target).transitions;
      const BoxQp qp{leading(g, target.size()), target};
      const Eigen::VectorXd exact = reference::solve_with_states(qp, states(*thesis)).force_n;
      if (target.empty()) continue;
      ASSERT_LT(relative(forces(*thesis), exact), 1e-9) << most << " contacts, tick " << tick;
      ASSERT_LT(relative(displacements(*thesis), qp.compliance_m_per_n * exact), 1e-9) << most << " contacts, tick " << tick;
      for (const State state : states(*thesis)) slipping += state == State::Stuck ? 0 : 1;
    }
  }
  EXPECT_GT(transitions, 100);
  EXPECT_GT(slipping, 1000);
}

// The print's factors p - 1 for row and column both give 2 - 1/p on the diagonal instead of 1/p.
TEST(ThesisContact, OneSwapIsThePrincipalPivot) {
  const Eigen::Matrix2d g{{2e-3, 5e-4}, {5e-4, 3e-3}};
  const auto thesis = std::make_unique<ThesisContact>();
  const Target target{{1.0, 0.0}, {1e-3, -2e-3}, -10.0, 10.0};
  ASSERT_TRUE(thesis->append(std::vector{g}, target));
  thesis->solve(std::vector{target});
  EXPECT_LT((thesis->force_n(0) - g.inverse() * Eigen::Vector2d(1e-3, -2e-3)).norm(), 1e-13);
}

struct Insertion {
  static constexpr std::size_t contacts = 16;
  Eigen::MatrixXd g{reference::line_compliance(contacts, 0.005)};
  std::unique_ptr<ThesisContact> thesis{std::make_unique<ThesisContact>()};
  RigidNeedle needle{}, exact_needle{};
  reference::Solution exact{};

  Insertion() {
    for (std::size_t i = 0; i < contacts; ++i) {
      for (RigidNeedle* each : {&needle, &exact_needle})
        each->add({0.005 * static_cast<double>(i), 0.0}, {-0.02, 0.0, 0.0}, -0.17, i + 1 == contacts ? 0.34 : 0.17);
      EXPECT_TRUE(thesis->append(row_of(g, i), needle.target().back()));
    }
  }
  // Returns the largest difference of the axial forces, in N.
  double tick(const Pose& pose) {
    exact = reference::projected_gauss_seidel({g, exact_needle.move_to(pose)});
    EXPECT_TRUE(exact.solved);
    const Eigen::VectorXd u = g * exact.force_n;
    for (std::size_t i = 0; i < contacts; ++i) {
      const Target& t = exact_needle.target()[i];
      const auto k = static_cast<Eigen::Index>(2 * i);
      if (exact.state[i] != State::Stuck)
        exact_needle.slipped(i, t.tangent[0] * (t.gap_m[0] - u(k)) + t.tangent[1] * (t.gap_m[1] - u(k + 1)));
    }
    thesis->solve(needle.move_to(pose));
    for (std::size_t i = 0; i < contacts; ++i) needle.slipped(i, thesis->slip_m(i));
    return (forces(*thesis) - exact.force_n).lpNorm<Eigen::Infinity>();
  }
};

// While the needle advances, the automaton is a transition behind; where it rests, it arrives at the exact states and forces.
TEST(ThesisContact, MonotoneInsertionArrivesAtTheExactStates) {
  Insertion run;
  double worst = 0.0;
  for (int k = 1; k <= 20; ++k) worst = std::max(worst, run.tick({-0.02 + 4e-4 * k, 0.0, 0.0}));
  EXPECT_GT(worst, 0.01);  // N: what one transition a tick costs in accuracy
  const Pose rest{-0.02 + 8e-3, 0.0, 0.0};
  for (int k = 0; k < 20; ++k) run.tick(rest);
  EXPECT_LT(run.tick(rest), 1e-9);
  // At rest a slipping contact is as well a stuck one with its threshold as force: only where the force lies inside is the state unique.
  std::size_t inside = 0;
  for (std::size_t i = 0; i < Insertion::contacts; ++i)
    if (run.exact.force_n(static_cast<Eigen::Index>(2 * i)) < run.needle.target()[i].upper_n - 1e-6) {
      EXPECT_EQ(run.thesis->state(i), State::Stuck) << i;
      ++inside;
    }
  EXPECT_GT(inside, 0U);
  EXPECT_LT(inside, Insertion::contacts);
}

TEST(ThesisContact, ReversalUnloadsThroughStickAndSlipsBack) {
  Insertion run;
  for (int k = 1; k <= 100; ++k) run.tick({-0.02 + 3e-4 * k, 0.0, 0.0});
  EXPECT_EQ(states(*run.thesis), std::vector(Insertion::contacts, State::Upper));
  run.tick({-0.02 + 29.9e-3, 0.0, 0.0});
  run.tick({-0.02 + 29.8e-3, 0.0, 0.0});
  EXPECT_EQ(states(*run.thesis), std::vector(Insertion::contacts, State::Stuck));
  for (int k = 98; k >= 0; --k) run.tick({-0.02 + 3e-4 * k, 0.0, 0.0});
  EXPECT_EQ(states(*run.thesis), std::vector(Insertion::contacts, State::Lower));
}

TEST(ThesisContact, RefusesMoreThanItsCapacity) {
  const auto thesis = std::make_unique<ThesisContact>();
  const Eigen::MatrixXd g = reference::line_compliance(capacity::contacts, 0.002);
  for (std::size_t i = 0; i < capacity::contacts; ++i) ASSERT_TRUE(thesis->append(row_of(g, i), Target{{1.0, 0.0}, {}, -1.0, 1.0}));
  EXPECT_FALSE(thesis->append(std::vector<Eigen::Matrix2d>(capacity::contacts + 1), Target{}));
  EXPECT_EQ(thesis->size(), capacity::contacts);
}

}  // namespace
}  // namespace trocar::partner
