#include "sim_plant/phantom/contact_problem.hpp"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <random>

namespace trocar::sim_plant {
namespace {

constexpr double scale = 1e-3;  // m/N, as in tissue

// Random symmetric positive definite compliance with neighbours that hang together, as along a needle.
Eigen::MatrixXd compliance(std::size_t contacts, std::mt19937& random) {
  std::normal_distribution<double> normal;
  const auto n = static_cast<Eigen::Index>(2 * contacts);
  Eigen::MatrixXd a(n, n);
  for (Eigen::Index i = 0; i < n; ++i)
    for (Eigen::Index j = 0; j < n; ++j) a(i, j) = normal(random) * std::exp(-0.3 * std::abs(static_cast<double>(i - j)));
  return scale * (a * a.transpose() / static_cast<double>(n) + 0.02 * Eigen::MatrixXd::Identity(n, n));
}

ContactProblem problem_of(const Eigen::MatrixXd& g) {
  const auto contacts = static_cast<std::size_t>(g.rows() / 2);
  ContactProblem problem(contacts);
  std::vector<Block> row(contacts);
  for (std::size_t i = 0; i < contacts; ++i) {
    for (std::size_t j = 0; j <= i; ++j) {
      const auto a = static_cast<Eigen::Index>(2 * i);
      const auto b = static_cast<Eigen::Index>(2 * j);
      row[j] = {g(a, b), g(a, b + 1), g(a + 1, b), g(a + 1, b + 1)};
    }
    problem.push({row.data(), i + 1});
  }
  return problem;
}

// What push() stores: the regularisation is part of the problem that is solved.
Eigen::MatrixXd stored(Eigen::MatrixXd g) {
  for (Eigen::Index i = 0; i < g.rows(); i += 2) {
    const double extra = 1e-6 * (g(i, i) + g(i + 1, i + 1));
    g(i, i) += extra;
    g(i + 1, i + 1) += extra;
  }
  return g;
}

// An independent way to the same solution: projected Gauss-Seidel on the local unknowns, run until it stands.
Eigen::VectorXd gauss_seidel(const Eigen::MatrixXd& g, double angle, const std::vector<ContactInput>& input) {
  Eigen::MatrixXd rotation = Eigen::MatrixXd::Zero(g.rows(), g.cols());
  Eigen::Matrix2d r;
  r << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  for (Eigen::Index i = 0; i < g.rows(); i += 2) rotation.block<2, 2>(i, i) = r;
  Eigen::MatrixXd local = rotation.transpose() * g * rotation;
  for (std::size_t i = 0; i < input.size(); ++i)
    local(static_cast<Eigen::Index>(2 * i + 1), static_cast<Eigen::Index>(2 * i + 1)) += input[i].softness;
  Eigen::VectorXd f = Eigen::VectorXd::Zero(g.rows());
  for (int sweep = 0; sweep < 200000; ++sweep) {
    double change = 0.0;
    for (std::size_t i = 0; i < input.size(); ++i)
      for (std::size_t k = 0; k < 2; ++k) {
        const auto row = static_cast<Eigen::Index>(2 * i + k);
        const double wanted = k == 0 ? input[i].axial_m : input[i].lateral_m;
        double next = f(row) + (wanted - local.row(row).dot(f)) / local(row, row);
        if (k == 0) next = std::clamp(next, input[i].lower_n, input[i].upper_n);
        change = std::max(change, std::abs(next - f(row)));
        f(row) = next;
      }
    if (change < 1e-14) break;
  }
  return f;
}

TEST(ContactProblem, OneContactFollowsItsClosedForm) {
  ContactProblem problem(1);
  const Block own{2 * scale, 0.0, 0.0, scale};
  problem.push({&own, 1});
  const double g = 2 * scale + 1e-6 * 3 * scale;
  double place = 0.0;  // where on the needle the contact stands, minus where it began
  double dissipated = 0.0;
  double needle = 0.0;
  double force = 0.0;
  // forward past the threshold, back past the other one, and closed again
  for (const double target : {0.003, -0.003, 0.003}) {
    while (std::abs(target - needle) > 0.5e-5) {
      needle += std::copysign(1e-5, target - needle);
      const ContactInput input{needle + place, 0.0, 0.0, -0.5, 0.5};
      const double trial = (needle + place) / g;
      const ContactSolution solution = problem.solve(1.0, 0.0, {&input, 1});
      ASSERT_TRUE(solution.converged);
      force = std::clamp(trial, -0.5, 0.5);
      EXPECT_NEAR(problem.contact(0).axial_n, force, 1e-9);
      EXPECT_NEAR(problem.contact(0).slip_m, needle + place - g * force, 1e-12);
      place -= problem.contact(0).slip_m;
      dissipated += force * problem.contact(0).slip_m;
    }
  }
  EXPECT_DOUBLE_EQ(problem.contact(0).axial_n, 0.5);
  // First branch slips 3 mm - g tau, each reversal 6 mm - 2 g tau.
  EXPECT_NEAR(dissipated, 0.5 * (0.003 - 0.5 * g + 2 * (0.006 - g)), 1e-7);
}

TEST(ContactProblem, AgreesWithGaussSeidelOnRandomCases) {
  std::mt19937 random(20240601);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  int pivots = 0;
  for (int sample = 0; sample < 60; ++sample) {
    const std::size_t contacts = 1 + static_cast<std::size_t>(sample) % 12;
    const Eigen::MatrixXd g = compliance(contacts, random);
    ContactProblem problem = problem_of(g);
    std::vector<ContactInput> input(contacts);
    // several calls one after the other, so that warm starts from foreign states are part of the test
    for (int call = 0; call < 4; ++call) {
      const double angle = 3.0 * uniform(random);
      for (ContactInput& in : input)
        in = {2e-4 * uniform(random), 2e-4 * uniform(random), std::max(0.0, scale * uniform(random)), std::min(0.0, 0.2 * uniform(random)),
              std::max(0.0, 0.2 * uniform(random))};
      const ContactSolution solution = problem.solve(std::cos(angle), std::sin(angle), input);
      ASSERT_TRUE(solution.converged) << sample;
      EXPECT_LT(solution.residual_n, ContactProblem::tolerance_n);
      pivots = std::max(pivots, solution.pivots);
      const Eigen::VectorXd expected = gauss_seidel(stored(g), angle, input);
      for (std::size_t i = 0; i < contacts; ++i) {
        EXPECT_NEAR(problem.contact(i).axial_n, expected(static_cast<Eigen::Index>(2 * i)), 1e-7);
        EXPECT_NEAR(problem.contact(i).lateral_n, expected(static_cast<Eigen::Index>(2 * i + 1)), 1e-7);
      }
    }
  }
  EXPECT_GT(pivots, 2);  // the cases were not trivial
  EXPECT_LT(pivots, 20);
}

TEST(ContactProblem, SatisfiesTheComplementarityConditions) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const std::size_t contacts = 20;
  const Eigen::MatrixXd g = compliance(contacts, random);
  ContactProblem problem = problem_of(g);
  std::vector<ContactInput> input(contacts);
  for (ContactInput& in : input) in = {2e-4 * uniform(random), 2e-4 * uniform(random), 0.0, -0.3, 0.5};
  ASSERT_TRUE(problem.solve(0.6, 0.8, input).converged);
  Eigen::VectorXd f(2 * static_cast<Eigen::Index>(contacts));
  for (std::size_t i = 0; i < contacts; ++i) {
    const ContactForce& c = problem.contact(i);
    f.segment<2>(static_cast<Eigen::Index>(2 * i)) << 0.6 * c.axial_n - 0.8 * c.lateral_n, 0.8 * c.axial_n + 0.6 * c.lateral_n;
  }
  const Eigen::VectorXd u = stored(g) * f;
  int slipping = 0;
  for (std::size_t i = 0; i < contacts; ++i) {
    const ContactForce& c = problem.contact(i);
    const auto row = static_cast<Eigen::Index>(2 * i);
    const double slip = input[i].axial_m - (0.6 * u(row) + 0.8 * u(row + 1));
    EXPECT_NEAR(-0.8 * u(row) + 0.6 * u(row + 1), input[i].lateral_m, 1e-12);
    EXPECT_GE(c.axial_n, -0.3 - 1e-9);
    EXPECT_LE(c.axial_n, 0.5 + 1e-9);
    if (slip > 1e-12) {
      EXPECT_NEAR(c.axial_n, 0.5, 1e-9);
    }
    if (slip < -1e-12) {
      EXPECT_NEAR(c.axial_n, -0.3, 1e-9);
    }
    slipping += std::abs(slip) > 1e-12 ? 1 : 0;
  }
  EXPECT_GT(slipping, 2);
  EXPECT_LT(slipping, 20);
}

TEST(ContactProblem, TakesThresholdsThatAreZeroOrNeverReached) {
  std::mt19937 random(11);
  const std::size_t contacts = 6;
  const Eigen::MatrixXd g = compliance(contacts, random);
  ContactProblem problem = problem_of(g);
  std::vector<ContactInput> input(contacts, {1e-3, -2e-3, 0.0, 0.0, 0.0});
  EXPECT_TRUE(problem.solve(1.0, 0.0, input).converged);
  for (std::size_t i = 0; i < contacts; ++i) EXPECT_EQ(problem.contact(i).axial_n, 0.0);
  for (ContactInput& in : input) in = {1e-3, -2e-3, 0.0, -1e9, 1e9};
  EXPECT_TRUE(problem.solve(1.0, 0.0, input).converged);
  for (std::size_t i = 0; i < contacts; ++i) {
    EXPECT_EQ(problem.contact(i).state, AxialState::Stuck);
    EXPECT_EQ(problem.contact(i).slip_m, 0.0);
  }
}

TEST(ContactProblem, SaysSoWhenTheComplianceIsNotPositive) {
  ContactProblem problem(1);
  const Block own{-scale, 0.0, 0.0, -scale};
  problem.push({&own, 1});
  const ContactInput input{1e-4, 1e-4, 0.0, -1.0, 1.0};
  EXPECT_FALSE(problem.solve(1.0, 0.0, {&input, 1}).converged);
}

}  // namespace
}  // namespace trocar::sim_plant
