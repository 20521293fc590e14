#include "common/contact/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/core/precision.hpp"

namespace trocar::contact {
namespace {

double cross(const Vector2& a, const Vector2& b) noexcept { return a[0] * b[1] - a[1] * b[0]; }

void add(Embedding& sum, std::uint32_t node, double weight) noexcept {
  for (std::uint32_t k = 0; k < sum.count; ++k) {
    if (sum.node[k] == node) {
      sum.weight[k] += weight;
      return;
    }
  }
  sum.node[sum.count] = node;
  sum.weight[sum.count] = weight;
  ++sum.count;
}

}  // namespace

Embedding single_node(std::uint32_t node) noexcept {
  Embedding at;
  at.count = 1;
  at.node[0] = node;
  at.weight[0] = 1.0;
  return at;
}

void Geometry::open(const model::Tissue& tissue) noexcept {
  tissue_ = &tissue;
  // A point on an edge belongs to both cells although its coordinates are rounded.
  tolerance_m_ = tolerance(1e-9, 1e-5) * tissue.edge_length_m;
  moved_count_ = 0;
}

Vector2 Geometry::node_m(std::uint32_t node) const noexcept {
  for (std::size_t k = 0; k < moved_count_; ++k)
    if (moved_[k].node == node) return moved_[k].x_m;
  return tissue_->node_m[node];
}

bool Geometry::is_moved(std::uint32_t node) const noexcept {
  return std::any_of(moved_.begin(), moved_.begin() + static_cast<std::ptrdiff_t>(moved_count_),
                     [&](const Moved& m) { return m.node == node; });
}

void Geometry::move(std::uint32_t node, const Vector2& x_m) noexcept {
  for (std::size_t k = 0; k < moved_count_; ++k) {
    if (moved_[k].node == node) {
      moved_[k].x_m = x_m;
      return;
    }
  }
  moved_[moved_count_++] = {node, x_m};
}

bool Geometry::inside(std::int32_t cell, const Vector2& x_m) const noexcept {
  const model::Cell& c = tissue_->cell[static_cast<std::size_t>(cell)];
  for (std::size_t k = 0; k < c.count; ++k) {
    const Vector2 a = node_m(c.node[k]);
    const Vector2 edge = minus(node_m(c.node[(k + 1) % c.count]), a);
    if (cross(edge, minus(x_m, a)) < -tolerance_m_ * std::hypot(edge[0], edge[1])) return false;
  }
  return true;
}

bool Geometry::on_surface(std::uint32_t node) const noexcept {
  for (std::uint32_t k = tissue_->ring_begin[node]; k < tissue_->ring_begin[node + 1]; ++k) {
    const model::Cell& cell = tissue_->cell[tissue_->ring_cell[k]];
    for (std::size_t edge = 0; edge < cell.count; ++edge)
      if (cell.neighbour[edge] == model::surface && (cell.node[edge] == node || cell.node[(edge + 1) % cell.count] == node)) return true;
  }
  return false;
}

// A moved node's cells may reach into buckets that do not list them.
std::int32_t Geometry::search_moved_rings(const Vector2& x_m) const noexcept {
  for (std::size_t m = 0; m < moved_count_; ++m) {
    const std::uint32_t node = moved_[m].node;
    for (std::uint32_t k = tissue_->ring_begin[node]; k < tissue_->ring_begin[node + 1]; ++k) {
      const auto cell = static_cast<std::int32_t>(tissue_->ring_cell[k]);
      if (inside(cell, x_m)) return cell;
    }
  }
  return -1;
}

std::int32_t Geometry::locate(const Vector2& x_m, std::int32_t hint) const noexcept {
  if (hint >= 0 && inside(hint, x_m)) return hint;
  const model::Buckets& b = tissue_->buckets;
  std::array<std::size_t, 2> at{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double position = (x_m[axis] - b.origin_m[axis]) / b.size_m[axis];
    if (!(position >= -1.0) || !(position <= static_cast<double>(b.count[axis]) + 1.0)) return -1;
    at[axis] = static_cast<std::size_t>(std::clamp(position, 0.0, static_cast<double>(b.count[axis] - 1)));
  }
  const std::size_t bucket = at[1] * b.count[0] + at[0];
  for (std::uint32_t k = b.begin[bucket]; k < b.begin[bucket + 1]; ++k) {
    const auto cell = static_cast<std::int32_t>(b.cell[k]);
    if (inside(cell, x_m)) return cell;
  }
  return search_moved_rings(x_m);
}

CellShape Geometry::shape(std::int32_t cell, const Vector2& x_m) const noexcept {
  const model::Cell& c = tissue_->cell[static_cast<std::size_t>(cell)];
  CellShape result;
  result.count = c.count;
  std::array<Vector2, 4> p{};
  for (std::size_t k = 0; k < c.count; ++k) p[k] = node_m(c.node[k]);
  if (c.count == 3) {
    const double area = cross(minus(p[1], p[0]), minus(p[2], p[0]));
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector2& a = p[(k + 1) % 3];
      const Vector2& b = p[(k + 2) % 3];
      result.weight[k] = cross(minus(b, a), minus(x_m, a)) / area;
      result.gradient[k] = {(a[1] - b[1]) / area, (b[0] - a[0]) / area};
    }
    return result;
  }
  // Newton on the bilinear map; exact after one step on parallelograms.
  double xi = 0.0;
  double eta = 0.0;
  std::array<double, 4> dxi{};
  std::array<double, 4> deta{};
  std::array<double, 4> j{};
  constexpr int most_steps = 12;
  for (int step = 0; step <= most_steps; ++step) {
    result.weight = {0.25 * (1 - xi) * (1 - eta), 0.25 * (1 + xi) * (1 - eta), 0.25 * (1 + xi) * (1 + eta), 0.25 * (1 - xi) * (1 + eta)};
    dxi = {-0.25 * (1 - eta), 0.25 * (1 - eta), 0.25 * (1 + eta), -0.25 * (1 + eta)};
    deta = {-0.25 * (1 - xi), -0.25 * (1 + xi), 0.25 * (1 + xi), 0.25 * (1 - xi)};
    Vector2 rest = x_m;
    j = {};
    for (std::size_t k = 0; k < 4; ++k) {
      rest = {rest[0] - result.weight[k] * p[k][0], rest[1] - result.weight[k] * p[k][1]};
      j[0] += dxi[k] * p[k][0];
      j[1] += deta[k] * p[k][0];
      j[2] += dxi[k] * p[k][1];
      j[3] += deta[k] * p[k][1];
    }
    const double determinant = j[0] * j[3] - j[1] * j[2];
    if (std::abs(rest[0]) + std::abs(rest[1]) < tolerance(1e-4, 1.0) * tolerance_m_ || step == most_steps || determinant == 0.0) break;
    // Far outside of the cell the map folds: stay near.
    xi = std::clamp(xi + (j[3] * rest[0] - j[1] * rest[1]) / determinant, -4.0, 4.0);
    eta = std::clamp(eta + (j[0] * rest[1] - j[2] * rest[0]) / determinant, -4.0, 4.0);
  }
  const double determinant = j[0] * j[3] - j[1] * j[2];
  for (std::size_t k = 0; k < 4; ++k)
    result.gradient[k] = {(j[3] * dxi[k] - j[2] * deta[k]) / determinant, (j[0] * deta[k] - j[1] * dxi[k]) / determinant};
  return result;
}

