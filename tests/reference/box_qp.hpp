// The stick-slip problem of one tick, solved by other means than common/contact, for tests: enumeration of all states for a few contacts,
// projected Gauss-Seidel for more. Slow on purpose, in long double.
//   u = G f                       displacement [m] and force [N] of s contact points, 2 rows a contact, rig frame; G symmetric positive
//   definite lateral   n.(u - d) = 0       n = (-t_y, t_x), d the displacement that puts the tissue point on its place on the needle axial
//   ds = t.(d - u)      slip of the needle relative to the tissue; f_t = t.f the axial force on the tissue
//             lower <= f_t <= upper;  ds > 0 only where f_t = upper;  ds < 0 only where f_t = lower
// These are the optimality conditions of min 1/2 f.G f - d.f over lower <= f_t <= upper, strictly convex: exactly one solution.
//   residual  max over contacts of |f_t - clip(f_t + ds / G_tt, lower, upper)| and |n.(u - d)| / G_nn, in N   (MODELS section 5)
// Precondition everywhere: tangents of unit length, lower <= upper, both finite or infinite, G of 2 s rows.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <vector>

namespace trocar::reference {

struct Contact {
  std::array<double, 2> tangent{1.0, 0.0};
  std::array<double, 2> gap_m{};
  double lower_n{};
  double upper_n{};
};

enum class Axial : std::uint8_t { Stuck, Lower, Upper };

struct BoxQp {
  Eigen::MatrixXd compliance_m_per_n{};
  std::vector<Contact> contact{};
};

struct Solution {
  Eigen::VectorXd force_n{};  // on the tissue, rig frame
  std::vector<Axial> state{};
  double residual_n{std::numeric_limits<double>::infinity()};
  long sweeps{};
  bool solved{};  // residual_n <= the tolerance asked for: the conditions hold, however they were found
};

namespace detail {

using Real = long double;
using Matrix = Eigen::Matrix<Real, Eigen::Dynamic, Eigen::Dynamic>;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;

// Everything in local frames: row 2 i axial, row 2 i + 1 lateral.
struct Local {
  Matrix g{};
  Vector d{}, lower{}, upper{};

  explicit Local(const BoxQp& qp) {
    const auto s = static_cast<Eigen::Index>(qp.contact.size());
    if (qp.compliance_m_per_n.rows() != 2 * s || qp.compliance_m_per_n.cols() != 2 * s)
      throw std::invalid_argument("box QP: the compliance has not 2 rows and columns a contact");
    Matrix frame = Matrix::Zero(2 * s, 2 * s);
    Vector gap(2 * s);
    lower.resize(s);
    upper.resize(s);
    for (Eigen::Index i = 0; i < s; ++i) {
      const Contact& c = qp.contact[static_cast<std::size_t>(i)];
      frame.block<2, 2>(2 * i, 2 * i) << Real{c.tangent[0]}, Real{c.tangent[1]}, -Real{c.tangent[1]}, Real{c.tangent[0]};
      gap.segment<2>(2 * i) << Real{c.gap_m[0]}, Real{c.gap_m[1]};
      lower(i) = c.lower_n;
      upper(i) = c.upper_n;
    }
    g = frame * qp.compliance_m_per_n.cast<Real>() * frame.transpose();
    d = frame * gap;
    to_rig = frame.transpose();
  }

  [[nodiscard]] Eigen::Index contacts() const { return lower.size(); }

  [[nodiscard]] Real residual(const Vector& f) const {
    const Vector slack = d - g * f;
    Real worst = 0;
    for (Eigen::Index i = 0; i < contacts(); ++i) {
      const Real axial = f(2 * i) - std::clamp(f(2 * i) + slack(2 * i) / g(2 * i, 2 * i), lower(i), upper(i));
      const Real lateral = slack(2 * i + 1) / g(2 * i + 1, 2 * i + 1);
      for (const Real part : {axial, lateral})
        worst = std::isfinite(part) ? std::max(worst, std::abs(part)) : std::numeric_limits<Real>::infinity();
    }
    return worst;
  }

  // Forces with the states given: a dense solve for the lateral and the stuck axial ones.
  [[nodiscard]] Vector solve(const std::vector<Axial>& state) const {
    std::vector<Eigen::Index> unknown;
    Vector f = Vector::Zero(d.size());
    for (Eigen::Index i = 0; i < contacts(); ++i) {
      const Axial at = state[static_cast<std::size_t>(i)];
      if (at == Axial::Stuck) unknown.push_back(2 * i);
      if (at == Axial::Lower) f(2 * i) = lower(i);
      if (at == Axial::Upper) f(2 * i) = upper(i);
      unknown.push_back(2 * i + 1);
    }
    const Vector rest = d - g * f;
    const Vector found = Matrix(g(unknown, unknown)).llt().solve(Vector(rest(unknown)));
    for (std::size_t k = 0; k < unknown.size(); ++k) f(unknown[k]) = found(static_cast<Eigen::Index>(k));
    return f;
  }

