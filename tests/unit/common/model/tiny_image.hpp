// An image small enough to write down by hand: a 20 x 20 mm patch of three quads and two triangles.
//   6---7---8
//   | \3|   |      cell 2 is (3, 4, 7), cell 3 is (3, 7, 6); the lower edge (nodes 0, 1, 2) is fixed;
//   |2 \| 4 |      the right edge borders on tissue that is no candidate
//   3---4---5
//   | 0 | 1 |
//   0---1---2
#pragma once

#include <cmath>
#include <memory>
#include <new>
#include <vector>

#include "common/model/image.hpp"

namespace trocar::model::testing {

struct Free {
  void operator()(std::byte* bytes) const { ::operator delete[](bytes, std::align_val_t{image_alignment}); }
};

// Exactly as many bytes as asked for, so that a sanitizer sees the first one read beyond them.
class Bytes {
 public:
  explicit Bytes(std::size_t size)
      : size_(size), data_(static_cast<std::byte*>(::operator new[](size, std::align_val_t{image_alignment}))) {}
  explicit Bytes(std::span<const std::byte> from) : Bytes(from.size()) { std::copy(from.begin(), from.end(), data_.get()); }
  [[nodiscard]] std::span<std::byte> span() const { return {data_.get(), size_}; }

 private:
  std::size_t size_;
  std::unique_ptr<std::byte[], Free> data_;
};

struct TinyImage {
  std::vector<Vector2> node_m{};
  std::vector<std::uint8_t> flags = std::vector<std::uint8_t>{fixed_x | fixed_y | whole_ring,
                                                              fixed_x | fixed_y | whole_ring,
                                                              fixed_x | fixed_y,
                                                              whole_ring,
                                                              whole_ring,
                                                              0,
                                                              whole_ring,
                                                              whole_ring,
                                                              0};
  std::vector<Cell> cell{{{0, 1, 4, 3}, {surface, 1, 2, surface}, 4, 0},
                         {{1, 2, 5, 4}, {surface, limit, 4, 0}, 4, 1},
                         {{3, 4, 7, 0}, {0, 4, 3, surface}, 3, 0},
                         {{3, 7, 6, 0}, {2, surface, surface, surface}, 3, 0},
                         {{4, 5, 8, 7}, {1, limit, surface, 2}, 4, 1}};
  std::vector<std::uint32_t> ring_begin{0, 1, 3, 4, 7, 11, 13, 14, 17, 18};
  std::vector<std::uint32_t> ring_cell{0, 0, 1, 1, 0, 2, 3, 0, 1, 2, 4, 1, 4, 3, 2, 3, 4, 4};
  std::vector<element::Material> material{{25e3, 0.48}, {50e3, 0.3}};
  // Two columns of buckets, split at x = 10 mm, which belongs to the right one.
  std::vector<std::uint32_t> bucket_begin{0, 3, 8};
  std::vector<std::uint32_t> bucket_cell{0, 2, 3, 0, 1, 2, 3, 4};
  std::vector<double> compliance64{};
  std::vector<float> compliance32{};
  contact::Law law{};
  Image image{};

  TinyImage() {
    for (int n = 0; n < 9; ++n) node_m.push_back({0.01 * (n % 3), 0.01 * (n / 3)});
    constexpr int fixed = 6;
    compliance64.assign(18 * 18, 0.0);
    for (int i = fixed; i < 18; ++i)
      for (int j = fixed; j < 18; ++j) compliance64[static_cast<std::size_t>(18 * i + j)] = 1e-3 * std::exp(-std::abs(i - j));
    law.shaft_n_per_m = 34.0;
    law.tip_n_per_m = 68.0;
    law.tip_zone_m = 0.0025;
    law.spacing_m = 0.005;
    law.velocity.rows = 2;
    law.velocity.speed_m_s = {0.001, 0.009};
    law.velocity.shaft_n_per_m = {34.0, 60.0};
    law.velocity.tip_n_per_m = {68.0, 61.0};
    law.explicit_count = 1;
    law.explicit_point_m[0] = {0.02, 0.015};
    law.explicit_slip_force_n[0] = 0.085;
    image.tissue.model = element::Model::PlaneStress;
    image.tissue.integration = element::Integration::BBar;
    image.tissue.thickness_m = 0.011;
    image.tissue.edge_length_m = 0.01;
    image.tissue.buckets.size_m = {0.01, 0.02};
    image.tissue.buckets.count = {2, 1};
    image.needle = {0.1, 0.0007};
    image.need = {.contacts = 20, .cells_per_bucket = 5, .ring_cells = 4};
    image.float32_error = {6e-8, 1e-6};
  }

  void store_float32() {
    compliance32.assign(compliance64.begin(), compliance64.end());
    compliance64.clear();
  }

  // The image with the vectors as they are now.
  [[nodiscard]] const Image& view() {
    Tissue& t = image.tissue;
    t.node_m = node_m;
    t.node_flags = flags;
    t.cell = cell;
    t.ring_begin = ring_begin;
    t.ring_cell = ring_cell;
    t.material = material;
    t.buckets.begin = bucket_begin;
    t.buckets.cell = bucket_cell;
    t.compliance64 = compliance64;
    t.compliance32 = compliance32;
    image.law = &law;
    return image;
  }

  [[nodiscard]] Bytes bytes() {
    const Bytes out(image_size(view()));
    write(view(), out.span());
    return Bytes(out.span());
  }
};

}  // namespace trocar::model::testing