Exit Geometry::exit(std::int32_t cell, const Vector2& from_m, const Vector2& direction) const noexcept {
  const model::Cell& c = tissue_->cell[static_cast<std::size_t>(cell)];
  Exit best{0, std::numeric_limits<double>::infinity()};
  for (std::size_t k = 0; k < c.count; ++k) {
    const Vector2 a = node_m(c.node[k]);
    const Vector2 edge = minus(node_m(c.node[(k + 1) % c.count]), a);
    // Speed away from the cell across this edge, and how far inside of it the line begins, both times the edge's length.
    const double speed = cross(direction, edge);
    const double length = std::hypot(edge[0], edge[1]);
    if (speed <= 1e-9 * length) continue;
    const double distance = std::max(0.0, cross(edge, minus(from_m, a)) / speed);
    if (distance < best.distance) best = {k, distance};
  }
  return best;
}

Embedding Geometry::point(std::int32_t cell, const Vector2& x_m) const noexcept {
  const model::Cell& c = tissue_->cell[static_cast<std::size_t>(cell)];
  const CellShape at = shape(cell, x_m);
  Embedding result;
  for (std::size_t k = 0; k < at.count; ++k) add(result, c.node[k], at.weight[k]);
  return result;
}

Embedding Geometry::segment(const Vector2& from_m, const Vector2& to_m, std::int32_t hint) const noexcept {
  constexpr std::size_t pieces = 4;
  constexpr double gauss = 0.28867513459481288;  // half of 1 / sqrt(3)
  static_assert(2 * pieces * 4 <= capacity::embedding_nodes);
  Embedding sum;
  std::int32_t cell = hint;
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    for (const double side : {-gauss, gauss}) {
      const double at = (static_cast<double>(piece) + 0.5 + side) / pieces;
      const Vector2 x{from_m[0] + at * (to_m[0] - from_m[0]), from_m[1] + at * (to_m[1] - from_m[1])};
      const std::int32_t found = locate(x, cell);
      if (found >= 0) cell = found;
      const CellShape s = shape(cell, x);
      const model::Cell& c = tissue_->cell[static_cast<std::size_t>(cell)];
      for (std::size_t k = 0; k < s.count; ++k)
        if (s.weight[k] != 0.0) add(sum, c.node[k], s.weight[k] / (2 * pieces));
    }
  }
  return sum;
}

Vector2 Geometry::mean_m(const Embedding& at) const noexcept {
  Vector2 x{};
  for (std::uint32_t k = 0; k < at.count; ++k) {
    const Vector2 p = node_m(at.node[k]);
    x = {x[0] + at.weight[k] * p[0], x[1] + at.weight[k] * p[1]};
  }
  return x;
}

}  // namespace trocar::contact
