#include "common/model/image.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>

#include "common/core/checksum.hpp"
#include "common/model/image_layout.hpp"
#include "tiny_image.hpp"

namespace trocar::model {
void PrintTo(ImageStatus status, std::ostream* out) { *out << to_string(status); }

namespace {

using testing::Bytes;
using testing::TinyImage;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

ImageStatus status_of(std::span<const std::byte> bytes) {
  Image image{};
  return open(bytes, image);
}

void seal(std::span<std::byte> bytes) {
  constexpr std::size_t at = offsetof(layout::Header, checksum);
  std::memset(bytes.data() + at, 0, 4);
  const std::uint32_t crc = crc32(bytes);
  std::memcpy(bytes.data() + at, &crc, 4);
}

// A header with something changed, and a checksum that matches.
ImageStatus with_header(const std::function<void(layout::Header&)>& change) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  layout::Header header{};
  std::memcpy(&header, bytes.span().data(), sizeof header);
  change(header);
  std::memcpy(bytes.span().data(), &header, sizeof header);
  seal(bytes.span());
  return status_of(bytes.span());
}

// A content with something changed, written as a compiler gone wrong would.
ImageStatus with(const std::function<void(TinyImage&)>& change) {
  TinyImage tiny;
  change(tiny);
  return status_of(tiny.bytes().span());
}

template <typename T>
std::vector<T> copy(std::span<const T> values) {
  return {values.begin(), values.end()};
}

TEST(ModelImage, GivesBackWhatWasWritten) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  Image image{};
  ASSERT_EQ(open(bytes.span(), image), ImageStatus::Ok);
  const Tissue& t = image.tissue;
  EXPECT_EQ(t.model, element::Model::PlaneStress);
  EXPECT_EQ(t.integration, element::Integration::BBar);
  EXPECT_EQ(t.thickness_m, 0.011);
  EXPECT_EQ(t.edge_length_m, 0.01);
  EXPECT_EQ(copy(t.node_m), tiny.node_m);
  EXPECT_EQ(copy(t.node_flags), tiny.flags);
  ASSERT_EQ(t.cell.size(), tiny.cell.size());
  for (std::size_t c = 0; c < t.cell.size(); ++c) EXPECT_EQ(std::memcmp(&t.cell[c], &tiny.cell[c], sizeof(Cell)), 0) << c;
  EXPECT_EQ(copy(t.ring_begin), tiny.ring_begin);
  EXPECT_EQ(copy(t.ring_cell), tiny.ring_cell);
  ASSERT_EQ(t.material.size(), 2U);
  EXPECT_EQ(t.material[1].young_pa, 50e3);
  EXPECT_EQ(t.material[1].poisson, 0.3);
  EXPECT_EQ(copy(t.buckets.begin), tiny.bucket_begin);
  EXPECT_EQ(copy(t.buckets.cell), tiny.bucket_cell);
  EXPECT_EQ(t.buckets.count, (std::array<std::uint32_t, 2>{2, 1}));
  EXPECT_EQ(copy(t.compliance64), tiny.compliance64);
  EXPECT_TRUE(t.compliance32.empty());
  EXPECT_EQ(image.law->shaft_n_per_m, 34.0);
  EXPECT_EQ(image.law->velocity.rows, 2U);
  EXPECT_EQ(image.law->velocity.tip_n_per_m[1], 61.0);
  EXPECT_EQ(image.law->explicit_point_m[0], (Vector2{0.02, 0.015}));
  EXPECT_EQ(image.needle.length_m, 0.1);
  EXPECT_EQ(image.needle.radius_m, 0.0007);
  EXPECT_EQ(image.need.contacts, 20U);
  EXPECT_EQ(image.float32_error.force, 1e-6);
}

TEST(ModelImage, StoresFloat32Instead) {
  TinyImage tiny;
  tiny.store_float32();
  const Bytes bytes = tiny.bytes();
  Image image{};
  ASSERT_EQ(open(bytes.span(), image), ImageStatus::Ok);
  EXPECT_TRUE(image.tissue.compliance64.empty());
  EXPECT_EQ(copy(image.tissue.compliance32), tiny.compliance32);
}

