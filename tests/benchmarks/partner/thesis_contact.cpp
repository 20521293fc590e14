#include "tests/benchmarks/partner/thesis_contact.hpp"

#include <Eigen/LU>
#include <cmath>

namespace trocar::partner {
namespace {

constexpr double slip_dead_band_m = 1e-12;  // a thousandth of an atom's size, a thousand times the rounding of a position

// S -= a b^T and S -= a0 b0^T + a1 b1^T, four columns at a time so that a is loaded once for all of them. Written with std::fma
// because the project compiles without contraction, and Eigen's kernels, which the other side uses, contain it.
template <int Rank>
void subtract(double* __restrict s, std::size_t stride, std::size_t columns, const double* __restrict a0, const double* __restrict b0,
              const double* __restrict a1, const double* __restrict b1) noexcept {
  std::size_t j = 0;
  for (; j + 4 <= columns; j += 4) {
    double* __restrict q0 = s + j * stride;
    double* __restrict q1 = q0 + stride;
    double* __restrict q2 = q1 + stride;
    double* __restrict q3 = q2 + stride;
    const double p0 = -b0[j], p1 = -b0[j + 1], p2 = -b0[j + 2], p3 = -b0[j + 3];
    if constexpr (Rank == 1) {
      for (std::size_t k = 0; k < stride; ++k) {
        const double a = a0[k];
        q0[k] = std::fma(a, p0, q0[k]);
        q1[k] = std::fma(a, p1, q1[k]);
        q2[k] = std::fma(a, p2, q2[k]);
        q3[k] = std::fma(a, p3, q3[k]);
      }
    } else {
      const double r0 = -b1[j], r1 = -b1[j + 1], r2 = -b1[j + 2], r3 = -b1[j + 3];
      for (std::size_t k = 0; k < stride; ++k) {
        const double a = a0[k], e = a1[k];
        q0[k] = std::fma(e, r0, std::fma(a, p0, q0[k]));
        q1[k] = std::fma(e, r1, std::fma(a, p1, q1[k]));
        q2[k] = std::fma(e, r2, std::fma(a, p2, q2[k]));
        q3[k] = std::fma(e, r3, std::fma(a, p3, q3[k]));
      }
    }
  }
  for (; j < columns; ++j) {  // the order is even: two columns or none
    double* __restrict q = s + j * stride;
    for (std::size_t k = 0; k < stride; ++k) {
      q[k] = std::fma(a0[k], -b0[j], q[k]);
      if constexpr (Rank == 2) q[k] = std::fma(a1[k], -b1[j], q[k]);
    }
  }
}

Eigen::Matrix2d frame(const std::array<double, 2>& t) noexcept { return Eigen::Matrix2d{{t[0], t[1]}, {-t[1], t[0]}}; }

using Aligned = Eigen::Map<Eigen::MatrixXd, Eigen::Aligned32, Eigen::OuterStride<>>;
using AlignedVector = Eigen::Map<Eigen::VectorXd, Eigen::Aligned32>;

}  // namespace

void ThesisContact::resize(std::size_t contacts) noexcept {
  const std::size_t kept = 2 * std::min(size_, contacts), order = 2 * contacts, stride = (order + 3) / 4 * 4;
  const auto move = [&](std::size_t j) {
    for (std::size_t k = 0; k < kept; ++k) work_[0][k] = s_[j * stride_ + k];
    for (std::size_t k = 0; k < stride; ++k) s_[j * stride + k] = k < kept ? work_[0][k] : 0.0;
  };
  // Away from what is not read yet.
  if (stride > stride_)
    for (std::size_t j = kept; j-- > 0;) move(j);
  else
    for (std::size_t j = 0; j < kept; ++j) move(j);
  for (std::size_t j = kept; j < order; ++j)
    for (std::size_t k = 0; k < stride; ++k) s_[j * stride + k] = 0.0;
  for (std::size_t k = kept; k < stride; ++k) x_[k] = y_[k] = 0.0;
  size_ = contacts;
  stride_ = stride;
}

bool ThesisContact::append(std::span<const Eigen::Matrix2d> row, const Target& target) noexcept {
  if (size_ == capacity::contacts || row.size() != size_ + 1) return false;
  const std::size_t m = order(), n = size_;
  const Eigen::Matrix2d own = frame(target.tangent);
  // g: the new columns in local frames; h = S times the part of g on known displacements (D). By elimination of f_D:
  // S_Dn = -h_D, S_Fn = g_F - h_F, S_nD = h_D', S_nF = (g_F - h_F)', S_nn = G_nn - g_D' h_D.
  std::array<Column, 2> g;
  for (std::size_t j = 0; j < n; ++j) {
    const Eigen::Matrix2d block = frame(node_[j].tangent) * row[j].transpose() * own.transpose();
    for (std::size_t k = 0; k < 2; ++k) {
      g[k][2 * j] = block(0, static_cast<Eigen::Index>(k));
      g[k][2 * j + 1] = block(1, static_cast<Eigen::Index>(k));
    }
  }
  std::array<Column, 2> h{};
  const auto displacement_known = [&](std::size_t i) { return i % 2 == 1 || node_[i / 2].state == State::Stuck; };
  for (std::size_t k = 0; k < 2; ++k)
    for (std::size_t j = 0; j < m; ++j)
      if (displacement_known(j))
        for (std::size_t i = 0; i < m; ++i) h[k][i] += at(i, j) * g[k][j];
  Eigen::Matrix2d corner = own * row[n] * own.transpose();
  for (std::size_t j = 0; j < m; ++j)
    if (displacement_known(j))
      for (Eigen::Index a = 0; a < 2; ++a)
        for (Eigen::Index b = 0; b < 2; ++b) corner(a, b) -= g[static_cast<std::size_t>(a)][j] * h[static_cast<std::size_t>(b)][j];

  resize(n + 1);
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < m; ++i) {
      const bool known = displacement_known(i);
      at(i, m + k) = known ? -h[k][i] : g[k][i] - h[k][i];
      at(m + k, i) = known ? h[k][i] : g[k][i] - h[k][i];
    }
    for (std::size_t l = 0; l < 2; ++l) at(m + l, m + k) = corner(static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(k));
  }
  node_[n] = {State::Stuck, target.tangent, 0.0};
  swap(m);
  swap(m + 1);
  return true;
}

