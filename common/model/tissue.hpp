// The tissue as the tick sees it: a planar candidate mesh in the needle's plane and the compliance between its nodes.
//   u_c = A_cc f_c   displacement [m] of candidate degrees of freedom per force [N] on them; index 2 * node + (0 for x, 1 for y)
// 2-D scenes: candidates are the mesh's own nodes. Solids: a quad grid in the plane, each node tied to the solid by its shape functions,
// spread over a ball about the needle's radius wide. So every scene costs the tick the same.
// A view into memory that somebody else owns (a mapped image); nothing here allocates. Read by common/contact.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/element/element.hpp"

namespace trocar::model {

using Vector2 = std::array<double, 2>;

inline constexpr std::int32_t surface = -1;  // beyond this edge there is no tissue
inline constexpr std::int32_t limit = -2;    // beyond this edge there is tissue, but no candidates

struct Cell {  // triangle or quad, counter-clockwise
  std::array<std::uint32_t, 4> node{};
  std::array<std::int32_t, 4> neighbour{};  // across the edge from node[k] to node[k + 1]: a cell, `surface` or `limit`
  std::uint16_t count{};                    // 3 or 4
  std::uint16_t material{};
};

// Where two triangles make a square: its edge over the mean of the triangles' edges.
inline constexpr double square_of_triangles = 0.88;

inline constexpr std::uint8_t fixed_x = 1;
inline constexpr std::uint8_t fixed_y = 2;
inline constexpr std::uint8_t whole_ring = 4;  // all cells around this node are candidates, at most capacity::ring_cells: it may be moved

// Uniform buckets over the candidates' bounding box; bucket (i, j) holds cells [begin[b], begin[b + 1]) of `cell`, b = j * count[0] + i,
// which are all that overlap it.
struct Buckets {
  Vector2 origin_m{};
  Vector2 size_m{};
  std::array<std::uint32_t, 2> count{};
  std::span<const std::uint32_t> begin{};
  std::span<const std::uint32_t> cell{};
};

// Row or column of a coordinate, the nearest one outside of the box. Writer, reader and search share this rounding: a cell is listed in
// every bucket between those of its bounding box's corners, so whatever lies in the cell is found in its own bucket.
[[nodiscard]] constexpr std::uint32_t bucket_index(const Buckets& buckets, std::size_t axis, double x_m) noexcept {
  const double place = (x_m - buckets.origin_m[axis]) / buckets.size_m[axis];
  if (!(place > 0.0)) return 0;
  const std::uint32_t last = buckets.count[axis] - 1;
  return place >= static_cast<double>(last) ? last : static_cast<std::uint32_t>(place);
}

struct Tissue {
  element::Model model{};
  element::Integration integration{};
  double thickness_m{};
  double edge_length_m{};  // typical edge of the candidate cells
  std::span<const Vector2> node_m{};
  std::span<const std::uint8_t> node_flags{};
  std::span<const Cell> cell{};
  std::span<const std::uint32_t> ring_begin{};  // nodes + 1: cells around node n are ring_cell[ring_begin[n]] …
  std::span<const std::uint32_t> ring_cell{};
  std::span<const element::Material> material{};
  Buckets buckets{};
  // Symmetric, (2 * nodes)^2, row after row; exactly one of the two is present.
  std::span<const double> compliance64{};
  std::span<const float> compliance32{};

  [[nodiscard]] std::size_t unknowns() const noexcept { return 2 * node_m.size(); }
};

}  // namespace trocar::model