TEST(ModelImage, SameImageGivesSameBytesWhateverLiesInThePadding) {
  TinyImage tiny;
  const Bytes first = tiny.bytes();
  std::vector<std::byte> memory(sizeof(contact::Law) + alignof(contact::Law), std::byte{0xAB});
  void* place = memory.data();
  std::size_t space = memory.size();
  ASSERT_NE(std::align(alignof(contact::Law), sizeof(contact::Law), place, space), nullptr);
  const contact::Law* dirty = new (place) contact::Law(tiny.law);
  std::memset(static_cast<std::byte*>(place) + 1, 0xAB, 7);  // between method and the first density
  Image image = tiny.view();
  image.law = dirty;
  const Bytes second(image_size(image));
  write(image, second.span());
  EXPECT_TRUE(std::ranges::equal(first.span(), second.span()));
}

TEST(ModelImage, SectionsAreAligned) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  Image image{};
  ASSERT_EQ(open(bytes.span(), image), ImageStatus::Ok);
  for (const void* p : {static_cast<const void*>(image.tissue.node_m.data()), static_cast<const void*>(image.tissue.cell.data()),
                        static_cast<const void*>(image.tissue.compliance64.data()), static_cast<const void*>(image.law)}) {
    EXPECT_EQ(reinterpret_cast<std::uintptr_t>(p) % image_alignment, 0U);
  }
}

TEST(ModelImage, EveryFlippedBitIsRefused) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  Image image{};
  for (std::size_t bit = 0; bit < 8 * bytes.span().size(); ++bit) {
    std::byte& byte = bytes.span()[bit / 8];
    byte ^= std::byte{1} << (bit % 8);
    ASSERT_NE(open(bytes.span(), image), ImageStatus::Ok) << "bit " << bit;
    byte ^= std::byte{1} << (bit % 8);
  }
  EXPECT_EQ(image.law, nullptr) << "a refused image was written out";
  EXPECT_EQ(open(bytes.span(), image), ImageStatus::Ok);
}

TEST(ModelImage, EveryTruncationIsRefused) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  for (std::size_t size = 0; size < bytes.span().size(); ++size) {
    const Bytes cut(bytes.span().first(size));
    ASSERT_EQ(status_of(cut.span()), ImageStatus::TooShort) << size;
  }
}

TEST(ModelImage, TrailingBytesAreRefused) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  const Bytes longer(bytes.span().size() + 1);
  std::ranges::copy(bytes.span(), longer.span().begin());
  longer.span().back() = std::byte{0};
  EXPECT_EQ(status_of(longer.span()), ImageStatus::WrongSize);
}

TEST(ModelImage, UnalignedMemoryIsRefused) {
  TinyImage tiny;
  const Bytes bytes = tiny.bytes();
  const Bytes room(bytes.span().size() + 8);
  std::ranges::copy(bytes.span(), room.span().begin() + 8);
  EXPECT_EQ(status_of(room.span().subspan(8)), ImageStatus::Misaligned);
}

TEST(ModelImage, ForeignHeadersAreNamed) {
  EXPECT_EQ(with_header([](auto&) {}), ImageStatus::Ok);
  EXPECT_EQ(with_header([](auto& h) { h.magic[0] = 't'; }), ImageStatus::NotAnImage);
  EXPECT_EQ(with_header([](auto& h) { h.byte_order = 0x04030201; }), ImageStatus::WrongByteOrder);
  EXPECT_EQ(with_header([](auto& h) { ++h.version; }), ImageStatus::WrongVersion);
  EXPECT_EQ(with_header([](auto& h) { h.version = 0; }), ImageStatus::WrongVersion);
  EXPECT_EQ(with_header([](auto& h) { h.section[11].element_bytes -= 8; }), ImageStatus::WrongVersion);
  EXPECT_EQ(with_header([](auto& h) { h.reserved = 1; }), ImageStatus::BadLayout);
}

TEST(ModelImage, HostileSectionTablesAreNamed) {
  for (std::size_t s = 0; s < layout::sections; ++s) {
    SCOPED_TRACE(s);
    for (const std::uint64_t offset : {std::uint64_t{0}, std::uint64_t{1} << 40U, ~std::uint64_t{0}, ~std::uint64_t{63}})
      EXPECT_EQ(with_header([&](auto& h) { h.section[s].offset = offset; }), ImageStatus::BadLayout);
    for (const std::uint64_t count : {~std::uint64_t{0}, std::uint64_t{1} << 60U, std::uint64_t{1} << 61U, std::uint64_t{1} << 32U})
      EXPECT_EQ(with_header([&](auto& h) { h.section[s].count = count; }), ImageStatus::BadLayout);
    EXPECT_NE(with_header([&](auto& h) { ++h.section[s].count; }), ImageStatus::Ok);
    EXPECT_NE(with_header([&](auto& h) { --h.section[s].count; }), ImageStatus::Ok);
    EXPECT_EQ(with_header([&](auto& h) { h.section[s].element_bytes = 0; }), ImageStatus::WrongVersion);
  }
}