  [[nodiscard]] Solution solution(const Vector& f, std::vector<Axial> state, long sweeps, double tolerance_n) const {
    Solution out;
    out.force_n = (to_rig * f).cast<double>();
    out.state = std::move(state);
    out.residual_n = static_cast<double>(residual(f));
    out.sweeps = sweeps;
    out.solved = out.residual_n <= tolerance_n;
    return out;
  }

 private:
  Matrix to_rig{};
};

}  // namespace detail

// In N, as defined above.
[[nodiscard]] inline double residual_n(const BoxQp& qp, const Eigen::VectorXd& force_n) {
  const detail::Local local(qp);
  detail::Vector f(force_n.size());
  for (Eigen::Index i = 0; i < local.contacts(); ++i) {
    const Contact& c = qp.contact[static_cast<std::size_t>(i)];
    const detail::Real tx = c.tangent[0], ty = c.tangent[1], fx = force_n(2 * i), fy = force_n(2 * i + 1);
    f(2 * i) = tx * fx + ty * fy;
    f(2 * i + 1) = tx * fy - ty * fx;
  }
  return static_cast<double>(local.residual(f));
}

// The states are given: one dense solve. `residual_n` then says whether these states are the right ones.
[[nodiscard]] inline Solution solve_with_states(const BoxQp& qp, std::vector<Axial> state, double tolerance_n = 1e-12) {
  const detail::Local local(qp);
  const detail::Vector f = local.solve(state);
  return local.solution(f, std::move(state), 0, tolerance_n);
}

// Every combination of states, 3^s dense solves, the one that meets the conditions best. At most 8 contacts.
[[nodiscard]] inline Solution enumerate(const BoxQp& qp, double tolerance_n = 1e-12) {
  if (qp.contact.size() > 8) throw std::invalid_argument("box QP: more than 8 contacts are too many to enumerate");
  const detail::Local local(qp);
  const std::size_t s = qp.contact.size();
  Solution best;
  for (std::size_t code = 0, codes = static_cast<std::size_t>(std::llround(std::pow(3.0, static_cast<double>(s)))); code < codes; ++code) {
    std::vector<Axial> state(s);
    bool finite = true;
    for (std::size_t i = 0, rest = code; i < s; ++i, rest /= 3) {
      state[i] = static_cast<Axial>(rest % 3);
      const Contact& c = qp.contact[i];
      finite = finite && (state[i] != Axial::Lower || std::isfinite(c.lower_n)) && (state[i] != Axial::Upper || std::isfinite(c.upper_n));
    }
    if (!finite) continue;  // an infinite threshold is never reached
    const detail::Vector f = local.solve(state);
    const Solution candidate = local.solution(f, std::move(state), 0, tolerance_n);
    if (best.state.empty() || candidate.residual_n < best.residual_n) best = candidate;
  }
  return best;
}

// Projected Gauss-Seidel, any number of contacts. Every few sweeps the states that it has arrived at are tried in a dense solve, because
// its own last digits cost thousands of sweeps on a badly conditioned G; the conditions decide whether that solution is taken.
[[nodiscard]] inline Solution projected_gauss_seidel(const BoxQp& qp, double tolerance_n = 1e-12, long max_sweeps = 200'000) {
  const detail::Local local(qp);
  const Eigen::Index s = local.contacts();
  detail::Vector f = detail::Vector::Zero(2 * s);
  long next_try = 16;
  for (long sweep = 1;; ++sweep) {
    for (Eigen::Index k = 0; k < 2 * s; ++k) {
      const detail::Real free = f(k) + (local.d(k) - local.g.col(k).dot(f)) / local.g(k, k);  // G is symmetric: its column is its row
      f(k) = k % 2 == 0 ? std::clamp(free, local.lower(k / 2), local.upper(k / 2)) : free;
    }
    const bool last = sweep >= max_sweeps;
    if (sweep < next_try && !last) continue;
    next_try = sweep + std::max<long>(16, sweep / 4);
    std::vector<Axial> state(static_cast<std::size_t>(s), Axial::Stuck);
    for (Eigen::Index i = 0; i < s; ++i) {
      if (f(2 * i) <= local.lower(i)) state[static_cast<std::size_t>(i)] = Axial::Lower;
      if (f(2 * i) >= local.upper(i)) state[static_cast<std::size_t>(i)] = Axial::Upper;
    }
    const detail::Vector polished = local.solve(state);
    const bool better = local.residual(polished) < local.residual(f);
    Solution out = local.solution(better ? polished : f, std::move(state), sweep, tolerance_n);
    if (out.solved || last) return out;
  }
}

}  // namespace trocar::reference
