#include "common/contact/compliance.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/core/precision.hpp"

namespace trocar::contact {
namespace {

template <typename Real>
Block weighted_sum(const Real* block, std::size_t stride, const Embedding& a, const Embedding& b) noexcept {
  Block g{};
  for (std::uint32_t p = 0; p < a.count; ++p) {
    const Real* const x = block + 2 * static_cast<std::size_t>(a.node[p]) * stride;
    const Real* const y = x + stride;
    Block row{};
    for (std::uint32_t q = 0; q < b.count; ++q) {
      const std::size_t at = 2 * static_cast<std::size_t>(b.node[q]);
      const double w = b.weight[q];
      row[0] += w * static_cast<double>(x[at]);
      row[1] += w * static_cast<double>(x[at + 1]);
      row[2] += w * static_cast<double>(y[at]);
      row[3] += w * static_cast<double>(y[at + 1]);
    }
    for (std::size_t k = 0; k < 4; ++k) g[k] += a.weight[p] * row[k];
  }
  return g;
}

// x <- A^-1 b for n columns held as rows of `b` (so: solves X A = B row by row with the transposed system). Partial pivoting; false when
// singular.
template <std::size_t N>
bool solve_right(std::array<std::array<double, N>, N>& a, std::array<std::array<double, N>, N>& b, std::size_t n) noexcept {
  // X A = B  <=>  A^T X^T = B^T: eliminate columns of A.
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t best = k;
    for (std::size_t c = k + 1; c < n; ++c)
      if (std::abs(a[k][c]) > std::abs(a[k][best])) best = c;
    if (!(std::abs(a[k][best]) > tolerance(1e-13, 1e-6))) return false;
    for (std::size_t r = 0; r < n; ++r) {
      std::swap(a[r][k], a[r][best]);
      std::swap(b[r][k], b[r][best]);
    }
    for (std::size_t c = 0; c < n; ++c) {
      if (c == k) continue;
      const double factor = a[k][c] / a[k][k];
      if (factor == 0.0) continue;
      for (std::size_t r = 0; r < n; ++r) {
        a[r][c] -= factor * a[r][k];
        b[r][c] -= factor * b[r][k];
      }
    }
  }
  for (std::size_t k = 0; k < n; ++k)
    for (std::size_t r = 0; r < n; ++r) b[r][k] /= a[k][k];
  return true;
}

constexpr std::size_t transfer_index(std::size_t l, std::size_t k) noexcept { return k * (k - 1) / 2 + l; }

// Where stiffnesses differ by many orders of magnitude the update is a difference of numbers that nearly cancel. A' = A - A M A has to
// fulfil A' + A dK A' = A, and to keep the diagonal of a compliance.
template <std::size_t N>
bool accurate(const std::array<std::array<double, N>, N>& a, const std::array<std::array<double, N>, N>& change,
              const std::array<std::array<double, N>, N>& m, std::size_t n) noexcept {
  constexpr double largest_error = tolerance(1e-7, 1e-3);  // of the largest entry of A'
  using Matrix = std::array<std::array<double, N>, N>;
  const auto product = [n](const Matrix& x, const Matrix& y) {
    Matrix z{};
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < n; ++k)
        for (std::size_t j = 0; j < n; ++j) z[i][j] += x[i][k] * y[k][j];
    return z;
  };
  Matrix moved = product(product(a, m), a);
  double largest = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      moved[i][j] = a[i][j] - moved[i][j];
      largest = std::max(largest, std::abs(moved[i][j]));
    }
    if (!(moved[i][i] >= 0.0)) return false;
  }
  const Matrix back = product(product(a, change), moved);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j)
      if (!(std::abs(moved[i][j] + back[i][j] - a[i][j]) <= largest_error * largest)) return false;
  return true;
}

double twice_area(const Geometry& geometry, const model::Cell& cell) noexcept {
  double area = 0.0;
  for (std::size_t k = 0; k < cell.count; ++k) {
    const Vector2 a = geometry.node_m(cell.node[k]);
    const Vector2 b = geometry.node_m(cell.node[(k + 1) % cell.count]);
    area += a[0] * b[1] - a[1] * b[0];
  }
  return area;
}

}  // namespace

void Compliance::open(const model::Tissue& tissue) noexcept {
  tissue_ = &tissue;
  restore();
}

void Compliance::restore() noexcept {
  moves_ = 0;
  row_count_ = 0;
  clock_ = 0;
}

Block Compliance::pristine(const Embedding& a, const Embedding& b) const noexcept {
  if (!tissue_->compliance64.empty()) return weighted_sum(tissue_->compliance64.data(), tissue_->unknowns(), a, b);
  return weighted_sum(tissue_->compliance32.data(), tissue_->unknowns(), a, b);
}

