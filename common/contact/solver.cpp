#include "common/contact/solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trocar::contact {
namespace {

constexpr double inner_tolerance_n = 1e-11;   // aimed at, so that the promised one holds with room for rounding
constexpr double settled_n = 1e-13;           // at or below, the last forces are the solution of this tick too
constexpr double largest_slip_start_n = 1e6;  // a contact that would begin by slipping under more begins stuck
constexpr int most_refinements = 3;
constexpr int block_patience = 3;  // block exchanges without improvement before single ones
// Smallest square of a pivot over the diagonal of M: below, the unknown is as good as dependent on those before it.
constexpr double smallest_pivot = 1e-15;

double dot(const Vector2& a, const Vector2& b) noexcept { return a[0] * b[0] + a[1] * b[1]; }
Vector2 normal(const Vector2& tangent) noexcept { return {-tangent[1], tangent[0]}; }
double quadratic(const Block& g, const Vector2& v) noexcept {
  return v[0] * (g[0] * v[0] + g[1] * v[1]) + v[1] * (g[2] * v[0] + g[3] * v[1]);
}
bool slipping(State state) noexcept { return state != State::Stuck; }

// y[begin, end) -= x0 a0 + x1 a1 + x2 a2 + x3 a3
void subtract(double* __restrict y, std::size_t begin, std::size_t end, const double* __restrict a0, const double* __restrict a1,
              const double* __restrict a2, const double* __restrict a3, double x0, double x1, double x2, double x3) noexcept {
  for (std::size_t r = begin; r < end; ++r) y[r] -= (x0 * a0[r] + x1 * a1[r]) + (x2 * a2[r] + x3 * a3[r]);
}
void subtract(double* __restrict y, std::size_t begin, std::size_t end, const double* __restrict a, double x) noexcept {
  for (std::size_t r = begin; r < end; ++r) y[r] -= x * a[r];
}

}  // namespace

Vector2 Solver::direction(const Unknown& unknown) const noexcept {
  switch (unknown.direction) {
    case Direction::X:
      return {1.0, 0.0};
    case Direction::Y:
      return {0.0, 1.0};
    case Direction::Normal:
      break;
  }
  return normal(tangent_[unknown.contact]);
}

void Solver::set_row(std::size_t i, std::span<const Block> row) noexcept {
  for (std::size_t j = 0; j <= i; ++j) {
    const Block& b = row[j];
    compliance_[2 * j][2 * i] = compliance_[2 * i][2 * j] = b[0];
    compliance_[2 * j + 1][2 * i] = compliance_[2 * i][2 * j + 1] = b[1];
    compliance_[2 * j][2 * i + 1] = compliance_[2 * i + 1][2 * j] = b[2];
    compliance_[2 * j + 1][2 * i + 1] = compliance_[2 * i + 1][2 * j + 1] = b[3];
  }
  // The own block is symmetric to the bit.
  compliance_[2 * i][2 * i + 1] = compliance_[2 * i + 1][2 * i];
  evaluated_ = false;
}

void Solver::withdraw(std::size_t i) noexcept {
  std::size_t kept = 0;
  for (std::size_t k = 0; k < unknowns_; ++k) {
    if (order_[k].contact == i)
      valid_ = std::min(valid_, kept);
    else
      order_[kept++] = order_[k];
  }
  unknowns_ = kept;
}

void Solver::enter(std::size_t i) noexcept {
  const auto contact = static_cast<std::uint16_t>(i);
  if (slipping(contact_[i].state)) {
    order_[unknowns_++] = {contact, Direction::Normal};
  } else {
    order_[unknowns_++] = {contact, Direction::X};
    order_[unknowns_++] = {contact, Direction::Y};
  }
}

void Solver::set_state(std::size_t i, State state) noexcept {
  const bool same_unknowns = slipping(state) == slipping(contact_[i].state);
  contact_[i].state = state;
  if (same_unknowns) return;
  withdraw(i);
  enter(i);
}

