// What follows from a planar mesh's nodes and cells alone: neighbours, rings, search buckets.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/model/tissue.hpp"

namespace trocar::condense {

// Lists one after the other: list i is entry[begin[i]] … entry[begin[i + 1] - 1], increasing.
struct Lists {
  std::vector<std::uint32_t> begin{};
  std::vector<std::uint32_t> entry{};

  [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t i) const {
    return std::span(entry).subspan(begin[i], begin[i + 1] - begin[i]);
  }
};

// Cells around each node.
[[nodiscard]] Lists rings_of(std::span<const model::Cell> cells, std::size_t nodes);

// Fills Cell::neighbour: the cell across each edge, model::surface where there is none. Throws fem::Error for an edge of three cells.
void join(std::span<model::Cell> cells, const Lists& rings);

struct SearchBuckets {
  model::Vector2 origin_m{}, size_m{};
  std::array<std::uint32_t, 2> count{};
  Lists cells{};
  std::uint32_t longest{};
};

// Buckets about as large as a cell, halved until none holds more than capacity::cells_per_bucket. Throws fem::Error when that takes more
// than 64 buckets a cell: the cells' sizes differ too much.
[[nodiscard]] SearchBuckets buckets_of(std::span<const model::Vector2> node_m, std::span<const model::Cell> cells);

[[nodiscard]] double mean_edge_length_m(std::span<const model::Vector2> node_m, std::span<const model::Cell> cells);

// Index of a cell that holds the point, up to 1e-9 m; -1 when none does.
[[nodiscard]] std::int32_t cell_at(std::span<const model::Vector2> node_m, std::span<const model::Cell> cells, const SearchBuckets& buckets,
                                   const model::Vector2& x_m);

}  // namespace trocar::condense
