#include <algorithm>
#include <cstring>

#include "common/core/checksum.hpp"
#include "common/model/image_layout.hpp"

namespace trocar::model {
namespace {

using namespace layout;

struct Block {
  const void* data{};
  std::size_t count{};
};

template <typename T>
Block block(std::span<const T> values) noexcept {
  return {values.data(), values.size()};
}

std::array<Block, sections> blocks(const Image& image, const Parameters& parameters) noexcept {
  const Tissue& t = image.tissue;
  return {{{&parameters, 1},
           block(t.node_m),
           block(t.node_flags),
           block(t.cell),
           block(t.ring_begin),
           block(t.ring_cell),
           block(t.material),
           block(t.buckets.begin),
           block(t.buckets.cell),
           block(t.compliance64),
           block(t.compliance32),
           {image.law, 1}}};
}

Parameters parameters_of(const Image& image) noexcept {
  const Tissue& t = image.tissue;
  return {.model = static_cast<std::uint8_t>(t.model),
          .integration = static_cast<std::uint8_t>(t.integration),
          .thickness_m = t.thickness_m,
          .edge_length_m = t.edge_length_m,
          .bucket_origin_m = t.buckets.origin_m,
          .bucket_size_m = t.buckets.size_m,
          .bucket_count = t.buckets.count,
          .needle = image.needle,
          .need = image.need,
          .float32_error = image.float32_error};
}

Header header_of(const std::array<Block, sections>& block) noexcept {
  Header header{.magic = magic, .byte_order = byte_order, .version = version};
  std::uint64_t end = sizeof(Header);
  for (std::size_t s = 0; s < sections; ++s) {
    header.section[s] = {align(end), block[s].count, element_bytes[s]};
    end = header.section[s].offset + block[s].count * element_bytes[s];
  }
  header.total_bytes = end;
  return header;
}

// A member that is added to the law has to be added below: 15 bytes are padding.
static_assert(sizeof(contact::Law) == 15 + sizeof(contact::Method) + 2 * sizeof(std::uint32_t) +
                                          sizeof(double) * (4 + 3 * capacity::velocity_law_rows + 3 * capacity::contacts));

// The padding of a struct that was copied around may hold anything: only its members are written.
void write_law(const contact::Law& law, std::byte* out) noexcept {
  const auto put = [&](const auto& member) {
    const auto offset = reinterpret_cast<const std::byte*>(&member) - reinterpret_cast<const std::byte*>(&law);
    std::memcpy(out + offset, &member, sizeof member);
  };
  put(law.method);
  put(law.shaft_n_per_m);
  put(law.tip_n_per_m);
  put(law.tip_zone_m);
  put(law.spacing_m);
  put(law.velocity.rows);
  put(law.velocity.speed_m_s);
  put(law.velocity.shaft_n_per_m);
  put(law.velocity.tip_n_per_m);
  put(law.explicit_count);
  put(law.explicit_point_m);
  put(law.explicit_slip_force_n);
}

}  // namespace

std::size_t image_size(const Image& image) noexcept { return static_cast<std::size_t>(header_of(blocks(image, {})).total_bytes); }

void write(const Image& image, std::span<std::byte> bytes) noexcept {
  const Parameters parameters = parameters_of(image);
  const auto block = blocks(image, parameters);
  Header header = header_of(block);
  std::size_t end = sizeof(Header);
  for (std::size_t s = 0; s < sections; ++s) {
    const SectionEntry& entry = header.section[s];
    const auto offset = static_cast<std::size_t>(entry.offset);
    const auto size = static_cast<std::size_t>(entry.count * entry.element_bytes);
    std::memset(bytes.data() + end, 0, offset - end);
    end = offset + size;
    if (s == static_cast<std::size_t>(Section::Law)) {
      std::memset(bytes.data() + offset, 0, sizeof(contact::Law));
      write_law(*image.law, bytes.data() + offset);
    } else if (size != 0) {
      std::memcpy(bytes.data() + offset, block[s].data, size);
    }
  }
  std::memcpy(bytes.data(), &header, sizeof header);
  header.checksum = crc32(bytes);
  std::memcpy(bytes.data(), &header, sizeof header);
}

}  // namespace trocar::model