void Solver::start_from(std::size_t i, State state) noexcept { set_state(i, state); }

void Solver::push(std::span<const Block> row) noexcept {
  const std::size_t i = size_++;
  set_row(i, row);
  contact_[i] = {};
  tangent_[i] = {1.0, 0.0};
  force_[2 * i] = force_[2 * i + 1] = 0.0;
  enter(i);
}

void Solver::replace(std::size_t i, std::span<const Block> row) noexcept {
  set_row(i, row);
  withdraw(i);
  enter(i);
}

void Solver::replace_own(std::size_t i, const Block& own) noexcept {
  const Block now = compliance(i, i);
  if (now[0] == own[0] && now[1] == own[1] && now[3] == own[3]) return;
  compliance_[2 * i][2 * i] = own[0];
  compliance_[2 * i][2 * i + 1] = compliance_[2 * i + 1][2 * i] = own[1];
  compliance_[2 * i + 1][2 * i + 1] = own[3];
  evaluated_ = false;
  withdraw(i);
  enter(i);
}

void Solver::pop() noexcept {
  --size_;
  withdraw(size_);
  evaluated_ = false;
  // Loops over rows run in whole vectors: what lies behind the end must stay harmless.
  for (std::size_t k = 0; k < 2; ++k) force_[2 * size_ + k] = 0.0;
}

void Solver::clear() noexcept {
  size_ = unknowns_ = valid_ = 0;
  evaluated_ = false;
}

void Solver::set_axial(std::size_t i, double axial_n) noexcept {
  Contact& c = contact_[i];
  const double change = axial_n - c.axial_n;
  if (change == 0.0) return;
  c.axial_n = axial_n;
  const Vector2 t = tangent_[i];
  const Vector2 n = normal(t);
  c.force_n = {axial_n * t[0] + c.lateral_n * n[0], axial_n * t[1] + c.lateral_n * n[1]};
  force_[2 * i] = c.force_n[0];
  force_[2 * i + 1] = c.force_n[1];
  evaluated_ = false;
}

// Takes the tick's frames and bounds: a slipping contact keeps its lateral force in the turned frame and sits on its bound.
void Solver::turn(std::span<const Target> target) noexcept {
  std::size_t first_turned = unknowns_;
  for (std::size_t i = 0; i < size_; ++i) {
    Contact& c = contact_[i];
    const Target& now = target[i];
    if (slipping(c.state)) {
      const double bound = c.state == State::SlipForward ? now.upper_n : now.lower_n;
      if (std::abs(bound) > largest_slip_start_n && now.lower_n < now.upper_n) set_state(i, State::Stuck);
    } else if (now.lower_n == now.upper_n) {
      set_state(i, State::SlipForward);
    }
    if (tangent_[i] != now.tangent) {
      tangent_[i] = now.tangent;
      if (slipping(c.state)) {
        const Vector2 n = normal(now.tangent);
        c.force_n = {c.axial_n * now.tangent[0] + c.lateral_n * n[0], c.axial_n * now.tangent[1] + c.lateral_n * n[1]};
        force_[2 * i] = c.force_n[0];
        force_[2 * i + 1] = c.force_n[1];
        evaluated_ = false;
        for (std::size_t k = 0; k < first_turned; ++k)
          if (order_[k].contact == i) first_turned = k;
      } else {
        c.axial_n = dot(c.force_n, now.tangent);
        c.lateral_n = dot(c.force_n, normal(now.tangent));
      }
    }
    if (slipping(c.state)) set_axial(i, c.state == State::SlipForward ? now.upper_n : now.lower_n);
  }
  // Stuck contacts first: their rows outlive the next turn. From the first turned one on, whatever the factor holds: the order, and with it
  // every bit, must not depend on what was skipped. (A change of state above can only have cut the factor before a shifted place.)
  valid_ = std::min(valid_, first_turned);
  if (first_turned < unknowns_) {
    std::array<Unknown, 2 * capacity> slipping_ones;
    std::size_t kept = first_turned;
    std::size_t put_off = 0;
    for (std::size_t k = first_turned; k < unknowns_; ++k) {
      if (order_[k].direction == Direction::Normal)
        slipping_ones[put_off++] = order_[k];
      else
        order_[kept++] = order_[k];
    }
    std::copy_n(slipping_ones.begin(), put_off, order_.begin() + static_cast<std::ptrdiff_t>(kept));
  }
}

