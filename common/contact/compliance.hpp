// Compliance between embedded points, G_ab = H_a A H_b^T, from the image's candidate block, and from the mesh as adapted since.
//
// Mesh adaptation (MODELS 6c). Moving node n changes the stiffness of the cells around it alone: K_k = K_(k-1) + V_k dK_k V_k^T, V_k
// selecting the degrees of freedom of that patch. With b_k(a) = H_a A_(k-1) V_k (2 x p), by Sherman, Morrison and Woodbury
//     A_k = A_(k-1) - A_(k-1) V_k M_k V_k^T A_(k-1),   M_k = dK_k (1 + V_k^T A_(k-1) V_k dK_k)^-1, symmetric
//     G_ab = H_a A_0 H_b^T - sum_k b_k(a) M_k b_k(b)^T
// Only rows in use are ever updated: b_k of a node that comes into use follows from A_0 and from T_lk = V_l-rows of patch k,
//     b_k(a) = H_a A_0 V_k - sum_(l<k) b_l(a) M_l T_lk,   T_lk = b_l(V_k)^T.
// So a move costs what the contacts and the moves before it cost, never what the mesh does.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact/geometry.hpp"
#include "common/contact/solver.hpp"
#include "common/core/capacities.hpp"
#include "common/model/tissue.hpp"

namespace trocar::contact {

class Compliance {
 public:
  void open(const model::Tissue& tissue) noexcept;
  void restore() noexcept;  // forgets every move

  // Of the mesh as it came, for any embedding.
  [[nodiscard]] Block pristine(const Embedding& a, const Embedding& b) const noexcept;
  // Of the adapted mesh. Exact for single nodes and, as sums over them, for any embedding; costs grow with the number of moves.
  [[nodiscard]] Block coupling(const Embedding& a, const Embedding& b) noexcept;

  // Moves a node to x: false, and nothing changed, when its cells are not all candidates, a cell would be turned inside out or squeezed to
  // less than a hundredth, a capacity is exhausted, or the update would lose more than seven digits (layers of extremely different
  // stiffness). `geometry` is the state before the move and is moved along.
  [[nodiscard]] bool move(Geometry& geometry, std::uint32_t node, const Vector2& x_m) noexcept;
  [[nodiscard]] std::size_t moves() const noexcept { return moves_; }
  // What the latest move subtracted from the compliance between two nodes.
  [[nodiscard]] Block latest_change(std::uint32_t a, std::uint32_t b) noexcept;

 private:
  static constexpr std::size_t patch_dofs = 2 * capacity::patch_nodes;
  static constexpr std::size_t rows = capacity::contacts + 4 * capacity::patch_nodes;
  using PatchRow = std::array<double, patch_dofs>;
  using PatchMatrix = std::array<PatchRow, patch_dofs>;
  struct Patch {
    std::size_t nodes{};
    std::array<std::uint32_t, capacity::patch_nodes> node{};
    PatchMatrix m{};
  };
  struct Row {  // b_k and b_k M_k of one node, for the moves that it knows
    std::uint32_t node{};
    std::size_t known{};
    std::uint64_t used{};
    std::array<std::array<PatchRow, 2>, capacity::adapted_nodes> b{};
    std::array<std::array<PatchRow, 2>, capacity::adapted_nodes> bm{};
  };
  [[nodiscard]] Block entry(std::uint32_t a, std::uint32_t b) const noexcept;
  Row& row_of(std::uint32_t node) noexcept;
  [[nodiscard]] Block between(const Row& a, const Row& b) const noexcept;

  const model::Tissue* tissue_{nullptr};
  std::size_t moves_{0};
  std::size_t row_count_{0};
  std::uint64_t clock_{0};
  std::array<Patch, capacity::adapted_nodes> patch_{};
  // T_lk, l < k, at k (k - 1) / 2 + l: row by patch l, column by patch k.
  std::array<PatchMatrix, capacity::adapted_nodes*(capacity::adapted_nodes - 1) / 2> transfer_{};
  std::array<Row, rows> row_{};
};

}  // namespace trocar::contact
