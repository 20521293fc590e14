// Bytes of a model image, version 3. Header, then the sections in the order of Section, each on the next multiple of image_alignment;
// gaps are zero, and the file ends with the last section's last byte. Numbers are the machine's own (the byte order mark tells a foreign
// one); structs are stored as they stand, and a section records their size, so that a change of layout is noticed as another version.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "common/model/image.hpp"

namespace trocar::model::layout {

inline constexpr std::array<char, 8> magic{'T', 'R', 'O', 'C', 'A', 'R', 'M', 'I'};
inline constexpr std::uint32_t byte_order = 0x01020304;
inline constexpr std::uint32_t version = 3;

enum class Section : std::uint8_t {
  Parameters,
  Nodes,
  NodeFlags,
  Cells,
  RingBegin,
  RingCells,
  Materials,
  BucketBegin,
  BucketCells,
  Compliance64,  // one of the two is empty
  Compliance32,
  Law,
};
inline constexpr std::size_t sections = 12;

struct SectionEntry {
  std::uint64_t offset{};  // from the first byte of the image
  std::uint64_t count{};
  std::uint64_t element_bytes{};
};

struct Header {
  std::array<char, 8> magic{};
  std::uint32_t byte_order{};
  std::uint32_t version{};
  std::uint64_t total_bytes{};
  std::uint32_t checksum{};  // CRC-32 of the whole image with zero in this field
  std::uint32_t reserved{};
  std::array<SectionEntry, sections> section{};
};

struct Parameters {
  std::uint8_t model{};
  std::uint8_t integration{};
  std::array<std::uint8_t, 6> reserved{};
  double thickness_m{};
  double edge_length_m{};
  Vector2 bucket_origin_m{};
  Vector2 bucket_size_m{};
  std::array<std::uint32_t, 2> bucket_count{};
  Needle needle{};
  Need need{};
  std::uint32_t reserved_too{};
  Float32Error float32_error{};
};

// No hidden padding: these bytes are written as they are.
static_assert(std::has_unique_object_representations_v<Header>);
static_assert(sizeof(Header) == 32 + sections * sizeof(SectionEntry));
static_assert(std::has_unique_object_representations_v<Need> && std::is_trivially_copyable_v<Parameters>);
static_assert(sizeof(Parameters) == 8 + 6 * sizeof(double) + 8 + sizeof(Needle) + sizeof(Need) + 4 + sizeof(Float32Error));
static_assert(std::has_unique_object_representations_v<Cell> && sizeof(Vector2) == 16 && sizeof(element::Material) == 16);
static_assert(std::is_trivially_copyable_v<contact::Law>);

inline constexpr std::array<std::size_t, sections> element_bytes{
    sizeof(Parameters),        sizeof(Vector2),       sizeof(std::uint8_t),  sizeof(Cell),   sizeof(std::uint32_t), sizeof(std::uint32_t),
    sizeof(element::Material), sizeof(std::uint32_t), sizeof(std::uint32_t), sizeof(double), sizeof(float),         sizeof(contact::Law)};

[[nodiscard]] constexpr std::uint64_t align(std::uint64_t offset) noexcept {
  return (offset + image_alignment - 1) / image_alignment * image_alignment;
}

}  // namespace trocar::model::layout