void Solver::evaluate() noexcept {
  if (evaluated_) return;
  const std::size_t rows = 2 * size_;
  double* __restrict u = displacement_.data();
  for (std::size_t r = 0; r < rows; ++r) u[r] = 0.0;
  std::size_t j = 0;
  for (; j + 4 <= rows; j += 4) {
    const double* __restrict a0 = compliance_[j].data();
    const double* __restrict a1 = compliance_[j + 1].data();
    const double* __restrict a2 = compliance_[j + 2].data();
    const double* __restrict a3 = compliance_[j + 3].data();
    const double x0 = force_[j];
    const double x1 = force_[j + 1];
    const double x2 = force_[j + 2];
    const double x3 = force_[j + 3];
    for (std::size_t r = 0; r < rows; ++r) u[r] += (x0 * a0[r] + x1 * a1[r]) + (x2 * a2[r] + x3 * a3[r]);
  }
  for (; j < rows; ++j) {
    const double* __restrict a = compliance_[j].data();
    const double x = force_[j];
    for (std::size_t r = 0; r < rows; ++r) u[r] += x * a[r];
  }
  evaluated_ = true;
}

// Entries of M in rows first … unknowns_ - 1, up to the diagonal, in the place of L.
void Solver::assemble_rows(std::size_t first) noexcept {
  const std::size_t rows = 2 * size_;
  double* __restrict w = work_.data();
  for (std::size_t a = first; a < unknowns_; ++a) {
    const Vector2 v = direction(order_[a]);
    const double* __restrict gx = compliance_[2 * std::size_t{order_[a].contact}].data();
    const double* __restrict gy = compliance_[2 * std::size_t{order_[a].contact} + 1].data();
    for (std::size_t r = 0; r < rows; ++r) w[r] = v[0] * gx[r] + v[1] * gy[r];
    for (std::size_t b = 0; b <= a; ++b) {
      const Vector2 t = direction(order_[b]);
      const std::size_t i = 2 * std::size_t{order_[b].contact};
      factor_[b][a] = t[0] * w[i] + t[1] * w[i + 1];
    }
  }
}

int Solver::factorise() noexcept {
  const std::size_t first = valid_;
  const std::size_t end = unknowns_;
  if (first >= end) return 0;
  assemble_rows(first);
  for (std::size_t j = 0; j < end; ++j) {
    const std::size_t begin = std::max(j, first);
    double* __restrict column = factor_[j].data();
    // The mirror: L_jl, l < j, stands above the diagonal of this column.
    const double diagonal = column[j];
    std::size_t l = 0;
    for (; l + 4 <= j; l += 4)
      subtract(column, begin, end, factor_[l].data(), factor_[l + 1].data(), factor_[l + 2].data(), factor_[l + 3].data(), column[l],
               column[l + 1], column[l + 2], column[l + 3]);
    for (; l < j; ++l) subtract(column, begin, end, factor_[l].data(), column[l]);
    if (j >= first) {
      const double pivot = std::max(column[j], smallest_pivot * std::abs(diagonal) + std::numeric_limits<double>::min());
      column[j] = std::sqrt(pivot);
      inverse_pivot_[j] = 1.0 / column[j];
    }
    const double inverse = inverse_pivot_[j];
    for (std::size_t r = std::max(j + 1, first); r < end; ++r) column[r] *= inverse;
    for (std::size_t r = std::max(j + 1, first); r < end; ++r) factor_[r][j] = column[r];
  }
  valid_ = end;
  return static_cast<int>(end - first);
}

