// Contacts between tissue and needle: lateral ties and incremental Tresca friction, solved to a residual every tick.
//
//   Unknown: the force f_i of the needle on the tissue at each contact, N, rig frame. G: compliance of the tissue at the contacts, m/N,
//   2 s x 2 s, symmetric positive definite, rig frame. u = G f. Target d_i: the displacement that would put contact i on the
//   needle's axis at the arclength where it is anchored; t_i unit tangent of the needle there, n_i = (-t_y, t_x).
//     lateral   n.(d_i - u_i) = 0
//     axial     ds_i = t.(d_i - u_i), the slip of the needle relative to the tissue in this tick,
//               lower_i <= t.f_i <= upper_i,  ds_i > 0 only at upper_i,  ds_i < 0 only at lower_i       (MODELS 5)
//   A strictly convex box-constrained quadratic programme: one solution. Block principal pivoting walks to it from the states of
//   the last tick; when the number of violations stops falling, a primal active-set method, which cannot cycle, takes over.
//   Residual, N: max of |t.f - clip(t.f + ds / G_tt, lower, upper)| and |n.(d - u)| / G_nn.
//
// Working unknowns, in this order: x and y of a stuck contact (frame-free), n of a slipping one; M = their compliance = L D L^T.
// L is kept row by row: a row depends only on G and on the rows before it, never on its own history. So an exchange cuts L
// behind the changed contact and continues it from the pristine G, a turn of the needle leaves the stuck contacts' rows as they are, and
// nothing drifts however many exchanges there were.
//
// A needle that goes straight on moves all its gaps in proportion to the tick before. Then the last correction is repeated in proportion,
// forces and displacements, in O(s); the residual is judged as ever, and decides.
//
// Fixed size, no allocation, bounded loops. Sums run in one order: same inputs, same bits.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/contact/vector.hpp"
#include "common/core/capacities.hpp"
#include "common/core/precision.hpp"

namespace trocar::contact {

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
  int descents{};       // steps of the active-set method, where block pivoting did not end
  int rows_factored{};  // rows of L that had to be computed
  bool repeated{};      // the last correction in proportion was the solution
  double residual_n{};
};

