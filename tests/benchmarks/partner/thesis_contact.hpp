// The contact algorithm of DiMaio's thesis (5.2, 5.4, 6.2, 6.3; flow chart figure 5.19), implemented as well as it goes, to be compared
// with:
//   x = S y      m = 2 s, two components a contact in its own frame, axial then lateral; of each pair (u, f) one is in y (known), the other
//   in x swap at i    S <- S - c r / p, p = S_ii, c = column i with p + 1, r = row i with p - 1 on the diagonal            2 m^2 operations
//   rotation of one contact's frame by an angle with cosine c and sine s, J = [[0, 1], [-1, 0]]:
//     stuck      both components of one kind: rows and columns of the contact times R = c + s J                       O(m)
//     slipping   y_I' = c y_I + s J x_I, x_I' = c x_I + s J y_I; with B = c + s J S_II, this is (5.8) worked out:
//                S_EE' = S_EE - s S_EI B^-1 J S_IE     S_EI' = S_EI B^-1     S_II' = (c S_II + s J) B^-1
//                S_IE' = c S_IE - s S_II' J S_IE                                                                      4 m^2 operations
// A tick: one transition of figure 5.4's automaton per contact, judged by the last tick's solution; the swaps that follow from it; the
// frames one after another; one product. Nothing is iterated, so a tick's forces may lie beyond their thresholds, and no fresh matrix is
// ever made, so that rounding stays. The full matrix is kept, as in the thesis, though S is symmetric up to signs. Differences from the
// print: the factors p + 1 and p - 1 (the print has p - 1 twice, which is wrong); row and column i of a swap are written directly, because
// p - (p + 1) (p - 1) / p loses digits for large p; a contact that joins while others are swapped gets its row by the same algebra (the
// print is silent); a dead band on slip keeps rounding from being taken for a reversal.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <span>

#include "common/core/capacities.hpp"
#include "tests/reference/box_qp.hpp"

namespace trocar::partner {

using Target = reference::Contact;
using State = reference::Axial;

class ThesisContact {
 public:
  struct Report {
    int transitions{};
    int rotations{};
  };

  // Blocks of the pristine compliance [m/N], rig frame: row[j] between the new contact and contact j, row[size()] its own. The contact
  // joins stuck. False when the capacity is used up.
  bool append(std::span<const Eigen::Matrix2d> row, const Target& target) noexcept;
  void pop() noexcept;  // the contact that joined last leaves

  // One target a contact; tangents of unit length. From the state of the last tick to this tick's x = S y.
  Report solve(std::span<const Target> target) noexcept;

  // For tests: sets a state without asking the automaton.
  void force_state(std::size_t contact, State state) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] State state(std::size_t contact) const noexcept { return node_[contact].state; }
  [[nodiscard]] Eigen::Vector2d force_n(std::size_t contact) const noexcept;         // on the tissue, rig frame
  [[nodiscard]] Eigen::Vector2d displacement_m(std::size_t contact) const noexcept;  // rig frame
  [[nodiscard]] double slip_m(std::size_t contact) const noexcept { return node_[contact].slip_m; }

 private:
  static constexpr std::size_t limit = 2 * capacity::contacts;
  using Column = std::array<double, limit>;
  struct Node {
    State state{};
    std::array<double, 2> tangent{};
    double slip_m{};  // of the last tick, 0 while stuck
  };

  [[nodiscard]] std::size_t order() const noexcept { return 2 * size_; }
  [[nodiscard]] double* column(std::size_t j) noexcept { return s_.data() + j * stride_; }
  [[nodiscard]] double& at(std::size_t i, std::size_t j) noexcept { return s_[j * stride_ + i]; }
  void resize(std::size_t contacts) noexcept;
  void swap(std::size_t i) noexcept;
  void rotate(std::size_t contact, const std::array<double, 2>& tangent) noexcept;
  void rotate_stuck(std::size_t first, double c, double s) noexcept;
  void rotate_slipping(std::size_t first, double c, double s) noexcept;
  int transition(std::size_t contact, const Target& target) noexcept;

  alignas(64) std::array<double, limit * limit> s_{};  // column after column, `stride_` apart: a multiple of 4, zeros below row m
  alignas(64) Column x_{};
  alignas(64) Column y_{};
  alignas(64) std::array<Column, 4> work_{};
  std::array<Node, capacity::contacts> node_{};
  std::size_t size_{};
  std::size_t stride_{};
};

}  // namespace trocar::partner
