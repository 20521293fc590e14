#include "tests/reference/box_qp.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/reference/random_tissue.hpp"

namespace trocar::reference {
namespace {

BoxQp random_problem(Random& random, std::size_t contacts, double condition) {
  BoxQp qp{random_compliance(random, contacts, condition), {}};
  for (std::size_t i = 0; i < contacts; ++i) {
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    qp.contact.push_back({{std::cos(angle), std::sin(angle)},
                          {random.uniform(-1e-3, 1e-3), random.uniform(-1e-3, 1e-3)},
                          -random.uniform(0.0, 0.3),
                          random.uniform(0.0, 0.3)});
  }
  return qp;
}

// One contact in closed form: stuck force d/g while it fits between the thresholds, the threshold itself beyond; lateral d/g always.
TEST(BoxQp, OneContactFollowsItsClosedForm) {
  const double g = 2e-3;
  for (const double gap : {-1e-3, -2e-4, 0.0, 1e-4, 5e-4}) {
    BoxQp qp{g * Eigen::Matrix2d::Identity(), {{{0.6, 0.8}, {}, -0.12, 0.2}}};
    const double lateral_gap = 3e-4;
    qp.contact[0].gap_m = {0.6 * gap - 0.8 * lateral_gap, 0.8 * gap + 0.6 * lateral_gap};
    for (const Solution& found : {enumerate(qp), projected_gauss_seidel(qp)}) {
      ASSERT_TRUE(found.solved);
      EXPECT_NEAR(0.6 * found.force_n(0) + 0.8 * found.force_n(1), std::clamp(gap / g, -0.12, 0.2), 1e-14);
      EXPECT_NEAR(-0.8 * found.force_n(0) + 0.6 * found.force_n(1), lateral_gap / g, 1e-14);
    }
  }
}

TEST(BoxQp, GaussSeidelFindsTheEnumeratedSolution) {
  Random random(1);
  std::size_t slipping = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const BoxQp qp = random_problem(random, 1 + random.below(5), trial % 2 == 0 ? 10.0 : 1e5);
    const Solution all = enumerate(qp);
    const Solution swept = projected_gauss_seidel(qp);
    ASSERT_TRUE(all.solved && swept.solved) << trial;
    EXPECT_LT((all.force_n - swept.force_n).lpNorm<Eigen::Infinity>(), 1e-9 * (1.0 + all.force_n.lpNorm<Eigen::Infinity>()));
    for (const Axial state : swept.state) slipping += state == Axial::Stuck ? 0 : 1;
  }
  EXPECT_GT(slipping, 20U);  // else nothing but linear algebra was tried
}

TEST(BoxQp, ManyContactsMeetTheConditions) {
  Random random(2);
  for (const std::size_t contacts : {16U, 64U}) {
    const Solution found = projected_gauss_seidel(random_problem(random, contacts, 1e6));
    EXPECT_TRUE(found.solved) << contacts << " contacts, residual " << found.residual_n << " N";
  }
}

// The energy 1/2 f.G f - d.f of the solution is below that of every admissible neighbour: a property that no part of the solver uses.
TEST(BoxQp, SolutionHasTheLeastEnergy) {
  Random random(3);
  const BoxQp qp = random_problem(random, 4, 100.0);
  Eigen::VectorXd d(8);
  for (std::size_t i = 0; i < 4; ++i) d.segment<2>(static_cast<Eigen::Index>(2 * i)) << qp.contact[i].gap_m[0], qp.contact[i].gap_m[1];
  const auto energy = [&](const Eigen::VectorXd& f) { return 0.5 * f.dot(qp.compliance_m_per_n * f) - d.dot(f); };
  const Eigen::VectorXd f = projected_gauss_seidel(qp).force_n;
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::VectorXd other = f;
    for (std::size_t i = 0; i < 4; ++i) {
      const Eigen::Vector2d t(qp.contact[i].tangent[0], qp.contact[i].tangent[1]), n(-t.y(), t.x());
      auto part = other.segment<2>(static_cast<Eigen::Index>(2 * i));
      const double axial = std::clamp(t.dot(part) + random.uniform(-0.05, 0.05), qp.contact[i].lower_n, qp.contact[i].upper_n);
      part = axial * t + (n.dot(part) + random.uniform(-0.05, 0.05)) * n;
    }
    EXPECT_GE(energy(other), energy(f));
  }
}

TEST(BoxQp, ResidualIsTheErrorOfAWrongForce) {
  BoxQp qp{Eigen::Matrix2d{{2e-3, 0.0}, {0.0, 4e-3}}, {{{1.0, 0.0}, {1e-4, 2e-4}, -1.0, 1.0}}};
  EXPECT_NEAR(residual_n(qp, Eigen::Vector2d(0.05, 0.05)), 0.0, 1e-15);
  EXPECT_NEAR(residual_n(qp, Eigen::Vector2d(0.15, 0.05)), 0.10, 1e-15);  // axial: G_tt scales the gap to newtons
  EXPECT_NEAR(residual_n(qp, Eigen::Vector2d(0.05, -0.15)), 0.20, 1e-15);
  qp.contact[0].upper_n = 0.02;
  EXPECT_NEAR(residual_n(qp, Eigen::Vector2d(0.05, 0.05)), 0.03, 1e-15);  // beyond its threshold
}

TEST(BoxQp, ZeroAndInfiniteThresholdsAreOrdinary) {
  Random random(4);
  BoxQp qp = random_problem(random, 3, 50.0);
  constexpr double infinite = std::numeric_limits<double>::infinity();
  qp.contact[0].lower_n = qp.contact[0].upper_n = 0.0;
  qp.contact[1].lower_n = -infinite;
  qp.contact[1].upper_n = infinite;
  const Solution all = enumerate(qp);
  const Solution swept = projected_gauss_seidel(qp);
  ASSERT_TRUE(all.solved && swept.solved);
  EXPECT_LT((all.force_n - swept.force_n).norm(), 1e-11);
  EXPECT_NEAR(qp.contact[0].tangent[0] * all.force_n(0) + qp.contact[0].tangent[1] * all.force_n(1), 0.0, 1e-15);
}

TEST(BoxQp, GivenStatesThatAreWrongShowInTheResidual) {
  BoxQp qp{2e-3 * Eigen::Matrix2d::Identity(), {{{1.0, 0.0}, {1e-3, 0.0}, -0.1, 0.1}}};
  EXPECT_TRUE(solve_with_states(qp, {Axial::Upper}).solved);
  EXPECT_NEAR(solve_with_states(qp, {Axial::Stuck}).residual_n, 0.4, 1e-14);  // 0.5 N where 0.1 N is the most
  EXPECT_NEAR(solve_with_states(qp, {Axial::Lower}).residual_n, 0.2, 1e-14);
}

TEST(BoxQp, RefusesSizesThatDoNotFit) {
  const BoxQp qp{Eigen::Matrix2d::Identity(), {Contact{}, Contact{}}};
  EXPECT_THROW(static_cast<void>(projected_gauss_seidel(qp)), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(enumerate({Eigen::MatrixXd::Identity(18, 18), std::vector<Contact>(9)})), std::invalid_argument);
}

}  // namespace
}  // namespace trocar::reference
