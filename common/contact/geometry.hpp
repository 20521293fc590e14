// Where things are in the tissue's reference mesh: cells around points, shape functions, paths across cells, moved nodes.
// All coordinates are material (reference) coordinates in the needle's plane, m. Bounded time, whatever the size of the mesh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact/vector.hpp"
#include "common/core/capacities.hpp"
#include "common/model/tissue.hpp"

namespace trocar::contact {

// A material point, or the mean over a piece of the path, tied to candidate nodes: u = sum_k weight[k] u[node[k]]; weights sum to 1.
struct Embedding {
  std::uint32_t count{};
  std::array<std::uint32_t, capacity::embedding_nodes> node{};
  std::array<double, capacity::embedding_nodes> weight{};
};

[[nodiscard]] Embedding single_node(std::uint32_t node) noexcept;

// Shape functions of one cell at a point, and their derivatives with respect to x and y, 1/m.
struct CellShape {
  std::uint32_t count{};
  std::array<double, 4> weight{};
  std::array<Vector2, 4> gradient{};
};

// A straight line leaves a convex cell across edge `edge` (node[edge] to node[edge + 1]), `distance` along the line from its start.
struct Exit {
  std::size_t edge{};
  double distance{};
};

class Geometry {
 public:
  void open(const model::Tissue& tissue) noexcept;

  [[nodiscard]] Vector2 node_m(std::uint32_t node) const noexcept;
  // Whether an edge that no tissue lies beyond ends at this node.
  [[nodiscard]] bool on_surface(std::uint32_t node) const noexcept;
  // The cell that holds x, looked for first in `hint` when that is a cell; -1 when no candidate cell does.
  [[nodiscard]] std::int32_t locate(const Vector2& x_m, std::int32_t hint) const noexcept;
  [[nodiscard]] bool inside(std::int32_t cell, const Vector2& x_m) const noexcept;
  // Continued outside of the cell.
  [[nodiscard]] CellShape shape(std::int32_t cell, const Vector2& x_m) const noexcept;
  [[nodiscard]] Exit exit(std::int32_t cell, const Vector2& from_m, const Vector2& direction) const noexcept;

  [[nodiscard]] Embedding point(std::int32_t cell, const Vector2& x_m) const noexcept;
  // Mean over the straight piece from one point to another, 8 Gauss points (4 x 2); points outside of the candidates take the last
  // cell's continued shape functions.
  [[nodiscard]] Embedding segment(const Vector2& from_m, const Vector2& to_m, std::int32_t hint) const noexcept;
  [[nodiscard]] Vector2 mean_m(const Embedding& at) const noexcept;  // sum of weight times node position

  // Mesh adaptation: this node lies at x from now on. Precondition: moved() < capacity::adapted_nodes.
  void move(std::uint32_t node, const Vector2& x_m) noexcept;
  // Takes back the latest move, of a node that had not been moved before.
  void take_back() noexcept { --moved_count_; }
  [[nodiscard]] std::size_t moved() const noexcept { return moved_count_; }
  [[nodiscard]] bool is_moved(std::uint32_t node) const noexcept;
  void restore() noexcept { moved_count_ = 0; }

 private:
  struct Moved {
    std::uint32_t node{};
    Vector2 x_m{};
  };
  [[nodiscard]] std::int32_t search_moved_rings(const Vector2& x_m) const noexcept;

  const model::Tissue* tissue_{nullptr};
  double tolerance_m_{};
  std::array<Moved, capacity::adapted_nodes> moved_{};
  std::size_t moved_count_{0};
};

}  // namespace trocar::contact