Block Compliance::entry(std::uint32_t a, std::uint32_t b) const noexcept { return pristine(single_node(a), single_node(b)); }

// The row of a node, made or brought up to the latest move. A row that was not used for longest gives way: it can be computed again.
Compliance::Row& Compliance::row_of(std::uint32_t node) noexcept {
  Row* row = nullptr;
  for (std::size_t k = 0; k < row_count_ && row == nullptr; ++k)
    if (row_[k].node == node) row = &row_[k];
  if (row == nullptr) {
    if (row_count_ < rows)
      row = &row_[row_count_++];
    else
      row = std::min_element(row_.begin(), row_.end(), [](const Row& x, const Row& y) { return x.used < y.used; });
    row->node = node;
    row->known = 0;
  }
  row->used = ++clock_;
  for (; row->known < moves_; ++row->known) {
    const std::size_t k = row->known;
    const Patch& patch = patch_[k];
    const std::size_t size = 2 * patch.nodes;
    std::array<PatchRow, 2>& b = row->b[k];
    for (std::size_t p = 0; p < patch.nodes; ++p) {
      const Block g = entry(node, patch.node[p]);
      b[0][2 * p] = g[0];
      b[0][2 * p + 1] = g[1];
      b[1][2 * p] = g[2];
      b[1][2 * p + 1] = g[3];
    }
    for (std::size_t l = 0; l < k; ++l) {
      const PatchMatrix& t = transfer_[transfer_index(l, k)];
      for (std::size_t i = 0; i < 2 * patch_[l].nodes; ++i) {
        const double x = row->bm[l][0][i];
        const double y = row->bm[l][1][i];
        for (std::size_t j = 0; j < size; ++j) {
          b[0][j] -= x * t[i][j];
          b[1][j] -= y * t[i][j];
        }
      }
    }
    std::array<PatchRow, 2>& bm = row->bm[k];
    bm = {};
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        bm[0][j] += b[0][i] * patch.m[i][j];
        bm[1][j] += b[1][i] * patch.m[i][j];
      }
    }
  }
  return *row;
}

// Precondition: both rows are up to date.
Block Compliance::between(const Row& a, const Row& b) const noexcept {
  Block g = entry(a.node, b.node);
  for (std::size_t k = 0; k < moves_; ++k) {
    for (std::size_t i = 0; i < 2 * patch_[k].nodes; ++i) {
      g[0] -= a.bm[k][0][i] * b.b[k][0][i];
      g[1] -= a.bm[k][0][i] * b.b[k][1][i];
      g[2] -= a.bm[k][1][i] * b.b[k][0][i];
      g[3] -= a.bm[k][1][i] * b.b[k][1][i];
    }
  }
  return g;
}

Block Compliance::coupling(const Embedding& a, const Embedding& b) noexcept {
  if (moves_ == 0) return pristine(a, b);
  Block g{};
  for (std::uint32_t p = 0; p < a.count; ++p) {
    const Row& row = row_of(a.node[p]);
    for (std::uint32_t q = 0; q < b.count; ++q) {
      const Block one = between(row, row_of(b.node[q]));
      for (std::size_t k = 0; k < 4; ++k) g[k] += a.weight[p] * b.weight[q] * one[k];
    }
  }
  return g;
}

Block Compliance::latest_change(std::uint32_t a, std::uint32_t b) noexcept {
  const Row& x = row_of(a);
  const Row& y = row_of(b);
  const std::size_t k = moves_ - 1;
  Block g{};
  for (std::size_t i = 0; i < 2 * patch_[k].nodes; ++i) {
    g[0] += x.bm[k][0][i] * y.b[k][0][i];
    g[1] += x.bm[k][0][i] * y.b[k][1][i];
    g[2] += x.bm[k][1][i] * y.b[k][0][i];
    g[3] += x.bm[k][1][i] * y.b[k][1][i];
  }
  return g;
}

