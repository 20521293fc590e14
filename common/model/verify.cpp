#include "common/model/verify.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace trocar::model {
namespace {

bool finite(const Vector2& v) noexcept { return std::isfinite(v[0]) && std::isfinite(v[1]); }
bool positive(double v) noexcept { return std::isfinite(v) && v > 0.0; }
bool not_negative(double v) noexcept { return std::isfinite(v) && v >= 0.0; }

bool tissue_ok(const Tissue& t) noexcept {
  if (!not_negative(t.thickness_m) || (t.model != element::Model::Solid && t.thickness_m == 0.0) || !positive(t.edge_length_m))
    return false;
  return !t.material.empty() && std::all_of(t.material.begin(), t.material.end(), [](const element::Material& m) {
    return positive(m.young_pa) && not_negative(m.poisson) && m.poisson < 0.5;
  });
}

// Twice the signed area of a corner; NaN and infinity fail the comparison with 0 or the check for finite.
double corner_area(const Vector2& a, const Vector2& b, const Vector2& c) noexcept {
  return (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0]);
}

// Convex and counter-clockwise, of existing nodes and material.
bool cell_ok(const Tissue& t, const Cell& cell) noexcept {
  if ((cell.count != 3 && cell.count != 4) || cell.material >= t.material.size()) return false;
  if (cell.count == 3 && (cell.node[3] != 0 || cell.neighbour[3] != surface)) return false;
  for (std::size_t k = 0; k < cell.count; ++k) {
    if (cell.node[k] >= t.node_m.size() || cell.neighbour[k] < limit) return false;
    if (cell.neighbour[k] >= 0 && static_cast<std::size_t>(cell.neighbour[k]) >= t.cell.size()) return false;
  }
  for (std::size_t k = 0; k < cell.count; ++k) {
    const auto corner = [&](std::size_t i) -> const Vector2& { return t.node_m[cell.node[i % cell.count]]; };
    if (!positive(corner_area(corner(k), corner(k + 1), corner(k + 2)))) return false;
  }
  return true;
}

// The place k of the edge from node `from` to node `to`, count when it has none.
std::size_t edge_of(const Cell& cell, std::uint32_t from, std::uint32_t to) noexcept {
  std::size_t k = 0;
  while (k < cell.count && !(cell.node[k] == from && cell.node[(k + 1U) % cell.count] == to)) ++k;
  return k;
}

bool begins_ok(std::span<const std::uint32_t> begin, std::size_t lists, std::size_t entries) noexcept {
  return begin.size() == lists + 1 && begin.front() == 0 && begin.back() == entries && std::is_sorted(begin.begin(), begin.end());
}

std::span<const std::uint32_t> list(std::span<const std::uint32_t> begin, std::span<const std::uint32_t> all, std::size_t i) noexcept {
  return all.subspan(begin[i], begin[i + 1] - begin[i]);
}

// Cells in range, each once.
bool ascending(std::span<const std::uint32_t> cells, std::size_t count) noexcept {
  return std::adjacent_find(cells.begin(), cells.end(), std::greater_equal<>()) == cells.end() && (cells.empty() || cells.back() < count);
}

// Every ring holds the cells around its node and no other: each entry is one, none comes twice, and there are as many as corners.
bool rings_ok(const Tissue& t) noexcept {
  if (!begins_ok(t.ring_begin, t.node_m.size(), t.ring_cell.size())) return false;
  std::size_t corners = 0;
  for (const Cell& cell : t.cell) corners += cell.count;
  if (corners != t.ring_cell.size()) return false;
  for (std::size_t n = 0; n < t.node_m.size(); ++n) {
    const auto ring = list(t.ring_begin, t.ring_cell, n);
    if (ring.empty() || !ascending(ring, t.cell.size())) return false;
    for (const std::uint32_t c : ring) {
      const Cell& cell = t.cell[c];
      if (std::find(cell.node.begin(), cell.node.begin() + cell.count, n) == cell.node.begin() + cell.count) return false;
    }
  }
  return true;
}

// An edge belongs to one cell in each direction, and the two name each other. Rings are short: they were bounded before.
bool edges_ok(const Tissue& t) noexcept {
  for (std::size_t c = 0; c < t.cell.size(); ++c) {
    const Cell& cell = t.cell[c];
    for (std::size_t k = 0; k < cell.count; ++k) {
      const std::uint32_t from = cell.node[k];
      const std::uint32_t to = cell.node[(k + 1U) % cell.count];
      std::int64_t across = -1;
      for (const std::uint32_t other : list(t.ring_begin, t.ring_cell, from)) {
        if (other != c && edge_of(t.cell[other], from, to) != t.cell[other].count) return false;
        if (edge_of(t.cell[other], to, from) != t.cell[other].count) across = other;
      }
      if (across != std::max<std::int64_t>(cell.neighbour[k], -1)) return false;
    }
  }
  return true;
}