void ThesisContact::pop() noexcept {
  if (size_ == 0) return;
  const std::size_t m = order();
  if (node_[size_ - 1].state == State::Stuck) swap(m - 2);
  swap(m - 1);
  resize(size_ - 1);
}

void ThesisContact::swap(std::size_t i) noexcept {
  const std::size_t m = order();
  const double p = at(i, i), inverse = 1.0 / p;
  Column& c = work_[0];
  Column& r = work_[1];
  for (std::size_t k = 0; k < stride_; ++k) c[k] = at(k, i);
  for (std::size_t k = 0; k < m; ++k) r[k] = at(i, k) * inverse;
  subtract<1>(s_.data(), stride_, m, c.data(), r.data(), nullptr, nullptr);
  for (std::size_t k = 0; k < m; ++k) at(k, i) = c[k] * inverse;
  for (std::size_t k = 0; k < m; ++k) at(i, k) = -r[k];
  at(i, i) = inverse;
}

void ThesisContact::rotate(std::size_t contact, const std::array<double, 2>& tangent) noexcept {
  const std::array<double, 2> old = node_[contact].tangent;
  const double c = old[0] * tangent[0] + old[1] * tangent[1];
  const double s = old[0] * tangent[1] - old[1] * tangent[0];
  if (node_[contact].state == State::Stuck)
    rotate_stuck(2 * contact, c, s);
  else
    rotate_slipping(2 * contact, c, s);
  node_[contact].tangent = tangent;
}

void ThesisContact::rotate_stuck(std::size_t first, double c, double s) noexcept {
  double* __restrict a = column(first);
  double* __restrict l = column(first + 1);
  for (std::size_t k = 0; k < stride_; ++k) {
    const double axial = a[k], lateral = l[k];
    a[k] = c * axial + s * lateral;
    l[k] = c * lateral - s * axial;
  }
  for (std::size_t j = 0, m = order(); j < m; ++j) {
    double* pair = column(j) + first;
    const double axial = pair[0], lateral = pair[1];
    pair[0] = c * axial + s * lateral;
    pair[1] = c * lateral - s * axial;
  }
}