TEST(ModelImage, HostileContentIsNamed) {
  using Change = std::function<void(TinyImage&)>;
  const auto expect = [](ImageStatus status, const std::vector<Change>& changes) {
    for (std::size_t i = 0; i < changes.size(); ++i) EXPECT_EQ(with(changes[i]), status) << "change " << i;
  };
  expect(ImageStatus::Ok, {[](TinyImage&) {}, [](TinyImage& t) { t.law.explicit_count = 0; },
                           [](TinyImage& t) {
                             t.law.explicit_point_m[0] = {0.02 + 0.9e-9, 0.015};
                           }});
  expect(ImageStatus::BadTissue,
         {[](TinyImage& t) { t.image.tissue.model = static_cast<element::Model>(3); },
          [](TinyImage& t) { t.image.tissue.integration = static_cast<element::Integration>(2); },
          [](TinyImage& t) { t.image.tissue.thickness_m = 0.0; }, [](TinyImage& t) { t.image.tissue.thickness_m = nan; },
          [](TinyImage& t) { t.image.tissue.edge_length_m = 0.0; }, [](TinyImage& t) { t.material.clear(); },
          [](TinyImage& t) { t.material[0].young_pa = infinity; }, [](TinyImage& t) { t.material[0].young_pa = 0.0; },
          [](TinyImage& t) { t.material[1].poisson = 0.5; }, [](TinyImage& t) { t.material[1].poisson = -0.1; }});
  expect(ImageStatus::BadNeedle, {[](TinyImage& t) { t.image.needle.length_m = 0.0; }, [](TinyImage& t) { t.image.needle.length_m = nan; },
                                  [](TinyImage& t) { t.image.needle.radius_m = -1.0; }});
  expect(ImageStatus::TooLarge, {[](TinyImage& t) { t.image.need.contacts = capacity::contacts + 1; },
                                 [](TinyImage& t) { t.image.need.cells_per_bucket = capacity::cells_per_bucket + 1; },
                                 [](TinyImage& t) { t.image.need.ring_cells = capacity::ring_cells + 1; },
                                 [](TinyImage& t) { t.law.explicit_count = capacity::contacts + 1; },
                                 [](TinyImage& t) { t.law.velocity.rows = capacity::velocity_law_rows + 1; }});
  expect(ImageStatus::BadMesh, {[](TinyImage& t) {
                                  t.node_m.clear();
                                  t.flags.clear();
                                },
                                [](TinyImage& t) { t.flags.pop_back(); },
                                [](TinyImage& t) { t.cell.clear(); },
                                [](TinyImage& t) { t.node_m[4][0] = nan; },
                                [](TinyImage& t) { t.node_m[4][1] = infinity; },
                                [](TinyImage& t) {
                                  t.node_m[4] = {0.03, 0.0};
                                },  // inverted
                                [](TinyImage& t) {
                                  t.node_m[4] = {1e300, 1e300};
                                },  // areas overflow
                                [](TinyImage& t) { t.cell[0].node[2] = 9; },
                                [](TinyImage& t) { t.cell[0].node[2] = 0xFFFFFFFF; },
                                [](TinyImage& t) { std::swap(t.cell[0].node[1], t.cell[0].node[3]); },  // clockwise
                                [](TinyImage& t) { t.cell[0].count = 5; },
                                [](TinyImage& t) { t.cell[0].count = 2; },
                                [](TinyImage& t) { t.cell[0].count = 0; },
                                [](TinyImage& t) { t.cell[2].node[3] = 8; },
                                [](TinyImage& t) { t.cell[2].neighbour[3] = 1; },
                                [](TinyImage& t) { t.cell[1].material = 2; },
                                [](TinyImage& t) { t.cell[0].neighbour[0] = -3; },
                                [](TinyImage& t) { t.cell[0].neighbour[0] = 5; },
                                [](TinyImage& t) { t.cell[0].neighbour[1] = 4; },        // not across that edge
                                [](TinyImage& t) { t.cell[0].neighbour[1] = surface; },  // one-sided
                                [](TinyImage& t) { t.cell[0].neighbour[0] = 1; },        // across nothing
                                [](TinyImage& t) { t.flags[4] |= 8; },
                                [](TinyImage& t) { t.flags[5] = whole_ring; },
                                [](TinyImage& t) { t.image.need.ring_cells = 3; },
                                [](TinyImage& t) { t.ring_begin.pop_back(); },
                                [](TinyImage& t) { t.ring_begin[0] = 1; },
                                [](TinyImage& t) { t.ring_begin[3] = 0xFFFFFFFF; },
                                [](TinyImage& t) { std::swap(t.ring_begin[4], t.ring_begin[5]); },
                                [](TinyImage& t) { t.ring_begin.back() = 19; },
                                [](TinyImage& t) { t.ring_cell[0] = 5; },
                                [](TinyImage& t) { t.ring_cell[0] = 1; },  // not around node 0
                                [](TinyImage& t) { t.ring_cell[2] = 0; },  // twice the same
                                [](TinyImage& t) {
                                  t.ring_cell.push_back(4);
                                  t.ring_begin.back() = 19;
                                }});
  // A copy of cell 0 on top of it: the same directed edges twice.
  expect(ImageStatus::BadMesh, {[](TinyImage& t) {
           t.cell.push_back({{0, 1, 4, 3}, {surface, 1, 2, surface}, 4, 0});
           t.ring_begin = {0, 2, 5, 6, 10, 15, 17, 18, 21, 22};
           t.ring_cell = {0, 5, 0, 1, 5, 1, 0, 2, 3, 5, 0, 1, 2, 4, 5, 1, 4, 3, 2, 3, 4, 4};
           t.bucket_begin = {0, 4, 10};
           t.bucket_cell = {0, 2, 3, 5, 0, 1, 2, 3, 4, 5};
           t.image.need.cells_per_bucket = 6;
         }});
  expect(ImageStatus::BadBuckets,
         {[](TinyImage& t) { t.image.tissue.buckets.size_m[0] = 0.0; }, [](TinyImage& t) { t.image.tissue.buckets.size_m[1] = nan; },
          [](TinyImage& t) { t.image.tissue.buckets.origin_m[0] = infinity; },
          [](TinyImage& t) { t.image.tissue.buckets.origin_m[0] = -1e300; },
          [](TinyImage& t) {
            t.image.tissue.buckets.count = {0, 1};
          },
          [](TinyImage& t) {
            t.image.tissue.buckets.count = {0xFFFFFFFF, 0xFFFFFFFF};
          },
          [](TinyImage& t) {
            t.image.tissue.buckets.count = {1, 2};
          },
          [](TinyImage& t) { t.bucket_begin.clear(); }, [](TinyImage& t) { t.bucket_begin[1] = 9; },
          [](TinyImage& t) { t.bucket_begin[1] = 2; }, [](TinyImage& t) { t.bucket_cell[0] = 5; },
          [](TinyImage& t) { t.bucket_cell[0] = 0xFFFFFFFF; },
          [](TinyImage& t) {
            t.bucket_begin = {0, 2, 7};
            t.bucket_cell.erase(t.bucket_cell.begin());
          },                                                                                                                // misses one
          [](TinyImage& t) { std::swap(t.bucket_cell[0], t.bucket_cell[1]); }, [](TinyImage& t) { t.bucket_cell[2] = 4; },  // not there
          [](TinyImage& t) { t.image.need.cells_per_bucket = 4; }});
  expect(ImageStatus::BadCompliance,
         {[](TinyImage& t) { t.compliance64.clear(); }, [](TinyImage& t) { t.compliance64.pop_back(); },
          [](TinyImage& t) { t.compliance32.assign(18 * 18, 0.0F); },  // both
          [](TinyImage& t) {
            t.compliance64[18 * 9 + 12] = nan;
            t.compliance64[18 * 12 + 9] = nan;
          },
          [](TinyImage& t) { t.compliance64[18 * 17 + 17] = infinity; },
          [](TinyImage& t) { t.compliance64[18 * 9 + 12] = std::nextafter(t.compliance64[18 * 9 + 12], 1.0); },
          [](TinyImage& t) { t.compliance64[18 * 9 + 9] = 0.0; }, [](TinyImage& t) { t.compliance64[18 * 9 + 9] = -1e-3; },
          [](TinyImage& t) { t.compliance64[0] = 1e-9; },  // fixed
          [](TinyImage& t) {
            t.store_float32();
            t.compliance32[18 * 9 + 12] = std::nextafter(t.compliance32[18 * 9 + 12], 1.0F);
          },
          [](TinyImage& t) { t.image.float32_error.force = nan; }});
  expect(ImageStatus::BadLaw,
         {[](TinyImage& t) { t.law.method = contact::Method::Subdivide; },
          [](TinyImage& t) { t.law.method = static_cast<contact::Method>(200); },
          [](TinyImage& t) {
            t.law.method = contact::Method::Adapt;
            t.image.tissue.model = element::Model::Solid;
          },
          [](TinyImage& t) { t.law.shaft_n_per_m = nan; }, [](TinyImage& t) { t.law.tip_n_per_m = -1.0; },
          [](TinyImage& t) { t.law.tip_zone_m = infinity; },
          [](TinyImage& t) {
            t.law.explicit_count = 0;
            t.law.spacing_m = 0.0;
          },
          [](TinyImage& t) { t.law.velocity.speed_m_s[1] = 0.001; }, [](TinyImage& t) { t.law.velocity.shaft_n_per_m[0] = -1.0; },
          [](TinyImage& t) { t.law.velocity.tip_n_per_m[1] = nan; }, [](TinyImage& t) { t.law.explicit_slip_force_n[0] = -1.0; },
          [](TinyImage& t) {
            t.law.explicit_point_m[0] = {nan, 0.0};
          },
          [](TinyImage& t) {
            t.law.explicit_point_m[0] = {0.02 + 2e-9, 0.015};
          },
          [](TinyImage& t) {
            t.law.explicit_point_m[0] = {1e300, -1e300};
          }});
}