bool flags_ok(const Tissue& t, std::uint32_t& ring_cells) noexcept {
  ring_cells = 0;
  for (std::size_t n = 0; n < t.node_m.size(); ++n) {
    if ((t.node_flags[n] & ~(fixed_x | fixed_y | whole_ring)) != 0) return false;
    if ((t.node_flags[n] & whole_ring) == 0) continue;
    const auto ring = list(t.ring_begin, t.ring_cell, n);
    ring_cells = std::max(ring_cells, static_cast<std::uint32_t>(ring.size()));
    for (const std::uint32_t c : ring) {
      const Cell& cell = t.cell[c];
      for (std::size_t k = 0; k < cell.count; ++k)
        if (cell.neighbour[k] == limit && (cell.node[k] == n || cell.node[(k + 1U) % cell.count] == n)) return false;
    }
  }
  return true;
}

struct BucketRange {
  std::array<std::uint32_t, 2> first{}, last{};
};

BucketRange buckets_of(const Tissue& t, const Cell& cell) noexcept {
  BucketRange range{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    double low = t.node_m[cell.node[0]][axis];
    double high = low;
    for (std::size_t k = 1; k < cell.count; ++k) {
      low = std::min(low, t.node_m[cell.node[k]][axis]);
      high = std::max(high, t.node_m[cell.node[k]][axis]);
    }
    range.first[axis] = bucket_index(t.buckets, axis, low);
    range.last[axis] = bucket_index(t.buckets, axis, high);
  }
  return range;
}

ImageStatus check_buckets(const Tissue& t, const Need& need) noexcept {
  const Buckets& b = t.buckets;
  if (!finite(b.origin_m) || !positive(b.size_m[0]) || !positive(b.size_m[1])) return ImageStatus::BadBuckets;
  if (b.count[0] == 0 || b.count[1] == 0) return ImageStatus::BadBuckets;
  const std::uint64_t count = static_cast<std::uint64_t>(b.count[0]) * b.count[1];
  if (b.begin.size() != count + 1 || !begins_ok(b.begin, b.begin.size() - 1, b.cell.size())) return ImageStatus::BadBuckets;
  std::uint64_t expected = 0;
  for (const Cell& cell : t.cell) {
    const BucketRange r = buckets_of(t, cell);
    expected += static_cast<std::uint64_t>(r.last[0] - r.first[0] + 1) * (r.last[1] - r.first[1] + 1);
  }
  if (expected != b.cell.size()) return ImageStatus::BadBuckets;
  std::size_t longest = 0;
  for (std::uint32_t j = 0; j < b.count[1]; ++j)
    for (std::uint32_t i = 0; i < b.count[0]; ++i) {
      const auto cells = list(b.begin, b.cell, static_cast<std::size_t>(j) * b.count[0] + i);
      longest = std::max(longest, cells.size());
      if (!ascending(cells, t.cell.size())) return ImageStatus::BadBuckets;
      for (const std::uint32_t c : cells) {
        const BucketRange r = buckets_of(t, t.cell[c]);
        if (i < r.first[0] || i > r.last[0] || j < r.first[1] || j > r.last[1]) return ImageStatus::BadBuckets;
      }
    }
  if (longest > capacity::cells_per_bucket) return ImageStatus::TooLarge;
  return longest == need.cells_per_bucket ? ImageStatus::Ok : ImageStatus::BadBuckets;
}

// Finite, symmetric to the bit, positive where free, zero where fixed. Tiles, so that the transposed reads stay in cache.
template <typename T>
bool compliance_ok(std::span<const T> c, std::span<const std::uint8_t> flags) noexcept {
  constexpr std::size_t tile = 64;
  const std::size_t n = 2 * flags.size();
  for (std::size_t row = 0; row < n; row += tile)
    for (std::size_t column = 0; column <= row; column += tile)
      for (std::size_t i = row; i < std::min(n, row + tile); ++i)
        for (std::size_t j = column; j < std::min(n, column + tile); ++j)
          if (!std::isfinite(c[i * n + j]) || c[i * n + j] != c[j * n + i]) return false;
  for (std::size_t i = 0; i < n; ++i) {
    const bool fixed = (flags[i / 2] & (i % 2 == 0 ? fixed_x : fixed_y)) != 0;
    if (!fixed && !(c[i * n + i] > T(0))) return false;
    if (fixed && !std::all_of(c.begin() + static_cast<std::ptrdiff_t>(i * n), c.begin() + static_cast<std::ptrdiff_t>((i + 1) * n),
                              [](T v) { return v == T(0); })) {
      return false;
    }
  }
  return true;
}

bool compliance_ok(const Tissue& t) noexcept {
  const std::uint64_t entries = static_cast<std::uint64_t>(t.unknowns()) * t.unknowns();
  if (t.compliance32.empty()) return t.compliance64.size() == entries && compliance_ok(t.compliance64, t.node_flags);
  return t.compliance64.empty() && t.compliance32.size() == entries && compliance_ok(t.compliance32, t.node_flags);
}