bool Compliance::move(Geometry& geometry, std::uint32_t node, const Vector2& x_m) noexcept {
  if (moves_ == capacity::adapted_nodes || (tissue_->node_flags[node] & model::whole_ring) == 0) return false;
  const std::uint32_t begin = tissue_->ring_begin[node];
  const std::uint32_t end = tissue_->ring_begin[node + 1];

  Patch& patch = patch_[moves_];
  patch.nodes = 0;
  const auto local = [&patch](std::uint32_t n) {
    std::size_t k = 0;
    while (k < patch.nodes && patch.node[k] != n) ++k;
    return k;
  };
  for (std::uint32_t k = begin; k < end; ++k) {
    const model::Cell& cell = tissue_->cell[tissue_->ring_cell[k]];
    for (std::size_t c = 0; c < cell.count; ++c) {
      if (local(cell.node[c]) < patch.nodes) continue;
      if (patch.nodes == capacity::patch_nodes) return false;
      patch.node[patch.nodes++] = cell.node[c];
    }
  }

  constexpr double smallest_area = 0.01;  // of what the cell had
  const Vector2 before = geometry.node_m(node);
  PatchMatrix change{};
  const auto add_cells = [&](double sign) {
    for (std::uint32_t k = begin; k < end; ++k) {
      const model::Cell& cell = tissue_->cell[tissue_->ring_cell[k]];
      element::Corners corners = element::Corners::Zero();
      for (std::size_t c = 0; c < cell.count; ++c) {
        const Vector2 x = geometry.node_m(cell.node[c]);
        corners(0, static_cast<Eigen::Index>(c)) = x[0];
        corners(1, static_cast<Eigen::Index>(c)) = x[1];
      }
      element::Stiffness stiffness;
      const element::Type type = cell.count == 3 ? element::Type::Tri3 : element::Type::Quad4;
      const element::Elasticity c = element::elasticity(tissue_->model, tissue_->material[cell.material]);
      if (element::stiffness(type, tissue_->integration, corners, c, tissue_->thickness_m, stiffness) != element::Status::Ok) return false;
      for (std::size_t i = 0; i < std::size_t{2} * cell.count; ++i)
        for (std::size_t j = 0; j < std::size_t{2} * cell.count; ++j)
          change[2 * local(cell.node[i / 2]) + i % 2][2 * local(cell.node[j / 2]) + j % 2] +=
              sign * stiffness(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
    return true;
  };
  const auto areas_hold = [&] {
    for (std::uint32_t k = begin; k < end; ++k) {
      const model::Cell& cell = tissue_->cell[tissue_->ring_cell[k]];
      double original = 0.0;
      for (std::size_t c = 0; c < cell.count; ++c) {
        const Vector2& a = tissue_->node_m[cell.node[c]];
        const Vector2& b = tissue_->node_m[cell.node[(c + 1) % cell.count]];
        original += a[0] * b[1] - a[1] * b[0];
      }
      if (!(twice_area(geometry, cell) > smallest_area * original)) return false;
    }
    return true;
  };
  if (!add_cells(-1.0)) return false;
  const bool moved_before = geometry.is_moved(node);
  if (geometry.moved() == capacity::adapted_nodes && !moved_before) return false;
  geometry.move(node, x_m);
  const std::size_t size = 2 * patch.nodes;

  // 1 + A dK, with A between the patch's nodes before this move. Rows of supported degrees of freedom of A are zero.
  PatchMatrix compliance{};
  std::array<const Row*, capacity::patch_nodes> rows_in_use{};
  for (std::size_t p = 0; p < patch.nodes; ++p) rows_in_use[p] = &row_of(patch.node[p]);
  for (std::size_t p = 0; p < patch.nodes; ++p) {
    for (std::size_t q = 0; q < patch.nodes; ++q) {
      const Block g = between(*rows_in_use[p], *rows_in_use[q]);
      compliance[2 * p][2 * q] = g[0];
      compliance[2 * p][2 * q + 1] = g[1];
      compliance[2 * p + 1][2 * q] = g[2];
      compliance[2 * p + 1][2 * q + 1] = g[3];
    }
  }
  bool good = areas_hold() && add_cells(1.0);
  PatchMatrix system{};
  if (good) {
    for (std::size_t i = 0; i < size; ++i) {
      system[i][i] = 1.0;
      for (std::size_t k = 0; k < size; ++k)
        for (std::size_t j = 0; j < size; ++j) system[i][j] += compliance[i][k] * change[k][j];
    }
    patch.m = change;
    good = solve_right(system, patch.m, size) && accurate(compliance, change, patch.m, size);
  }
  if (!good) {
    if (moved_before)
      geometry.move(node, before);
    else
      geometry.take_back();
    return false;
  }
  for (std::size_t i = 0; i < size; ++i)
    for (std::size_t j = 0; j < i; ++j) patch.m[i][j] = patch.m[j][i] = 0.5 * (patch.m[i][j] + patch.m[j][i]);
  // T_l of the new patch: its nodes' rows as they stand, transposed.
  for (std::size_t l = 0; l < moves_; ++l) {
    PatchMatrix& t = transfer_[transfer_index(l, moves_)];
    for (std::size_t p = 0; p < patch.nodes; ++p) {
      for (std::size_t i = 0; i < 2 * patch_[l].nodes; ++i) {
        t[i][2 * p] = rows_in_use[p]->b[l][0][i];
        t[i][2 * p + 1] = rows_in_use[p]->b[l][1][i];
      }
    }
  }
  ++moves_;
  return true;
}

}  // namespace trocar::contact