// Whatever the bytes are: with the checksum made to match, the answer is a status, and nothing outside is read (run under sanitizers).
TEST(ModelImage, RandomDamageWithMatchingChecksumNeverEscapes) {
  std::mt19937_64 random(7);
  TinyImage tiny;
  const Bytes good = tiny.bytes();
  std::size_t accepted = 0;
  constexpr std::size_t trials = 20000;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    const Bytes bytes(good.span());
    const std::size_t changes = 1 + random() % 4;
    for (std::size_t k = 0; k < changes; ++k) {
      // Every other time in the header, whose fields lead farthest.
      const std::size_t range = random() % 2 == 0 ? sizeof(layout::Header) : bytes.span().size();
      bytes.span()[random() % range] = static_cast<std::byte>(random() % 3 == 0 ? 0xFF : random());
    }
    seal(bytes.span());
    Image image{};
    if (open(bytes.span(), image) == ImageStatus::Ok) ++accepted;
  }
  EXPECT_LT(accepted, trials / 2);  // last bits of numbers may change unnoticed; structure may not
}

TEST(ModelSlot, KeepsTheRunningImageWhenTheNewOneIsRefused) {
  TinyImage tiny;
  const Bytes first = tiny.bytes();
  Slot slot;
  EXPECT_EQ(slot.image(), nullptr);
  EXPECT_EQ(slot.swap(first.span().first(100)), ImageStatus::TooShort);
  EXPECT_EQ(slot.image(), nullptr);
  ASSERT_EQ(slot.swap(first.span()), ImageStatus::Ok);
  ASSERT_NE(slot.image(), nullptr);
  const Vector2* nodes = slot.image()->tissue.node_m.data();

  tiny.image.needle.length_m = 0.2;
  const Bytes second = tiny.bytes();
  second.span()[second.span().size() / 2] ^= std::byte{1};
  EXPECT_EQ(slot.swap(second.span()), ImageStatus::Damaged);
  EXPECT_EQ(slot.image()->tissue.node_m.data(), nodes);
  EXPECT_EQ(slot.image()->needle.length_m, 0.1);
  second.span()[second.span().size() / 2] ^= std::byte{1};
  EXPECT_EQ(slot.swap(second.span()), ImageStatus::Ok);
  EXPECT_EQ(slot.image()->needle.length_m, 0.2);
}

TEST(ModelImage, EveryStatusSaysWhatToDo) {
  for (std::uint8_t s = 1; s <= static_cast<std::uint8_t>(ImageStatus::BadNeedle); ++s) {
    const std::string text = to_string(static_cast<ImageStatus>(s));
    EXPECT_NE(text.find(';'), std::string::npos) << text;
  }
}

TEST(ModelBuckets, IndexStaysInsideWhateverTheCoordinate) {
  Buckets b{};
  b.origin_m = {0.0, 0.0};
  b.size_m = {0.5, 1.0};
  b.count = {4, 1};
  for (const auto& [x, index] : std::vector<std::pair<double, std::uint32_t>>{
           {-infinity, 0}, {-1.0, 0}, {0.0, 0}, {0.49, 0}, {0.5, 1}, {1.99, 3}, {2.0, 3}, {1e300, 3}, {infinity, 3}, {nan, 0}}) {
    EXPECT_EQ(bucket_index(b, 0, x), index) << x;
  }
}

}  // namespace
}  // namespace trocar::model