bool in_cell(const Tissue& t, const Cell& cell, const Vector2& x) noexcept {
  for (std::size_t k = 0; k < cell.count; ++k) {
    const Vector2& a = t.node_m[cell.node[k]];
    const Vector2& b = t.node_m[cell.node[(k + 1U) % cell.count]];
    const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
    if (!(corner_area(a, b, x) >= -explicit_point_tolerance_m * length)) return false;
  }
  return true;
}

bool in_tissue(const Tissue& t, const Vector2& x) noexcept {
  const auto index = [&](std::size_t axis, double shift) { return bucket_index(t.buckets, axis, x[axis] + shift); };
  constexpr double reach = explicit_point_tolerance_m;
  for (std::size_t j = index(1, -reach); j <= index(1, reach); ++j)
    for (std::size_t i = index(0, -reach); i <= index(0, reach); ++i)
      for (const std::uint32_t c : list(t.buckets.begin, t.buckets.cell, j * t.buckets.count[0] + i))
        if (in_cell(t, t.cell[c], x)) return true;
  return false;
}

ImageStatus check_law(const Image& image) noexcept {
  const contact::Law& law = *image.law;
  std::uint8_t method = 0;
  std::memcpy(&method, &law.method, sizeof method);
  if (method > static_cast<std::uint8_t>(contact::Method::Adapt)) return ImageStatus::BadLaw;
  if (law.method == contact::Method::Adapt && image.tissue.model == element::Model::Solid) return ImageStatus::BadLaw;
  if (law.velocity.rows > capacity::velocity_law_rows || law.explicit_count > capacity::contacts) return ImageStatus::TooLarge;
  if (!not_negative(law.shaft_n_per_m) || !not_negative(law.tip_n_per_m) || !not_negative(law.tip_zone_m)) return ImageStatus::BadLaw;
  if (!(law.explicit_count == 0 ? positive(law.spacing_m) : not_negative(law.spacing_m))) return ImageStatus::BadLaw;
  for (std::size_t i = 0; i < law.velocity.rows; ++i) {
    const auto& v = law.velocity;
    if (!not_negative(v.speed_m_s[i]) || !not_negative(v.shaft_n_per_m[i]) || !not_negative(v.tip_n_per_m[i])) return ImageStatus::BadLaw;
    if (i > 0 && !(v.speed_m_s[i] > v.speed_m_s[i - 1])) return ImageStatus::BadLaw;
  }
  for (std::size_t i = 0; i < law.explicit_count; ++i) {
    if (!not_negative(law.explicit_slip_force_n[i]) || !finite(law.explicit_point_m[i])) return ImageStatus::BadLaw;
    if (!in_tissue(image.tissue, law.explicit_point_m[i])) return ImageStatus::BadLaw;
  }
  return ImageStatus::Ok;
}

}  // namespace

ImageStatus verify(const Image& image) noexcept {
  const Tissue& t = image.tissue;
  if (!tissue_ok(t)) return ImageStatus::BadTissue;
  if (!positive(image.needle.length_m) || !not_negative(image.needle.radius_m)) return ImageStatus::BadNeedle;
  const Needle& needle = image.needle;
  if (needle.elements > capacity::needle_elements || !std::isfinite(needle.curvature_per_m) || !std::isfinite(needle.tip_lateral) ||
      !std::isfinite(needle.face_rad) || (needle.elements > 0 && !(positive(needle.bending_nm2) && positive(needle.axial_n))))
    return ImageStatus::BadNeedle;
  const Need& need = image.need;
  if (t.node_m.size() > max_nodes || need.contacts > capacity::contacts || need.cells_per_bucket > capacity::cells_per_bucket ||
      need.ring_cells > capacity::ring_cells) {
    return ImageStatus::TooLarge;
  }
  if (t.node_m.empty() || t.node_flags.size() != t.node_m.size() || t.cell.empty() || t.cell.size() > 4 * max_nodes ||
      !std::all_of(t.node_m.begin(), t.node_m.end(), finite) ||
      !std::all_of(t.cell.begin(), t.cell.end(), [&](const Cell& cell) { return cell_ok(t, cell); }) || !rings_ok(t)) {
    return ImageStatus::BadMesh;
  }
  // Before the edges: all cells of a ring share their node's bucket, so this bounds the rings too, and hostile ones cost no quadratic time.
  if (const ImageStatus status = check_buckets(t, need); status != ImageStatus::Ok) return status;
  std::uint32_t ring_cells = 0;
  if (!edges_ok(t) || !flags_ok(t, ring_cells)) return ImageStatus::BadMesh;
  if (ring_cells != need.ring_cells) return ImageStatus::BadMesh;
  if (!compliance_ok(t) || !not_negative(image.float32_error.compliance) || !not_negative(image.float32_error.force)) {
    return ImageStatus::BadCompliance;
  }
  return check_law(image);
}

}  // namespace trocar::model
