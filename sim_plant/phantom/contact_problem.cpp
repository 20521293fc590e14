#include "sim_plant/phantom/contact_problem.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::sim_plant {

ContactProblem::ContactProblem(std::size_t capacity)
    : capacity_(capacity),
      stride_(2 * capacity),
      compliance_(stride_ * stride_),
      factor_(stride_ * stride_),
      free_(stride_),
      force_(stride_),
      displacement_(stride_),
      gap_(stride_),
      diagonal_(stride_),
      work_(stride_),
      contact_(capacity) {}

void ContactProblem::push(std::span<const Block> row) noexcept {
  const std::size_t i = size_++;
  for (std::size_t j = 0; j <= i; ++j)
    for (std::size_t a = 0; a < 2; ++a)
      for (std::size_t b = 0; b < 2; ++b) {
        at(2 * i + a, 2 * j + b) = row[j][2 * a + b];
        at(2 * j + b, 2 * i + a) = row[j][2 * a + b];
      }
  const double extra = regularisation * (row[i][0] + row[i][3]);
  at(2 * i, 2 * i) += extra;
  at(2 * i + 1, 2 * i + 1) += extra;
  contact_[i] = {};
  factored_ = false;
}

void ContactProblem::pop() noexcept {
  if (size_ > 0) --size_;
  factored_ = false;
}

void ContactProblem::clear() noexcept {
  size_ = 0;
  factored_ = false;
}

// gap_ = what remains of each local equation: slip for axial rows, lateral gap for lateral rows.
void ContactProblem::evaluate(std::span<const ContactInput> input) noexcept {
  const std::size_t n = 2 * size_;
  for (std::size_t i = 0; i < size_; ++i) {
    force_[2 * i] = cosine_ * contact_[i].axial_n - sine_ * contact_[i].lateral_n;
    force_[2 * i + 1] = sine_ * contact_[i].axial_n + cosine_ * contact_[i].lateral_n;
  }
  std::fill_n(displacement_.begin(), n, 0.0);
  double* const u = displacement_.data();
  for (std::size_t j = 0; j < n; ++j) {
    const double f = force_[j];
    const double* const column = &compliance_[j * stride_];
    for (std::size_t i = 0; i < n; ++i) u[i] += column[i] * f;
  }
  for (std::size_t i = 0; i < size_; ++i) {
    const double along = cosine_ * u[2 * i] + sine_ * u[2 * i + 1];
    const double across = -sine_ * u[2 * i] + cosine_ * u[2 * i + 1];
    gap_[2 * i] = input[i].axial_m - along;
    gap_[2 * i + 1] = input[i].lateral_m - across - input[i].softness * contact_[i].lateral_n;
    diagonal_[2 * i] = cosine_ * (cosine_ * at(2 * i, 2 * i) + 2 * sine_ * at(2 * i + 1, 2 * i)) + sine_ * sine_ * at(2 * i + 1, 2 * i + 1);
    diagonal_[2 * i + 1] = at(2 * i, 2 * i) + at(2 * i + 1, 2 * i + 1) - diagonal_[2 * i] + input[i].softness;
  }
}

double ContactProblem::free_residual() const noexcept {
  double worst = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    worst = std::max(worst, std::abs(gap_[2 * i + 1]) / diagonal_[2 * i + 1]);
    if (contact_[i].state == AxialState::Stuck) worst = std::max(worst, std::abs(gap_[2 * i]) / diagonal_[2 * i]);
  }
  return worst;
}

bool ContactProblem::factorise(std::span<const ContactInput> input) noexcept {
  free_count_ = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    if (contact_[i].state == AxialState::Stuck) free_[free_count_++] = 2 * i;
    free_[free_count_++] = 2 * i + 1;
  }
  const std::size_t n = free_count_;
  const auto direction = [this](std::size_t unknown) {
    return unknown % 2 == 0 ? std::array<double, 2>{cosine_, sine_} : std::array<double, 2>{-sine_, cosine_};
  };
  for (std::size_t q = 0; q < n; ++q) {
    const auto e = direction(free_[q]);
    const std::size_t j = free_[q] & ~std::size_t{1};
    for (std::size_t p = q; p < n; ++p) {
      const auto d = direction(free_[p]);
      const std::size_t i = free_[p] & ~std::size_t{1};
      factor_[q * stride_ + p] = d[0] * (at(i, j) * e[0] + at(i, j + 1) * e[1]) + d[1] * (at(i + 1, j) * e[0] + at(i + 1, j + 1) * e[1]);
    }
    if (free_[q] % 2 == 1) factor_[q * stride_ + q] += input[free_[q] / 2].softness;
  }
  for (std::size_t k = 0; k < n; ++k) {
    double* const column = &factor_[k * stride_];
    if (!(column[k] > 0.0)) return false;
    const double inverse = 1.0 / std::sqrt(column[k]);
    for (std::size_t i = k; i < n; ++i) column[i] *= inverse;
    for (std::size_t j = k + 1; j < n; ++j) {
      double* const target = &factor_[j * stride_];
      const double scale = column[j];
      for (std::size_t i = j; i < n; ++i) target[i] -= column[i] * scale;
      target[k] = scale;  // mirror image, for the backward pass
    }
  }
  factored_ = true;
  return true;
}