// One correction of the working unknowns by L L^T x = v.(d - u).
void Solver::solve_unknowns(std::span<const Target> target) noexcept {
  double* __restrict y = work_.data();
  for (std::size_t a = 0; a < unknowns_; ++a) {
    const std::size_t i = order_[a].contact;
    const Vector2 gap{target[i].gap_m[0] - displacement_[2 * i], target[i].gap_m[1] - displacement_[2 * i + 1]};
    y[a] = dot(direction(order_[a]), gap);
  }
  for (std::size_t j = 0; j < unknowns_; ++j) {
    y[j] *= inverse_pivot_[j];
    subtract(y, j + 1, unknowns_, factor_[j].data(), y[j]);
  }
  for (std::size_t j = unknowns_; j-- > 0;) {
    y[j] *= inverse_pivot_[j];
    subtract(y, 0, j, factor_[j].data(), y[j]);
  }
  for (std::size_t a = 0; a < unknowns_; ++a) {
    const std::size_t i = order_[a].contact;
    Contact& c = contact_[i];
    if (order_[a].direction == Direction::Normal) {
      const Vector2 t = tangent_[i];
      const Vector2 n = normal(t);
      c.lateral_n += y[a];
      c.force_n = {c.axial_n * t[0] + c.lateral_n * n[0], c.axial_n * t[1] + c.lateral_n * n[1]};
    } else {
      c.force_n[order_[a].direction == Direction::X ? 0 : 1] += y[a];
      c.axial_n = dot(c.force_n, tangent_[i]);
      c.lateral_n = dot(c.force_n, normal(tangent_[i]));
    }
    force_[2 * i] = c.force_n[0];
    force_[2 * i + 1] = c.force_n[1];
  }
  evaluated_ = false;
}

void Solver::judge(std::span<const Target> target, Violations& v) noexcept {
  v.count = 0;
  v.free_residual_n = v.residual_n = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    Contact& c = contact_[i];
    const Target& at = target[i];
    const Vector2 t = tangent_[i];
    const Vector2 n = normal(t);
    const Vector2 gap{at.gap_m[0] - displacement_[2 * i], at.gap_m[1] - displacement_[2 * i + 1]};
    const Block own = compliance(i, i);
    c.slip_m = dot(t, gap);
    const double axial_gap_n = c.slip_m / quadratic(own, t);
    const double lateral_n = std::abs(dot(n, gap)) / quadratic(own, n);
    const double axial_n = std::abs(c.axial_n - std::clamp(c.axial_n + axial_gap_n, at.lower_n, at.upper_n));
    v.free_residual_n = std::max({v.free_residual_n, lateral_n, slipping(c.state) ? 0.0 : std::abs(axial_gap_n)});
    v.residual_n = std::max({v.residual_n, lateral_n, axial_n});
    // Not `>`: a residual that is no number must not pass for a small one.
    if (!(lateral_n < std::numeric_limits<double>::max()) || !(axial_n < std::numeric_limits<double>::max()))
      v.residual_n = v.free_residual_n = std::numeric_limits<double>::infinity();
    State becomes = c.state;
    if (c.state == State::Stuck) {
      if (c.axial_n > at.upper_n + inner_tolerance_n) becomes = State::SlipForward;
      if (c.axial_n < at.lower_n - inner_tolerance_n) becomes = State::SlipBackward;
    } else if (at.lower_n == at.upper_n) {
      c.state = becomes = c.slip_m >= 0.0 ? State::SlipForward : State::SlipBackward;
    } else if (c.state == State::SlipForward ? axial_gap_n < -inner_tolerance_n : axial_gap_n > inner_tolerance_n) {
      becomes = State::Stuck;
    }
    if (becomes != c.state) {
      const auto k = static_cast<std::size_t>(v.count++);
      v.contact[k] = static_cast<std::uint16_t>(i);
      v.becomes[k] = becomes;
    }
  }
}

