#include "common/contact/solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/contact/kernels.hpp"

namespace trocar::contact {
namespace {

constexpr double inner_tolerance_n = tolerance(1e-11, 3e-6);  // aimed at, so that the promised one holds with room for rounding
// Contacts that hardly differ carry huge opposite forces across the shaft; what rounding leaves of these is no violation. In units of the
// largest force's last digit, and never near to the promised residual.
constexpr double rounding_digits = 4.0 * std::numeric_limits<double>::epsilon();
constexpr double largest_inner_tolerance_n = 0.3 * Solver::tolerance_n;
constexpr double settled_n = tolerance(1e-13, 1e-7);  // at or below, the last forces are the solution of this tick too
constexpr double largest_slip_start_n = 1e6;          // a contact that would begin by slipping under more begins stuck
constexpr int most_refinements = 3;
constexpr double proportional = tolerance(1e-8, 1e-4);  // gaps that differ by less from others' multiple, over the largest
constexpr double largest_share = 1e3;                   // of a small correction would multiply its rounding
constexpr int block_patience = 3;                       // block exchanges without fewer violations
constexpr double infinity = std::numeric_limits<double>::infinity();
// Smallest pivot over the diagonal of M: below, the unknown is as good as dependent on those before it.
constexpr double smallest_pivot = tolerance(1e-15, 1e-6);

double quadratic(const Block& g, const Vector2& v) noexcept {
  return v[0] * (g[0] * v[0] + g[1] * v[1]) + v[1] * (g[2] * v[0] + g[3] * v[1]);
}
bool slipping(State state) noexcept { return state != State::Stuck; }

// x_0 a_0 + x_1 a_1 + … over the rows a_k
template <std::size_t n>
std::array<double, n> times(const std::array<std::array<double, n>, n>& a, const double* x) noexcept {
  std::array<double, n> even{}, odd{};
  for (std::size_t k = 0; k < n; k += 2)
    for (std::size_t r = 0; r < n; ++r) even[r] += x[k] * a[k][r], odd[r] += x[k + 1] * a[k + 1][r];
  for (std::size_t r = 0; r < n; ++r) even[r] += odd[r];
  return even;
}

}  // namespace

Vector2 Solver::direction(const Unknown& unknown) const noexcept {
  if (unknown.direction == Direction::X) return {1.0, 0.0};
  if (unknown.direction == Direction::Y) return {0.0, 1.0};
  return {-row_y_[unknown.contact], row_x_[unknown.contact]};
}

void Solver::set_row(std::size_t i, std::span<const Block> row) noexcept {
  for (std::size_t j = 0; j <= i; ++j) {
    const Block& b = row[j];
    compliance_[2 * j][i] = compliance_[2 * i][j] = b[0];
    compliance_[2 * j + 1][i] = compliance_[2 * i][half + j] = b[1];
    compliance_[2 * j][half + i] = compliance_[2 * i + 1][j] = b[2];
    compliance_[2 * j + 1][half + i] = compliance_[2 * i + 1][half + j] = b[3];
  }
  // The own block is symmetric to the bit.
  compliance_[2 * i + 1][i] = compliance_[2 * i][half + i];
  own_[i] = compliance(i, i);
  measured_[i] = false;
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
  forget_correction();
}

void Solver::enter(std::size_t i) noexcept {
  const auto contact = static_cast<std::uint16_t>(i);
  if (slipping(contact_[i].state)) {
    row_x_[i] = tangent_x_[i];
    row_y_[i] = tangent_y_[i];
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

void Solver::push(std::span<const Block> row) noexcept { push(row, Contact{}); }

void Solver::push(std::span<const Block> row, const Contact& start) noexcept {
  const std::size_t i = size_++;
  set_row(i, row);
  contact_[i] = start;
  tangent_x_[i] = 1.0;
  tangent_y_[i] = 0.0;
  put_force(i);
  enter(i);
}

void Solver::join(const Solver& tissue, std::span<const double> softness, std::size_t part) noexcept {
  clear();
  joined_ = true;
  size_ = tissue.size_;
  for (std::size_t k = 0; k < 2 * size_; ++k) {
    const double* __restrict const soft = &softness[2 * part * k];
    const double* __restrict const stiff = tissue.compliance_[k].data();
    double* __restrict const column = compliance_[k].data();
    for (std::size_t i = 0; i < size_; ++i) column[i] = stiff[i] + soft[i];
    for (std::size_t i = 0; i < size_; ++i) column[half + i] = stiff[half + i] + soft[part + i];
  }
  tangent_x_ = tissue.tangent_x_;
  tangent_y_ = tissue.tangent_y_;
  for (std::size_t i = 0; i < size_; ++i) {
    own_[i] = tissue.compliance(i, i);
    measured_[i] = false;
    contact_[i] = tissue.contact_[i];
    put_force(i);
    enter(i);
  }
  evaluate();
}

int Solver::negative_pivots() noexcept {
  factorise();
  return static_cast<int>(std::count_if(inverse_pivot_.begin(), inverse_pivot_.begin() + static_cast<std::ptrdiff_t>(valid_),
                                        [](double inverse) { return inverse < 0.0; }));
}

void Solver::assume(std::span<const Contact> contact) noexcept {
  for (std::size_t i = 0; i < size_; ++i) {
    set_state(i, contact[i].state);
    contact_[i] = contact[i];
    put_force(i);
  }
  evaluate();
}

void Solver::replace(std::size_t i, std::span<const Block> row) noexcept {
  set_row(i, row);
  withdraw(i);
  enter(i);
}

void Solver::replace_own(std::size_t i, const Block& own) noexcept {
  const Block now = compliance(i, i);
  if (now[0] == own[0] && now[1] == own[1] && now[3] == own[3]) return;
  compliance_[2 * i][i] = own[0];
  compliance_[2 * i][half + i] = compliance_[2 * i + 1][i] = own[1];
  compliance_[2 * i + 1][half + i] = own[3];
  own_[i] = own;
  measured_[i] = false;
  evaluated_ = false;
  withdraw(i);
  enter(i);
}

void Solver::pop() noexcept {
  --size_;
  reaction_[2 * size_] = reaction_[2 * size_ + 1] = 0.0;  // sweeps run over it
  withdraw(size_);
  evaluated_ = false;
}

void Solver::clear() noexcept {
  size_ = unknowns_ = valid_ = 0;
  reaction_.fill(0.0);
  evaluated_ = joined_ = false;
}

void Solver::put_force(std::size_t i) noexcept {
  reaction_[2 * i] = -contact_[i].force_n[0];
  reaction_[2 * i + 1] = -contact_[i].force_n[1];
  evaluated_ = false;
}

void Solver::compose_force(std::size_t i, double axial_n, double lateral_n) noexcept {
  Contact& c = contact_[i];
  const double tx = tangent_x_[i], ty = tangent_y_[i];
  c.axial_n = axial_n, c.lateral_n = lateral_n;
  c.force_n = {axial_n * tx - lateral_n * ty, axial_n * ty + lateral_n * tx};
  put_force(i);
}

void Solver::resolve_force(std::size_t i) noexcept {
  Contact& c = contact_[i];
  const Vector2 t{tangent_x_[i], tangent_y_[i]};
  c.axial_n = dot(c.force_n, t);
  c.lateral_n = dot(c.force_n, normal(t));
}

void Solver::set_axial(std::size_t i, double axial_n) noexcept {
  if (contact_[i].axial_n == axial_n) return;
  compose_force(i, axial_n, contact_[i].lateral_n);
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
    const bool turned = tangent_x_[i] != now.tangent[0] || tangent_y_[i] != now.tangent[1];
    if (turned || !measured_[i]) {
      measured_[i] = true;
      axial_stiffness_[i] = 1.0 / quadratic(own_[i], now.tangent);
      lateral_stiffness_[i] = 1.0 / quadratic(own_[i], normal(now.tangent));
    }
    if (turned) {
      tangent_x_[i] = now.tangent[0];
      tangent_y_[i] = now.tangent[1];
      if (slipping(c.state)) {
        forget_correction();
        compose_force(i, c.axial_n, c.lateral_n);
        const bool row_holds = joined_ && std::abs(row_x_[i] - now.tangent[0]) + std::abs(row_y_[i] - now.tangent[1]) <= frame_slack;
        if (!row_holds) {
          row_x_[i] = now.tangent[0];
          row_y_[i] = now.tangent[1];
          for (std::size_t k = 0; k < first_turned; ++k)
            if (order_[k].contact == i) first_turned = k;
        }
      } else {
        resolve_force(i);
      }
    }
    if (slipping(c.state)) set_axial(i, c.state == State::SlipForward ? now.upper_n : now.lower_n);
  }
  // Stuck contacts first: their rows outlive the next turn. From the first turned one on, whatever the factor holds: the order, and with it
  // every bit, must not depend on what was skipped. (A change of state above can only have cut the factor before a shifted place.)
  valid_ = std::min(valid_, first_turned);
  if (first_turned == unknowns_) return;
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

void Solver::evaluate() noexcept {
  if (evaluated_) return;
  displacement_.fill(0.0);
  for (const std::size_t begin : {std::size_t{0}, half})
    kernel::subtract(displacement_.data(), begin, begin + size_, compliance_[0].data(), stride, reaction_.data(), 2 * size_);
  evaluated_ = true;
}

// Entries of M in rows first … unknowns_ - 1, up to the diagonal, in the place of L.
void Solver::assemble_rows(std::size_t first) noexcept {
  // Of M's row a: the products with x, with y and with the normal of every contact, one third each.
  alignas(64) std::array<double, 3 * half> row;
  std::array<std::uint16_t, 2 * capacity> place;
  std::size_t contacts = 0;  // up to the last one so far, in whole vectors
  for (std::size_t a = 0; a < unknowns_; ++a) {
    const std::size_t i = order_[a].contact;
    place[a] = static_cast<std::uint16_t>(i + half * static_cast<std::size_t>(order_[a].direction));
    contacts = std::max(contacts, (i + 4) / 4 * 4);
    if (a < first) continue;
    const Vector2 v = direction(order_[a]);
    kernel::project({row.data(), row.data() + half, row.data() + 2 * half}, contacts, v[0], v[1], compliance_[2 * i].data(),
                    compliance_[2 * i + 1].data(), half, row_x_.data(), row_y_.data());
    for (std::size_t b = 0; b <= a; ++b) factor_[b][a] = row[place[b]];
  }
  for (std::size_t b = 0; b < unknowns_; ++b) std::fill_n(&factor_[b][unknowns_], 3, 0.0);  // sweeps run over them
}

int Solver::factorise() noexcept {
  const std::size_t first = valid_;
  const std::size_t end = unknowns_;
  if (first >= end) return 0;
  assemble_rows(first);
  for (std::size_t j = 0; j < end; ++j) {
    double* column = factor_[j].data();
    // The mirror: L_jl, l < j, stands above the diagonal of this column.
    const double diagonal = column[j];
    kernel::subtract(column, std::max(j, first), end, factor_[0].data(), stride, column, j);
    if (j >= first) {
      const double least = smallest_pivot * std::abs(diagonal) + std::numeric_limits<double>::min();
      column[j] = joined_ && column[j] < -least ? column[j] : std::max(column[j], least);
      inverse_pivot_[j] = 1.0 / column[j];
    }
    const double inverse = inverse_pivot_[j];
    for (std::size_t r = std::max(j + 1, first); r < end; ++r) factor_[r][j] = column[r] * inverse;
  }
  valid_ = end;
  for (std::size_t j = first / block * block; j < end; j += block) invert_block(j);
  return static_cast<int>(end - first);
}

// The inverse of L's diagonal block from row j on, row by row: N_r = e_r - sum over l < r of L_rl N_l.
void Solver::invert_block(std::size_t j) noexcept {
  for (std::size_t r = unknowns_; r < j + block; ++r) std::fill_n(&factor_[r][j], block, 0.0);
  BlockInverse& inverse = block_inverse_[j / block];
  std::array<std::array<double, block>, block> n{};
#pragma GCC unroll 8
  for (std::size_t r = 0; r < block; ++r) {
    n[r][r] = 1.0;
#pragma GCC unroll 8
    for (std::size_t l = 0; l < r; ++l)
      for (std::size_t k = 0; k < (l < block / 2 ? block / 2 : block); ++k) n[r][k] -= factor_[j + r][j + l] * n[l][k];
  }
  inverse.by_row = n;
  // Above the diagonal there are zeros from the start.
#pragma GCC unroll 8
  for (std::size_t r = 0; r < block; ++r)
#pragma GCC unroll 8
    for (std::size_t k = 0; k <= r; ++k) inverse.by_column[k][r] = n[r][k];
}

// v.(d - u) of the working unknowns, in the tick's frame, which the row of L may lag behind.
void Solver::find_gaps(std::span<const Target> target) noexcept {
  for (std::size_t a = 0; a < unknowns_; ++a) {
    const std::size_t i = order_[a].contact;
    const Vector2 gap{target[i].gap_m[0] - displacement_[i], target[i].gap_m[1] - displacement_[half + i]};
    const bool across = order_[a].direction == Direction::Normal;
    unknown_[a] = across ? tangent_x_[i] * gap[1] - tangent_y_[i] * gap[0] : gap[order_[a].direction == Direction::X ? 0 : 1];
  }
  std::fill_n(&unknown_[unknowns_], 3, 0.0);
}

// One correction of the working unknowns: gaps into forces, by L D L^T x = v.(d - u).
void Solver::solve_unknowns() noexcept {
  double* y = unknown_.data();
  const std::size_t end = unknowns_;
  if (end == 0) return;
  // By blocks of unknowns: inside of a block the inverse of its part of L, what it does to the others is one sweep over its columns.
  // Forwards z = D^-1 L^-1 y, backwards x = L^-T z, both in place.
  for (std::size_t j = 0; j < end; j += block) {
    std::array<double, block> z = times(block_inverse_[j / block].by_column, y + j);
    for (std::size_t r = 0; r < block; ++r) y[j + r] = z[r] * inverse_pivot_[j + r];
    kernel::subtract(y, j + block, end, factor_[j].data(), stride, y + j, block);
  }
  const std::size_t blocks = (end + block - 1) / block;
  std::fill(y + end, y + block * blocks, 0.0);
  std::size_t count = end - block * (blocks - 1);
  for (std::size_t b = blocks; b-- > 0;) {
    const std::size_t j = block * b;
    const std::array<double, block> x = times(block_inverse_[b].by_row, y + j);
    std::copy_n(x.begin(), block, y + j);
    kernel::subtract(y, 0, j, factor_[j].data(), stride, y + j, count);
    count = block;
  }
}

void Solver::add_correction() noexcept {
  for (std::size_t a = 0; a < unknowns_; ++a) {
    const std::size_t i = order_[a].contact;
    if (order_[a].direction == Direction::Normal) {
      compose_force(i, contact_[i].axial_n, contact_[i].lateral_n + unknown_[a]);
    } else {
      contact_[i].force_n[order_[a].direction == Direction::X ? 0 : 1] += unknown_[a];
      resolve_force(i);
      put_force(i);
    }
  }
}

void Solver::begin_correction() noexcept {
  std::copy_n(unknown_.begin(), unknowns_, last_gap_.begin());
  std::fill_n(&last_gap_[unknowns_], 3, 0.0);
  for (const std::size_t begin : {std::size_t{0}, half})
    for (std::size_t k = begin; k < begin + size_; ++k) last_move_[k] = -displacement_[k];
}

void Solver::keep_correction() noexcept {
  std::copy_n(unknown_.begin(), unknowns_, last_correction_.begin());
  for (const std::size_t begin : {std::size_t{0}, half})
    for (std::size_t k = begin; k < begin + size_; ++k) last_move_[k] += displacement_[k];
  repeats_ = 0;
  correction_holds_ = true;
}

// The last correction in proportion, where the gaps are, up to what rounding makes of them. The factor is still that of then.
bool Solver::repeat_correction(std::span<const Target> target) noexcept {
  if (!correction_holds_) return false;
  find_gaps(target);
  const kernel::Proportion found = kernel::proportion(unknown_.data(), last_gap_.data(), unknowns_);
  if (!(std::abs(found.share) < largest_share) || !(found.rest <= proportional * found.largest)) return false;
  const double share = found.share;
  for (std::size_t a = 0; a < unknowns_; ++a) unknown_[a] = share * last_correction_[a];
  add_correction();
  for (const std::size_t begin : {std::size_t{0}, half})
    for (std::size_t k = begin; k < begin + size_; ++k) displacement_[k] += share * last_move_[k];
  evaluated_ = ++repeats_ % most_repeats != 0;
  evaluate();
  return true;
}

void Solver::judge(std::span<const Target> target, double enough_n, Violations& v) noexcept {
  v.count = 0;
  v.free_residual_n = v.residual_n = 0.0;
  const double least_n =
      std::clamp(rounding_digits * kernel::largest(reaction_.data(), 2 * size_), inner_tolerance_n, largest_inner_tolerance_n);
  v.tolerance_n = least_n;
  for (std::size_t i = 0; i < size_ && v.residual_n <= enough_n; ++i) {
    Contact& c = contact_[i];
    const Target& at = target[i];
    const Vector2 t{tangent_x_[i], tangent_y_[i]};
    const Vector2 n = normal(t);
    const Vector2 gap{at.gap_m[0] - displacement_[i], at.gap_m[1] - displacement_[half + i]};
    c.slip_m = dot(t, gap);
    const double axial_gap_n = c.slip_m * axial_stiffness_[i];
    const double lateral_n = std::abs(dot(n, gap)) * lateral_stiffness_[i];
    const double axial_n = std::abs(c.axial_n - std::clamp(c.axial_n + axial_gap_n, at.lower_n, at.upper_n));
    v.free_residual_n = std::max({v.free_residual_n, lateral_n, slipping(c.state) ? 0.0 : std::abs(axial_gap_n)});
    v.residual_n = std::max({v.residual_n, lateral_n, axial_n});
    // Not `>`: a residual that is no number must not pass for a small one.
    if (!(lateral_n < std::numeric_limits<double>::max()) || !(axial_n < std::numeric_limits<double>::max()))
      v.residual_n = v.free_residual_n = std::numeric_limits<double>::infinity();
    State becomes = c.state;
    if (c.state == State::Stuck) {
      if (c.axial_n > at.upper_n + least_n) becomes = State::SlipForward;
      if (c.axial_n < at.lower_n - least_n) becomes = State::SlipBackward;
    } else if (at.lower_n == at.upper_n) {
      c.state = becomes = c.slip_m >= 0.0 ? State::SlipForward : State::SlipBackward;
    } else if (c.state == State::SlipForward ? axial_gap_n < -least_n : axial_gap_n > least_n) {
      becomes = State::Stuck;
    }
    if (becomes != c.state) {
      const auto k = static_cast<std::size_t>(v.count++);
      v.contact[k] = static_cast<std::uint16_t>(i);
      v.becomes[k] = becomes;
    }
  }
}

// The working unknowns of the present states, refined to the floor of rounding.
void Solver::correct(std::span<const Target> target, Violations& v, Solution& solution) noexcept {
  // Where every tick makes its factor anew, no correction is worth keeping.
  const bool keep = valid_ == unknowns_;
  if (!keep) {
    solution.rows_factored += factorise();
    forget_correction();
  } else if (repeat_correction(target)) {
    judge(target, infinity, v);
    ++solution.iterations;
    solution.repeated = v.free_residual_n <= v.tolerance_n;
    if (solution.repeated) return;
    evaluated_ = false;
    evaluate();
  }
  double unrefined_n = infinity;
  for (int k = 0; k <= most_refinements && solution.iterations < max_iterations; ++k) {
    find_gaps(target);
    if (k == 0 && keep) begin_correction();
    solve_unknowns();
    add_correction();
    evaluate();
    if (k == 0 && keep) keep_correction();
    judge(target, infinity, v);
    ++solution.iterations;
    if (v.free_residual_n <= v.tolerance_n || v.free_residual_n > 0.5 * unrefined_n) break;
    unrefined_n = v.free_residual_n;
  }
}

// Block principal pivoting: all violations change state at once. False when their number stops falling.
bool Solver::exchange(std::span<const Target> target, Violations& v, Solution& solution) noexcept {
  int fewest = static_cast<int>(size_) + 1;
  int patience = block_patience;
  while (solution.iterations < max_exchanges) {
    correct(target, v, solution);
    if (v.count == 0) return true;
    if (v.count < fewest) {
      fewest = v.count;
      patience = block_patience;
    } else if (patience-- == 0) {
      return false;
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(v.count); ++k) {
      const std::size_t i = v.contact[k];
      set_state(i, v.becomes[k]);
      if (slipping(v.becomes[k])) set_axial(i, v.becomes[k] == State::SlipForward ? target[i].upper_n : target[i].lower_n);
    }
    solution.pivots += v.count;
    evaluate();
  }
  return false;
}

// Primal active set: from forces within their bounds towards the solution of the present states, up to the first bound in the way. The
// energy falls with every step, so no set of states comes twice.
bool Solver::descend(std::span<const Target> target, Violations& v, Solution& solution) noexcept {
  cut_to_bounds(target);
  evaluate();
  while (solution.iterations < max_iterations) {
    const std::array<Contact, capacity> before = contact_;
    correct(target, v, solution);
    if (!stop_at_bound(target, before, v.tolerance_n)) {
      if (v.count == 0) return true;
      release_worst(target, v);
    }
    ++solution.pivots;
    ++solution.descents;
    evaluate();
  }
  return false;
}

// A stuck contact that is cut to its bound slips: its owner has to know.
void Solver::cut_to_bounds(std::span<const Target> target) noexcept {
  for (std::size_t i = 0; i < size_; ++i) {
    const double axial_n = contact_[i].axial_n;
    if (contact_[i].state == State::Stuck && axial_n > target[i].upper_n) set_state(i, State::SlipForward);
    if (contact_[i].state == State::Stuck && axial_n < target[i].lower_n) set_state(i, State::SlipBackward);
    set_axial(i, std::clamp(axial_n, target[i].lower_n, target[i].upper_n));
  }
}

bool Solver::stop_at_bound(std::span<const Target> target, const std::array<Contact, capacity>& before, double least_n) noexcept {
  double step = 1.0;
  std::size_t blocking = size_;
  for (std::size_t i = 0; i < size_; ++i) {
    const double axial_n = contact_[i].axial_n;
    if (contact_[i].state != State::Stuck || std::abs(axial_n - std::clamp(axial_n, target[i].lower_n, target[i].upper_n)) <= least_n)
      continue;
    const double bound_n = axial_n > target[i].upper_n ? target[i].upper_n : target[i].lower_n;
    const double share = std::clamp((bound_n - before[i].axial_n) / (axial_n - before[i].axial_n), 0.0, 1.0);
    if (share < step || blocking == size_) {
      step = share;
      blocking = i;
    }
  }
  if (blocking == size_) return false;
  for (std::size_t i = 0; i < size_; ++i)
    compose_force(i, std::lerp(before[i].axial_n, contact_[i].axial_n, step), std::lerp(before[i].lateral_n, contact_[i].lateral_n, step));
  const bool above = contact_[blocking].axial_n > 0.5 * (target[blocking].lower_n + target[blocking].upper_n);
  set_state(blocking, above ? State::SlipForward : State::SlipBackward);
  set_axial(blocking, above ? target[blocking].upper_n : target[blocking].lower_n);
  return true;
}

// Of the contacts that slip against their friction, the one with the largest force to gain sticks.
void Solver::release_worst(std::span<const Target> target, const Violations& v) noexcept {
  std::size_t worst = 0;
  double most_n = -1.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(v.count); ++k) {
    const std::size_t i = v.contact[k];
    const double gain_n = std::abs(contact_[i].slip_m) / quadratic(own_[i], target[i].tangent);
    if (v.becomes[k] == State::Stuck && gain_n > most_n) {
      most_n = gain_n;
      worst = i;
    }
  }
  if (most_n >= 0.0) set_state(worst, State::Stuck);
}

Solution Solver::solve(std::span<const Target> target) noexcept {
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
  // Whether the last forces are the solution of this tick too: the first contact that they do not hold settles it.
  judge(target, settled_n, v);
  const bool rests = v.count == 0 && v.residual_n <= settled_n;
  // Where something in series makes M indefinite, no energy falls along a descent.
  const bool limited = !rests && !exchange(target, v, solution) && (joined_ || !descend(target, v, solution));
  if (limited) {
    cut_to_bounds(target);
    evaluate();
    judge(target, infinity, v);
  }
  if (!std::isfinite(v.residual_n)) {
    // Nothing that is no number may reach the next tick.
    for (std::size_t i = 0; i < size_; ++i) {
      contact_[i].axial_n = contact_[i].lateral_n = 0.0;
      contact_[i].force_n = {};
      put_force(i);
    }
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