void ThesisContact::rotate_slipping(std::size_t first, double c, double s) noexcept {
  const std::size_t m = order();
  const Eigen::Matrix2d turn{{0.0, s}, {-s, 0.0}};  // s J
  const Eigen::Matrix2d own{{at(first, first), at(first, first + 1)}, {at(first + 1, first), at(first + 1, first + 1)}};
  const Eigen::Matrix2d inverse = (c * Eigen::Matrix2d::Identity() + turn * own).inverse();
  const Eigen::Matrix2d corner = (c * own + turn) * inverse;
  const Eigen::Matrix2d row_map = c * Eigen::Matrix2d::Identity() - corner * turn;
  Column& a0 = work_[0];  // S_EI B^-1
  Column& a1 = work_[1];
  Column& b0 = work_[2];  // s J S_IE
  Column& b1 = work_[3];
  const double* axial = column(first);
  const double* lateral = column(first + 1);
  for (std::size_t k = 0; k < stride_; ++k) {
    a0[k] = axial[k] * inverse(0, 0) + lateral[k] * inverse(1, 0);
    a1[k] = axial[k] * inverse(0, 1) + lateral[k] * inverse(1, 1);
  }
  for (std::size_t j = 0; j < m; ++j) {
    double* pair = column(j) + first;
    const double top = pair[0], bottom = pair[1];
    b0[j] = s * bottom;
    b1[j] = -s * top;
    pair[0] = row_map(0, 0) * top + row_map(0, 1) * bottom;
    pair[1] = row_map(1, 0) * top + row_map(1, 1) * bottom;
  }
  const double keep00 = a0[first], keep01 = a0[first + 1], keep10 = a1[first], keep11 = a1[first + 1];
  a0[first] = a0[first + 1] = a1[first] = a1[first + 1] = 0.0;  // the contact's own rows are done
  subtract<2>(s_.data(), stride_, m, a0.data(), b0.data(), a1.data(), b1.data());
  a0[first] = keep00, a0[first + 1] = keep01, a1[first] = keep10, a1[first + 1] = keep11;
  double* __restrict to_axial = column(first);
  double* __restrict to_lateral = column(first + 1);
  for (std::size_t k = 0; k < stride_; ++k) {
    to_axial[k] = a0[k];
    to_lateral[k] = a1[k];
  }
  at(first, first) = corner(0, 0);
  at(first, first + 1) = corner(0, 1);
  at(first + 1, first) = corner(1, 0);
  at(first + 1, first + 1) = corner(1, 1);
}

void ThesisContact::force_state(std::size_t contact, State state) noexcept {
  Node& node = node_[contact];
  if ((node.state == State::Stuck) != (state == State::Stuck)) swap(2 * contact);
  node.state = state;
  node.slip_m = 0.0;
}

// Figure 5.4. Slipping ends when the slip has turned against the friction that it met.
int ThesisContact::transition(std::size_t contact, const Target& target) noexcept {
  const Node& node = node_[contact];
  const bool never_sticks = target.lower_n == target.upper_n;  // its force is known: the automaton would chatter
  State next = node.state;
  switch (node.state) {
    case State::Stuck:
      if (x_[2 * contact] > target.upper_n) next = State::Upper;
      if (x_[2 * contact] < target.lower_n) next = State::Lower;
      break;
    case State::Upper:
      if (!never_sticks && node.slip_m < -slip_dead_band_m) next = State::Stuck;
      break;
    case State::Lower:
      if (!never_sticks && node.slip_m > slip_dead_band_m) next = State::Stuck;
      break;
  }
  if (next == node.state) return 0;
  force_state(contact, next);
  return 1;
}

ThesisContact::Report ThesisContact::solve(std::span<const Target> target) noexcept {
  Report report;
  for (std::size_t i = 0; i < size_; ++i) report.transitions += transition(i, target[i]);
  for (std::size_t i = 0; i < size_; ++i)
    if (target[i].tangent != node_[i].tangent) {
      rotate(i, target[i].tangent);
      ++report.rotations;
    }
  for (std::size_t i = 0; i < size_; ++i) {
    const Target& to = target[i];
    const double axial_gap = to.tangent[0] * to.gap_m[0] + to.tangent[1] * to.gap_m[1];
    y_[2 * i] = node_[i].state == State::Stuck ? axial_gap : node_[i].state == State::Upper ? to.upper_n : to.lower_n;
    y_[2 * i + 1] = to.tangent[0] * to.gap_m[1] - to.tangent[1] * to.gap_m[0];
  }
  const auto rows = static_cast<Eigen::Index>(stride_), columns = static_cast<Eigen::Index>(order());
  if (columns > 0)
    AlignedVector(x_.data(), rows).noalias() =
        Aligned(s_.data(), rows, columns, Eigen::OuterStride<>(rows)) * AlignedVector(y_.data(), columns);
  for (std::size_t i = 0; i < size_; ++i) {
    const Target& to = target[i];
    node_[i].slip_m = node_[i].state == State::Stuck ? 0.0 : to.tangent[0] * to.gap_m[0] + to.tangent[1] * to.gap_m[1] - x_[2 * i];
  }
  return report;
}

Eigen::Vector2d ThesisContact::force_n(std::size_t contact) const noexcept {
  const Node& node = node_[contact];
  const double axial = node.state == State::Stuck ? x_[2 * contact] : y_[2 * contact];
  return frame(node.tangent).transpose() * Eigen::Vector2d(axial, x_[2 * contact + 1]);
}

Eigen::Vector2d ThesisContact::displacement_m(std::size_t contact) const noexcept {
  const Node& node = node_[contact];
  const double axial = node.state == State::Stuck ? y_[2 * contact] : x_[2 * contact];
  return frame(node.tangent).transpose() * Eigen::Vector2d(axial, y_[2 * contact + 1]);
}

}  // namespace trocar::partner