Solution Solver::solve(std::span<const Target> target) noexcept {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Solution solution;
  for (std::size_t i = 0; i < size_; ++i) {
    const Target& t = target[i];
    const bool finite =
        std::isfinite(t.tangent[0]) && std::isfinite(t.tangent[1]) && std::isfinite(t.gap_m[0]) && std::isfinite(t.gap_m[1]);
    const bool bounded = t.lower_n <= t.upper_n && t.lower_n < infinity && t.upper_n > -infinity;
    if (!finite || !bounded) {
      solution.status = SolverStatus::NotFinite;
      return solution;
    }
  }
  if (size_ == 0) return solution;

  Violations v;
  turn(target);
  evaluate();
  judge(target, v);
  int fewest = static_cast<int>(size_) + 1;
  int patience = block_patience;
  int refinements = 0;
  bool limited = false;
  while (v.count > 0 || v.residual_n > settled_n) {
    if (solution.iterations == max_iterations || solution.pivots >= max_pivots) {
      limited = true;
      break;
    }
    solution.rows_factored += factorise();
    solve_unknowns(target);
    evaluate();
    judge(target, v);
    ++solution.iterations;
    if (v.free_residual_n > inner_tolerance_n && refinements < most_refinements) {
      ++refinements;
      continue;
    }
    refinements = 0;
    if (v.count == 0) break;
    std::size_t begin = 0;
    if (v.count < fewest) {
      fewest = v.count;
      patience = block_patience;
    } else if (patience > 0) {
      --patience;
    } else {
      begin = static_cast<std::size_t>(v.count) - 1;
    }
    for (std::size_t k = begin; k < static_cast<std::size_t>(v.count) && solution.pivots < max_pivots; ++k) {
      const std::size_t i = v.contact[k];
      set_state(i, v.becomes[k]);
      ++solution.pivots;
      if (slipping(v.becomes[k])) set_axial(i, v.becomes[k] == State::SlipForward ? target[i].upper_n : target[i].lower_n);
    }
    evaluate();
  }
  if (limited) {
    // A stuck contact that is cut to its bound slips: its owner has to know.
    for (std::size_t i = 0; i < size_; ++i) {
      const double axial_n = contact_[i].axial_n;
      if (contact_[i].state == State::Stuck && axial_n > target[i].upper_n) set_state(i, State::SlipForward);
      if (contact_[i].state == State::Stuck && axial_n < target[i].lower_n) set_state(i, State::SlipBackward);
      set_axial(i, std::clamp(axial_n, target[i].lower_n, target[i].upper_n));
    }
    evaluate();
    judge(target, v);
  }
  if (!std::isfinite(v.residual_n)) {
    // Nothing that is no number may reach the next tick.
    for (std::size_t i = 0; i < size_; ++i) {
      contact_[i].axial_n = contact_[i].lateral_n = 0.0;
      contact_[i].force_n = {};
      force_[2 * i] = force_[2 * i + 1] = 0.0;
    }
    evaluated_ = false;
    evaluate();
  }
  solution.residual_n = v.residual_n;
  if (!(v.residual_n <= tolerance_n)) solution.status = limited ? SolverStatus::PivotLimit : SolverStatus::IllConditioned;
  return solution;
}

double Solver::factor_drift() noexcept {
  if (valid_ < unknowns_) factorise();
  const std::array<Column, 2 * capacity> kept = factor_;
  forget_factor();
  factorise();
  double largest = 0.0;
  double drift = 0.0;
  for (std::size_t j = 0; j < unknowns_; ++j) {
    for (std::size_t r = j; r < unknowns_; ++r) {
      largest = std::max(largest, std::abs(factor_[j][r]));
      drift = std::max(drift, std::abs(factor_[j][r] - kept[j][r]));
    }
  }
  return largest > 0.0 ? drift / largest : 0.0;
}

}  // namespace trocar::contact
