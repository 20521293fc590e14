// Random contact problems for tests and benchmarks, the same for the same seed on every platform.
#pragma once

#include <Eigen/Core>
#include <Eigen/QR>
#include <cmath>
#include <cstdint>

#include "tests/reference/box_qp.hpp"

namespace trocar::reference {

// splitmix64 (Steele, Lea, Flood 2014): the standard library's distributions differ between platforms.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  // Uniform in [from, to).
  double uniform(double from, double to) {
    state_ += 0x9E3779B97F4A7C15U;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27U)) * 0x94D049BB133111EBU;
    z ^= z >> 31U;
    return from + (to - from) * std::ldexp(static_cast<double>(z >> 11U), -53);
  }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(uniform(0.0, static_cast<double>(n))); }

 private:
  std::uint64_t state_;
};

// Symmetric positive definite with eigenvalues spread evenly in logarithm over [largest / condition, largest], random eigenvectors.
[[nodiscard]] inline Eigen::MatrixXd random_compliance(Random& random, std::size_t contacts, double condition,
                                                       double largest_m_per_n = 1e-2) {
  const auto n = static_cast<Eigen::Index>(2 * contacts);
  const Eigen::MatrixXd noise = Eigen::MatrixXd::NullaryExpr(n, n, [&](Eigen::Index, Eigen::Index) { return random.uniform(-1.0, 1.0); });
  const Eigen::MatrixXd q = Eigen::HouseholderQR<Eigen::MatrixXd>(noise).householderQ();
  Eigen::VectorXd eigenvalue(n);
  for (Eigen::Index k = 0; k < n; ++k)
    eigenvalue(k) = largest_m_per_n * std::pow(condition, -static_cast<double>(k) / static_cast<double>(std::max<Eigen::Index>(n - 1, 1)));
  const Eigen::MatrixXd g = q * eigenvalue.asDiagonal() * q.transpose();
  return 0.5 * (g + g.transpose());
}

// A row of contacts along x that drag their neighbours along, as tissue does: exp(-distance / decay) is positive definite for any spacing.
[[nodiscard]] inline Eigen::MatrixXd line_compliance(std::size_t contacts, double spacing_m, double decay_m = 0.03,
                                                     double self_m_per_n = 5e-3) {
  const auto s = static_cast<Eigen::Index>(contacts);
  Eigen::MatrixXd g = Eigen::MatrixXd::Zero(2 * s, 2 * s);
  for (Eigen::Index i = 0; i < s; ++i)
    for (Eigen::Index j = 0; j < s; ++j) {
      const double value = self_m_per_n * std::exp(-spacing_m * static_cast<double>(std::abs(i - j)) / decay_m);
      g(2 * i, 2 * j) = 1.3 * value;
      g(2 * i + 1, 2 * j + 1) = value;
    }
  return g;
}

}  // namespace trocar::reference
