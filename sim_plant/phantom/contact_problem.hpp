// Contacts between tissue and a straight needle: lateral ties and incremental Tresca friction, solved to a residual.
//
//   Unknown: per contact the force of the needle on the tissue, axial f_a (along t) and lateral f_n (along n), N.
//   t = (cos theta, sin theta), n = (-sin theta, cos theta); G the tissue's compliance at the contacts in the rig frame, m/N.
//   With u = G f and the displacements a, b that would keep a contact's place on the shaft and bring it onto the axis:
//     lateral   n.u_i + c_i f_n,i = b_i                                           (c_i >= 0 softens the tie)
//     axial     ds_i = a_i - t.u_i  slip of the needle relative to the tissue in this step,
//               lower_i <= f_a,i <= upper_i;  ds_i > 0 only at upper_i,  ds_i < 0 only at lower_i
//   For fixed theta and bounds this is a strictly convex box-constrained QP: one solution. Block principal pivoting finds it
//   (Kostreva; single pivots when the number of violations stops falling); the factor of the free unknowns is kept between calls
//   and corrected by refinement, so that a call without a change of state costs a few mat-vecs.
//   Residual, N: max of |f_a - clip(f_a + ds / G_aa, lower, upper)| and |lateral gap| / G_nn.
//
// Contacts are added and removed at the end only (the needle's tip). Nothing allocates after construction.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace trocar::sim_plant {

using Block = std::array<double, 4>;  // xx, xy, yx, yy

enum class AxialState : std::uint8_t { Stuck, SlipsForward, SlipsBackward };

struct ContactInput {
  double axial_m{};    // a
  double lateral_m{};  // b
  double softness{};   // c, m/N
  double lower_n{};    // <= 0
  double upper_n{};    // >= 0
};

struct ContactForce {
  double axial_n{};
  double lateral_n{};
  double slip_m{};         // ds
  double lateral_gap_m{};  // c f_n when solved
  AxialState state{AxialState::SlipsForward};
};

struct ContactSolution {
  bool converged{true};
  int pivots{};  // state changes tried, block or single
  int factorisations{};
  double residual_n{};
};

class ContactProblem {
 public:
  static constexpr int max_pivots = 100;
  static constexpr double tolerance_n = 1e-9;

  explicit ContactProblem(std::size_t capacity);

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] std::size_t capacity() const noexcept { return capacity_; }

  // `row[j]` couples the new contact with contact j < size(), row[size()] is its own block: u_new += row[j] f_j.
  // A compliance of regularisation * (trace of the own block) is added to the own block: contacts that share their
  // elements' nodes make G nearly singular.
  void push(std::span<const Block> row) noexcept;  // precondition: size() < capacity()
  void pop() noexcept;
  void clear() noexcept;

  // `input` has size() entries. Starts from the forces and states of the last call.
  ContactSolution solve(double cosine, double sine, std::span<const ContactInput> input) noexcept;
  [[nodiscard]] const ContactForce& contact(std::size_t i) const noexcept { return contact_[i]; }
  [[nodiscard]] double self_compliance(std::size_t i) const noexcept { return 0.5 * (at(2 * i, 2 * i) + at(2 * i + 1, 2 * i + 1)); }

 private:
  static constexpr double regularisation = 1e-6;

  [[nodiscard]] double& at(std::size_t row, std::size_t column) noexcept { return compliance_[column * stride_ + row]; }
  [[nodiscard]] double at(std::size_t row, std::size_t column) const noexcept { return compliance_[column * stride_ + row]; }
  void evaluate(std::span<const ContactInput> input) noexcept;
  bool factorise(std::span<const ContactInput> input) noexcept;
  void correct() noexcept;
  bool solve_free(std::span<const ContactInput> input, ContactSolution& solution) noexcept;
  std::size_t exchange(std::span<const ContactInput> input, bool only_last) noexcept;
  [[nodiscard]] double free_residual() const noexcept;

  std::size_t capacity_, stride_, size_{0};
  double cosine_{1.0}, sine_{0.0};
  std::vector<double> compliance_;  // G, column by column, rig frame
  std::vector<double> factor_;      // lower: L column by column; above the diagonal its mirror image
  std::vector<std::size_t> free_;   // unknowns in the factor: 2 i axial, 2 i + 1 lateral
  std::size_t free_count_{0};
  bool factored_{false};
  std::vector<double> force_, displacement_, gap_, diagonal_, work_;  // rig frame, rig frame, then local
  std::vector<ContactForce> contact_;
};

}  // namespace trocar::sim_plant