// One step of refinement on the free unknowns with the factor at hand, which may belong to a slightly different angle.
void ContactProblem::correct() noexcept {
  const std::size_t n = free_count_;
  double* const x = work_.data();
  for (std::size_t p = 0; p < n; ++p) x[p] = gap_[free_[p]];
  for (std::size_t k = 0; k < n; ++k) {
    const double* const column = &factor_[k * stride_];
    x[k] /= column[k];
    for (std::size_t i = k + 1; i < n; ++i) x[i] -= column[i] * x[k];
  }
  for (std::size_t k = n; k-- > 0;) {
    const double* const row = &factor_[k * stride_];
    x[k] /= row[k];
    for (std::size_t i = 0; i < k; ++i) x[i] -= row[i] * x[k];
  }
  for (std::size_t p = 0; p < n; ++p) {
    ContactForce& c = contact_[free_[p] / 2];
    (free_[p] % 2 == 0 ? c.axial_n : c.lateral_n) += x[p];
  }
}

bool ContactProblem::solve_free(std::span<const ContactInput> input, ContactSolution& solution) noexcept {
  constexpr int max_corrections = 12;
  bool fresh = false;
  if (!factored_) {
    if (!factorise(input)) return false;
    ++solution.factorisations;
    fresh = true;
  }
  evaluate(input);
  // Forces of giganewtons (thresholds that stand for "never slips") have no nano-newtons in a double.
  double largest = 0.0;
  for (std::size_t i = 0; i < size_; ++i) largest = std::max(largest, std::abs(contact_[i].axial_n));
  const double tolerance = std::max(0.1 * tolerance_n, 1e-12 * largest);
  double residual = free_residual();
  for (int k = 0; k < max_corrections && !(residual <= tolerance); ++k) {
    correct();
    evaluate(input);
    const double next = free_residual();
    if (!(next < 0.1 * residual) && next > tolerance && !fresh) {
      if (!factorise(input)) return false;
      ++solution.factorisations;
      fresh = true;
    }
    residual = next;
  }
  return residual <= tolerance;
}

// Changes the state of axial unknowns that break their condition (of the last one only, or of all); returns how many break it.
std::size_t ContactProblem::exchange(std::span<const ContactInput> input, bool only_last) noexcept {
  std::size_t violations = 0;
  for (std::size_t i = size_; i-- > 0;) {
    ContactForce& c = contact_[i];
    const ContactInput& in = input[i];
    // A contact without friction has no state to choose.
    if (in.upper_n - in.lower_n <= tolerance_n) continue;
    const double pull = gap_[2 * i] / diagonal_[2 * i];
    AxialState next = c.state;
    if (c.state == AxialState::Stuck) {
      if (c.axial_n > in.upper_n + 0.5 * tolerance_n) next = AxialState::SlipsForward;
      if (c.axial_n < in.lower_n - 0.5 * tolerance_n) next = AxialState::SlipsBackward;
    } else if (c.state == AxialState::SlipsForward ? pull < -0.5 * tolerance_n : pull > 0.5 * tolerance_n) {
      next = AxialState::Stuck;
    }
    if (next == c.state) continue;
    ++violations;
    if (only_last && violations > 1) continue;
    c.state = next;
    factored_ = false;
  }
  return violations;
}

ContactSolution ContactProblem::solve(double cosine, double sine, std::span<const ContactInput> input) noexcept {
  constexpr int patience = 5;
  ContactSolution solution;
  cosine_ = cosine;
  sine_ = sine;
  std::size_t fewest = 2 * size_ + 1;
  int stalled = 0;
  solution.converged = false;
  for (; solution.pivots < max_pivots; ++solution.pivots) {
    for (std::size_t i = 0; i < size_; ++i) {
      ContactForce& c = contact_[i];
      if (input[i].upper_n - input[i].lower_n <= tolerance_n && c.state == AxialState::Stuck) {
        c.state = AxialState::SlipsForward;
        factored_ = false;
      }
      if (c.state == AxialState::SlipsForward) c.axial_n = input[i].upper_n;
      if (c.state == AxialState::SlipsBackward) c.axial_n = input[i].lower_n;
    }
    if (!solve_free(input, solution)) break;
    const std::size_t violations = exchange(input, stalled >= patience);
    if (violations == 0) {
      solution.converged = true;
      break;
    }
    if (violations < fewest) {
      fewest = violations;
      stalled = 0;
    } else {
      ++stalled;
    }
  }
  for (std::size_t i = 0; i < size_; ++i) {
    ContactForce& c = contact_[i];
    const double wanted = std::clamp(c.axial_n + gap_[2 * i] / diagonal_[2 * i], input[i].lower_n, input[i].upper_n);
    solution.residual_n = std::max({solution.residual_n, std::abs(c.axial_n - wanted), std::abs(gap_[2 * i + 1]) / diagonal_[2 * i + 1]});
    // Out of pivots: stay inside of the friction limits rather than pull harder than the tissue can.
    if (!solution.converged) c.axial_n = std::clamp(c.axial_n, input[i].lower_n, input[i].upper_n);
    c.slip_m = c.state == AxialState::Stuck ? 0.0 : gap_[2 * i];
    c.lateral_gap_m = input[i].softness * c.lateral_n;
  }
  return solution;
}

}  // namespace trocar::sim_plant