class Solver {
 public:
  static constexpr std::size_t capacity = capacity::contacts;
  static constexpr double tolerance_n = tolerance(1e-9, 1e-4);  // of the residual
  static constexpr int max_exchanges = 32;                      // iterations of block pivoting
  static constexpr int max_iterations = 256;                    // altogether
  static constexpr int max_pivots = max_exchanges * static_cast<int>(capacity) + max_iterations;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }

  // `row[j]` couples the new contact with contact j < size(), row[size()] is its own block (any regularisation already in it).
  // It starts force-free and slipping forward. Precondition: size() < capacity.
  void push(std::span<const Block> row) noexcept;
  // The same, from a force (its parts hold in whatever frame comes next while it slips) and a state.
  void push(std::span<const Block> row, const Contact& start) noexcept;
  // Starts from `tissue`, whose compliance something in series makes softer: a needle that bends. `softness` has the columns x and y of
  // contact 0, of contact 1, …, each `part` displacements x and then as many y, part >= size(). The sum may be indefinite although the
  // whole is stable, so pivots may be negative; residuals are measured in the tissue's own compliances; and a slipping contact's row
  // outlives turns up to frame_slack, the refinement takes the difference. No push, replace or pop until clear().
  void join(const Solver& tissue, std::span<const double> softness, std::size_t part) noexcept;
  static constexpr double frame_slack = 1e-3;
  [[nodiscard]] int negative_pivots() noexcept;  // negative eigenvalues of M, of the present states
  // Takes force, state and slip from elsewhere: u = G f follows at once.
  void assume(std::span<const Contact> contact) noexcept;
  // The compliance of contact i changed: blocks with contacts 0 … i. Forces and states stay.
  void replace(std::size_t i, std::span<const Block> row) noexcept;
  void replace_own(std::size_t i, const Block& own) noexcept;
  void pop() noexcept;
  void clear() noexcept;

  // `target` has size() entries.
  Solution solve(std::span<const Target> target) noexcept;

  [[nodiscard]] const Contact& contact(std::size_t i) const noexcept { return contact_[i]; }
  [[nodiscard]] Vector2 displacement_m(std::size_t i) const noexcept { return {displacement_[i], displacement_[half + i]}; }
  [[nodiscard]] Block compliance(std::size_t i, std::size_t j) const noexcept {
    const Column& x = compliance_[2 * j];
    const Column& y = compliance_[2 * j + 1];
    return {x[i], y[i], x[half + i], y[half + i]};
  }
  // Sets the state from which the next solve starts. For tests and benchmarks: the solution does not depend on it.
  void start_from(std::size_t i, State state) noexcept;

  // Skipping: the next solve computes every row of L again, in the same order. Changes no bit of the result.
  void forget_factor() noexcept { valid_ = 0; }
  // Skipping: the next solve does not repeat the last correction. Changes its result by rounding.
  void forget_correction() noexcept { correction_holds_ = false; }
  // Largest difference between L and one made afresh from G in the same order, relative to its largest entry. For tests: O(s^3).
  [[nodiscard]] double factor_drift() noexcept;

 private:
  enum class Direction : std::uint8_t { X, Y, Normal };
  struct Unknown {
    std::uint16_t contact{};
    Direction direction{};
  };
  // A vector over the contacts keeps all x before all y, so that loops run in whole vectors. y begins at `half`: a multiple of 4, while
  // 2 * half is none of 64, because columns that start at the same cache set would evict each other.
  static constexpr std::size_t half = capacity + 4;
  static constexpr std::size_t stride = 2 * half;
  using Column = std::array<double, stride>;

  [[nodiscard]] Vector2 direction(const Unknown& unknown) const noexcept;
  void put_force(std::size_t i) noexcept;                                        // force_n into -f
  void compose_force(std::size_t i, double axial_n, double lateral_n) noexcept;  // sets the parts, force_n and -f
  void resolve_force(std::size_t i) noexcept;                                    // the parts from force_n
  void set_row(std::size_t i, std::span<const Block> row) noexcept;
  void withdraw(std::size_t i) noexcept;  // from the working order; cuts the factor
  void enter(std::size_t i) noexcept;     // at the end of the working order
  void set_state(std::size_t i, State state) noexcept;
  void turn(std::span<const Target> target) noexcept;
  void set_axial(std::size_t i, double axial_n) noexcept;
  void evaluate() noexcept;  // u = G f
  int factorise() noexcept;
  void invert_block(std::size_t first) noexcept;
  void assemble_rows(std::size_t first) noexcept;
  void find_gaps(std::span<const Target> target) noexcept;
  void solve_unknowns() noexcept;
  void add_correction() noexcept;
  void begin_correction() noexcept;
  void keep_correction() noexcept;
  bool repeat_correction(std::span<const Target> target) noexcept;
  void cut_to_bounds(std::span<const Target> target) noexcept;
  struct Violations {
    int count{};
    double free_residual_n{};
    double residual_n{};
    double tolerance_n{};  // that a violation has to exceed
    std::array<std::uint16_t, capacity> contact{};
    std::array<State, capacity> becomes{};
  };
  // Stops behind the first contact whose residual is more than `enough_n`.
  void judge(std::span<const Target> target, double enough_n, Violations& violations) noexcept;
  void correct(std::span<const Target> target, Violations& violations, Solution& solution) noexcept;
  bool exchange(std::span<const Target> target, Violations& violations, Solution& solution) noexcept;
  bool descend(std::span<const Target> target, Violations& violations, Solution& solution) noexcept;
  // Goes back towards `before` until no stuck contact is beyond a bound; that which was slips.
  bool stop_at_bound(std::span<const Target> target, const std::array<Contact, capacity>& before, double least_n) noexcept;
  void release_worst(std::span<const Target> target, const Violations& violations) noexcept;

  std::size_t size_{0};
  std::size_t unknowns_{0};
  std::size_t valid_{0};                                       // rows of L that hold
  alignas(64) std::array<Column, 2 * capacity> compliance_{};  // columns x and y of contact 0, of contact 1, …
  // Column j: D_jj on the diagonal, L_ij D_jj below it, the mirror L_ji above it, so that both triangular solves run along columns.
  // Loops run up to 3 rows behind the last unknown; those rows are zero.
  alignas(64) std::array<Column, 2 * capacity> factor_{};
  alignas(64) Column displacement_{}, unknown_{};
  alignas(64) std::array<double, 2 * capacity> reaction_{};  // -f: x and y of contact 0, of contact 1, …
  alignas(64) std::array<double, half> tangent_x_{}, tangent_y_{};
  alignas(64) std::array<double, half> row_x_{}, row_y_{};                // tangents that the rows of L were made with
  std::array<Block, capacity> own_{};                                     // compliances by which residuals are measured
  std::array<double, capacity> axial_stiffness_{}, lateral_stiffness_{};  // their inverses in the frames of the tick, where measured_
  std::array<bool, capacity> measured_{};
  std::array<double, 2 * capacity> inverse_pivot_{};
  static constexpr std::size_t block = 8;
  struct BlockInverse {
    std::array<std::array<double, block>, block> by_row{}, by_column{};
  };
  alignas(64) std::array<BlockInverse, 2 * capacity / block> block_inverse_{};  // of L's diagonal blocks
  std::array<Unknown, 2 * capacity> order_{};
  // The last correction of a whole factor: gaps of the unknowns, the forces that closed them, and the displacements that these caused.
  alignas(64) Column last_gap_{}, last_correction_{}, last_move_{};
  static constexpr int most_repeats = 16;  // before displacements are summed afresh
  int repeats_{0};
  bool correction_holds_{false};
  std::array<Contact, capacity> contact_{};
  bool evaluated_{true};
  bool joined_{false};
};

}  // namespace trocar::contact
