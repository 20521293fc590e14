// Contacts between tissue and needle: lateral ties and incremental Tresca friction, solved to a residual every tick.
//
//   Unknown: the force f_i of the needle on the tissue at each contact, N, rig frame. G: compliance of the tissue at the contacts, m/N,
//   2 s x 2 s, symmetric positive definite, rig frame. u = G f. Target d_i: the displacement that would put contact i on the
//   needle's axis at the arclength where it is anchored; t_i unit tangent of the needle there, n_i = (-t_y, t_x).
//     lateral   n.(d_i - u_i) = 0
//     axial     ds_i = t.(d_i - u_i), the slip of the needle relative to the tissue in this tick,
//               lower_i <= t.f_i <= upper_i,  ds_i > 0 only at upper_i,  ds_i < 0 only at lower_i       (MODELS 5)
//   A strictly convex box-constrained quadratic programme: one solution. Block principal pivoting walks to it from the states of
//   the last tick, and to single pivots (Murty's least index) when the number of violations stops falling.
//   Residual, N: max of |t.f - clip(t.f + ds / G_tt, lower, upper)| and |n.(d - u)| / G_nn.
//
// Working unknowns, in this order: x and y of a stuck contact (frame-free), n of a slipping one; M = their compliance = L L^T.
// L is kept row by row: a row depends only on G and on the rows before it, never on its own history. So an exchange cuts L
// behind the changed contact and continues it from the pristine G, a turn of the needle leaves the stuck contacts' rows as they are, and
// nothing drifts however many exchanges there were.
//
// Fixed size, no allocation, bounded loops. Sums run in one order: same inputs, same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/core/capacities.hpp"

namespace trocar::contact {

using Vector2 = std::array<double, 2>;
using Block = std::array<double, 4>;  // xx, xy, yx, yy

enum class State : std::uint8_t { Stuck, SlipForward, SlipBackward };

enum class SolverStatus : std::uint8_t {
  Ok,
  PivotLimit,      // the bound on pivots was hit: forces are within their bounds, the residual says how far they are from the solution
  IllConditioned,  // the residual stays above the tolerance
  NotFinite,       // an input is not finite, a lower bound above its upper one, or a force would have to be infinite: nothing was changed
};

struct Target {
  Vector2 tangent{1.0, 0.0};
  Vector2 gap_m{};   // d
  double lower_n{};  // <= upper_n; infinite bounds are allowed (a glued contact)
  double upper_n{};
};

struct Contact {
  Vector2 force_n{};  // on the tissue, rig frame
  double axial_n{};
  double lateral_n{};
  double slip_m{};  // ds
  State state{State::SlipForward};
};

struct Solution {
  SolverStatus status{SolverStatus::Ok};
  int pivots{};         // contacts that changed state
  int iterations{};     // solves with the factor
  int rows_factored{};  // rows of L that had to be computed
  double residual_n{};
};

class Solver {
 public:
  static constexpr std::size_t capacity = capacity::contacts;
  static constexpr double tolerance_n = 1e-9;  // of the residual
  static constexpr int max_iterations = 64;
  static constexpr int max_pivots = 8 * static_cast<int>(capacity);

  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  // `row[j]` couples the new contact with contact j < size(), row[size()] is its own block (any regularisation already in it).
  // It starts force-free and slipping forward. Precondition: size() < capacity.
  void push(std::span<const Block> row) noexcept;
  // The compliance of contact i changed: blocks with contacts 0 … i. Forces and states stay.
  void replace(std::size_t i, std::span<const Block> row) noexcept;
  void replace_own(std::size_t i, const Block& own) noexcept;
  void pop() noexcept;
  void clear() noexcept;

  // `target` has size() entries.
  Solution solve(std::span<const Target> target) noexcept;

  [[nodiscard]] const Contact& contact(std::size_t i) const noexcept { return contact_[i]; }
  [[nodiscard]] Vector2 displacement_m(std::size_t i) const noexcept { return {displacement_[2 * i], displacement_[2 * i + 1]}; }
  [[nodiscard]] Block compliance(std::size_t i, std::size_t j) const noexcept {
    return {g(2 * i, 2 * j), g(2 * i, 2 * j + 1), g(2 * i + 1, 2 * j), g(2 * i + 1, 2 * j + 1)};
  }
  // Sets the state from which the next solve starts. For tests and benchmarks: the solution does not depend on it.
  void start_from(std::size_t i, State state) noexcept;

  // Skipping: the next solve computes every row of L again, in the same order. Changes no bit of the result.
  void forget_factor() noexcept { valid_ = 0; }
  // Largest difference between L and one made afresh from G in the same order, relative to its largest entry. For tests: O(s^3).
  [[nodiscard]] double factor_drift() noexcept;

 private:
  enum class Direction : std::uint8_t { X, Y, Normal };
  struct Unknown {
    std::uint16_t contact{};
    Direction direction{};
  };
  // A multiple of 8, but not of 64: columns that start at the same cache set would evict each other.
  static constexpr std::size_t stride = 2 * capacity + 8;
  using Column = std::array<double, stride>;

  [[nodiscard]] double g(std::size_t row, std::size_t column) const noexcept { return compliance_[column][row]; }
  [[nodiscard]] Vector2 direction(const Unknown& unknown) const noexcept;
  void set_row(std::size_t i, std::span<const Block> row) noexcept;
  void withdraw(std::size_t i) noexcept;  // from the working order; cuts the factor
  void enter(std::size_t i) noexcept;     // at the end of the working order
  void set_state(std::size_t i, State state) noexcept;
  void turn(std::span<const Target> target) noexcept;
  void set_axial(std::size_t i, double axial_n) noexcept;
  void evaluate() noexcept;  // u = G f
  int factorise() noexcept;
  void assemble_rows(std::size_t first) noexcept;
  void solve_unknowns(std::span<const Target> target) noexcept;
  struct Violations {
    int count{};
    double free_residual_n{};
    double residual_n{};
    std::array<std::uint16_t, capacity> contact{};
    std::array<State, capacity> becomes{};
  };
  void judge(std::span<const Target> target, Violations& violations) noexcept;

  std::size_t size_{0};
  std::size_t unknowns_{0};
  std::size_t valid_{0};  // rows of L that hold
  alignas(64) std::array<Column, 2 * capacity> compliance_{};
  // Column j: L_ij below the diagonal, the mirror L_ji above it, so that both triangular solves run along columns.
  alignas(64) std::array<Column, 2 * capacity> factor_{};
  alignas(64) Column force_{}, displacement_{}, work_{};
  std::array<double, 2 * capacity> inverse_pivot_{};
  std::array<Unknown, 2 * capacity> order_{};
  std::array<Vector2, capacity> tangent_{};
  std::array<Contact, capacity> contact_{};
  bool evaluated_{true};
};

}  // namespace trocar::contact
