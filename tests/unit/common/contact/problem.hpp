// Moves the problems of tests/reference into the solver, and its answers back.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <memory>
#include <numbers>
#include <vector>

#include "common/contact/solver.hpp"
#include "tests/reference/box_qp.hpp"
#include "tests/reference/random_tissue.hpp"

namespace trocar::contact::testing {

[[nodiscard]] inline Block block_of(const Eigen::MatrixXd& g, std::size_t i, std::size_t j) {
  const auto r = static_cast<Eigen::Index>(2 * i);
  const auto c = static_cast<Eigen::Index>(2 * j);
  return {g(r, c), g(r, c + 1), g(r + 1, c), g(r + 1, c + 1)};
}

[[nodiscard]] inline std::vector<Block> row_of(const Eigen::MatrixXd& g, std::size_t i) {
  std::vector<Block> row;
  for (std::size_t j = 0; j <= i; ++j) row.push_back(block_of(g, i, j));
  return row;
}

inline void push_all(Solver& solver, const Eigen::MatrixXd& g) {
  for (std::size_t i = solver.size(); i < static_cast<std::size_t>(g.rows() / 2); ++i) solver.push(row_of(g, i));
}

[[nodiscard]] inline std::unique_ptr<Solver> solver_of(const Eigen::MatrixXd& g) {
  auto solver = std::make_unique<Solver>();
  push_all(*solver, g);
  return solver;
}

[[nodiscard]] inline std::vector<Target> targets_of(const std::vector<reference::Contact>& contact) {
  std::vector<Target> target;
  for (const reference::Contact& c : contact) target.push_back({c.tangent, c.gap_m, c.lower_n, c.upper_n});
  return target;
}

[[nodiscard]] inline Eigen::VectorXd forces_of(const Solver& solver) {
  Eigen::VectorXd f(static_cast<Eigen::Index>(2 * solver.size()));
  for (std::size_t i = 0; i < solver.size(); ++i)
    for (std::size_t k = 0; k < 2; ++k) f(static_cast<Eigen::Index>(2 * i + k)) = solver.contact(i).force_n[k];
  return f;
}

// Everything that a solve leaves behind, for comparison to the bit.
[[nodiscard]] inline std::vector<double> bits_of(const Solver& solver) {
  std::vector<double> all;
  for (std::size_t i = 0; i < solver.size(); ++i) {
    const Contact& c = solver.contact(i);
    const Vector2 u = solver.displacement_m(i);
    all.insert(all.end(), {c.force_n[0], c.force_n[1], c.axial_n, c.lateral_n, c.slip_m, static_cast<double>(c.state), u[0], u[1]});
  }
  return all;
}

[[nodiscard]] inline std::vector<reference::Contact> random_contacts(reference::Random& random, std::size_t count) {
  std::vector<reference::Contact> contact(count);
  for (reference::Contact& c : contact) {
    const double angle = random.uniform(-std::numbers::pi, std::numbers::pi);
    c.tangent = {std::cos(angle), std::sin(angle)};
    c.gap_m = {random.uniform(-5e-3, 5e-3), random.uniform(-5e-3, 5e-3)};
    c.upper_n = random.uniform(0.0, 0.5);
    c.lower_n = -random.uniform(0.0, 0.5);
  }
  return contact;
}

}  // namespace trocar::contact::testing
