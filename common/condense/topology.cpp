#include "common/condense/topology.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/core/capacities.hpp"
#include "common/fem/tissue.hpp"

namespace trocar::condense {
namespace {

using model::Cell;
using model::Vector2;

struct Bounds {
  Vector2 min_m{}, max_m{};
};

Bounds bounds_of(std::span<const Vector2> node_m, const Cell& cell) {
  Bounds b{node_m[cell.node[0]], node_m[cell.node[0]]};
  for (std::size_t k = 1; k < cell.count; ++k)
    for (std::size_t axis = 0; axis < 2; ++axis) {
      b.min_m[axis] = std::min(b.min_m[axis], node_m[cell.node[k]][axis]);
      b.max_m[axis] = std::max(b.max_m[axis], node_m[cell.node[k]][axis]);
    }
  return b;
}

// Lists from pairs (list, entry) given by visit(add) twice: once to count, once to store. Entries arrive in increasing order.
template <typename Visit>
Lists lists_of(std::size_t count, const Visit& visit) {
  Lists lists;
  lists.begin.assign(count + 1, 0);
  visit([&](std::size_t list, std::uint32_t) { ++lists.begin[list + 1]; });
  for (std::size_t i = 0; i < count; ++i) lists.begin[i + 1] += lists.begin[i];
  lists.entry.resize(lists.begin.back());
  std::vector<std::uint32_t> next(lists.begin.begin(), lists.begin.end() - 1);
  visit([&](std::size_t list, std::uint32_t entry) { lists.entry[next[list]++] = entry; });
  return lists;
}

double edge_length(std::span<const Vector2> node_m, const Cell& cell, std::size_t k) {
  const Vector2& a = node_m[cell.node[k]];
  const Vector2& b = node_m[cell.node[(k + 1U) % cell.count]];
  return std::hypot(b[0] - a[0], b[1] - a[1]);
}

bool holds(std::span<const Vector2> node_m, const Cell& cell, const Vector2& x) {
  for (std::size_t k = 0; k < cell.count; ++k) {
    const Vector2& a = node_m[cell.node[k]];
    const Vector2& b = node_m[cell.node[(k + 1U) % cell.count]];
    const double outward = (b[1] - a[1]) * (x[0] - a[0]) - (b[0] - a[0]) * (x[1] - a[1]);
    if (outward > 1e-9 * std::hypot(b[0] - a[0], b[1] - a[1])) return false;
  }
  return true;
}

}  // namespace

Lists rings_of(std::span<const Cell> cells, std::size_t nodes) {
  return lists_of(nodes, [&](const auto& add) {
    for (std::size_t c = 0; c < cells.size(); ++c)
      for (std::size_t k = 0; k < cells[c].count; ++k) add(cells[c].node[k], static_cast<std::uint32_t>(c));
  });
}

void join(std::span<Cell> cells, const Lists& rings) {
  for (std::size_t c = 0; c < cells.size(); ++c)
    for (std::size_t k = 0; k < cells[c].count; ++k) {
      const std::uint32_t from = cells[c].node[k];
      const std::uint32_t to = cells[c].node[(k + 1U) % cells[c].count];
      cells[c].neighbour[k] = model::surface;
      for (const std::uint32_t other : rings[from]) {
        const Cell& candidate = cells[other];
        const bool shares =
            std::find(candidate.node.begin(), candidate.node.begin() + candidate.count, to) != candidate.node.begin() + candidate.count;
        if (other == c || !shares) continue;
        if (cells[c].neighbour[k] != model::surface)
          throw fem::Error("an edge of the mesh belongs to three elements (the third is " + std::to_string(other) +
                           "); a plane mesh has two at most");
        cells[c].neighbour[k] = static_cast<std::int32_t>(other);
      }
    }
}

double mean_edge_length_m(std::span<const Vector2> node_m, std::span<const Cell> cells) {
  double sum = 0.0;
  std::size_t edges = 0;
  for (const Cell& cell : cells)
    for (std::size_t k = 0; k < cell.count; ++k, ++edges) sum += edge_length(node_m, cell, k);
  return sum / static_cast<double>(edges);
}

SearchBuckets buckets_of(std::span<const Vector2> node_m, std::span<const Cell> cells) {
  Bounds all = bounds_of(node_m, cells[0]);
  for (const Vector2& x : node_m)
    for (std::size_t axis = 0; axis < 2; ++axis) {
      all.min_m[axis] = std::min(all.min_m[axis], x[axis]);
      all.max_m[axis] = std::max(all.max_m[axis], x[axis]);
    }
  const double edge = mean_edge_length_m(node_m, cells);
  std::array<std::uint32_t, 2> count{};
  for (std::size_t axis = 0; axis < 2; ++axis)
    count[axis] = static_cast<std::uint32_t>(std::clamp(std::ceil((all.max_m[axis] - all.min_m[axis]) / edge), 1.0, 4096.0));

  for (;;) {
    SearchBuckets found;
    found.origin_m = all.min_m;
    found.count = count;
    for (std::size_t axis = 0; axis < 2; ++axis) found.size_m[axis] = (all.max_m[axis] - all.min_m[axis]) / count[axis];
    model::Buckets grid{};
    grid.origin_m = found.origin_m;
    grid.size_m = found.size_m;
    grid.count = found.count;
    const std::size_t buckets = static_cast<std::size_t>(count[0]) * count[1];
    found.cells = lists_of(buckets, [&](const auto& add) {
      for (std::size_t c = 0; c < cells.size(); ++c) {
        const Bounds b = bounds_of(node_m, cells[c]);
        for (std::size_t j = bucket_index(grid, 1, b.min_m[1]); j <= bucket_index(grid, 1, b.max_m[1]); ++j)
          for (std::size_t i = bucket_index(grid, 0, b.min_m[0]); i <= bucket_index(grid, 0, b.max_m[0]); ++i)
            add(j * count[0] + i, static_cast<std::uint32_t>(c));
      }
    });
    for (std::size_t b = 0; b < buckets; ++b) found.longest = std::max(found.longest, static_cast<std::uint32_t>(found.cells[b].size()));
    if (found.longest <= capacity::cells_per_bucket) return found;
    for (std::uint32_t& n : count) n *= 2;
    if (static_cast<std::size_t>(count[0]) * count[1] > 64 * cells.size() + 64)
      throw fem::Error("the candidate elements differ so much in size that a search would look at " + std::to_string(found.longest) +
                       " of them, and the capacity cells_per_bucket is " + std::to_string(capacity::cells_per_bucket) +
                       "; narrow contact.corridor or grade the mesh less");
  }
}

std::int32_t cell_at(std::span<const Vector2> node_m, std::span<const Cell> cells, const SearchBuckets& buckets, const Vector2& x_m) {
  model::Buckets grid{};
  grid.origin_m = buckets.origin_m;
  grid.size_m = buckets.size_m;
  grid.count = buckets.count;
  constexpr double reach = 1e-9;
  for (std::size_t j = bucket_index(grid, 1, x_m[1] - reach); j <= bucket_index(grid, 1, x_m[1] + reach); ++j)
    for (std::size_t i = bucket_index(grid, 0, x_m[0] - reach); i <= bucket_index(grid, 0, x_m[0] + reach); ++i)
      for (const std::uint32_t c : buckets.cells[j * buckets.count[0] + i])
        if (holds(node_m, cells[c], x_m)) return static_cast<std::int32_t>(c);
  return -1;
}

}  // namespace trocar::condense
