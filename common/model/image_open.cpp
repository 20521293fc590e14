#include <cstring>

#include "common/core/checksum.hpp"
#include "common/model/image_layout.hpp"
#include "common/model/verify.hpp"

namespace trocar::model {
namespace {

using namespace layout;

// Sections follow each other without a gap beyond alignment, so an entry's offset is not free: nothing can overlap or leave the bytes.
ImageStatus check_layout(const Header& header) noexcept {
  std::uint64_t end = sizeof(Header);
  for (std::size_t s = 0; s < sections; ++s) {
    const SectionEntry& entry = header.section[s];
    if (entry.element_bytes != element_bytes[s]) return ImageStatus::WrongVersion;
    if (entry.offset != align(end) || entry.offset > header.total_bytes) return ImageStatus::BadLayout;
    if (entry.count > (header.total_bytes - entry.offset) / entry.element_bytes) return ImageStatus::BadLayout;
    end = entry.offset + entry.count * entry.element_bytes;
  }
  const auto count = [&](Section s) { return header.section[static_cast<std::size_t>(s)].count; };
  if (end != header.total_bytes || count(Section::Parameters) != 1 || count(Section::Law) != 1) return ImageStatus::BadLayout;
  return ImageStatus::Ok;
}

ImageStatus check_envelope(std::span<const std::byte> bytes, Header& header) noexcept {
  if (bytes.size() < sizeof header) return ImageStatus::TooShort;
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.magic != magic) return ImageStatus::NotAnImage;
  if (header.byte_order != byte_order) return ImageStatus::WrongByteOrder;
  if (header.version != version) return ImageStatus::WrongVersion;
  if (bytes.size() < header.total_bytes) return ImageStatus::TooShort;
  if (bytes.size() > header.total_bytes) return ImageStatus::WrongSize;
  Header blank = header;
  blank.checksum = 0;
  const std::uint32_t start = crc32(std::as_bytes(std::span(&blank, 1)));
  if (crc32(bytes.subspan(sizeof header), start) != header.checksum) return ImageStatus::Damaged;
  if (header.reserved != 0) return ImageStatus::BadLayout;
  if (reinterpret_cast<std::uintptr_t>(bytes.data()) % image_alignment != 0) return ImageStatus::Misaligned;
  return check_layout(header);
}

// The sections are aligned and hold plain data of the type that the layout says.
template <typename T>
std::span<const T> view(std::span<const std::byte> bytes, const Header& header, Section s) noexcept {
  const SectionEntry& entry = header.section[static_cast<std::size_t>(s)];
  return {reinterpret_cast<const T*>(bytes.data() + entry.offset), static_cast<std::size_t>(entry.count)};
}

}  // namespace

ImageStatus open(std::span<const std::byte> bytes, Image& image) noexcept {
  Header header{};
  if (const ImageStatus status = check_envelope(bytes, header); status != ImageStatus::Ok) return status;
  Parameters p{};
  std::memcpy(&p, view<Parameters>(bytes, header, Section::Parameters).data(), sizeof p);
  if (p.model > static_cast<std::uint8_t>(element::Model::Solid) || p.integration > static_cast<std::uint8_t>(element::Integration::BBar)) {
    return ImageStatus::BadTissue;
  }
  Image found{};
  Tissue& t = found.tissue;
  t.model = static_cast<element::Model>(p.model);
  t.integration = static_cast<element::Integration>(p.integration);
  t.thickness_m = p.thickness_m;
  t.edge_length_m = p.edge_length_m;
  t.node_m = view<Vector2>(bytes, header, Section::Nodes);
  t.node_flags = view<std::uint8_t>(bytes, header, Section::NodeFlags);
  t.cell = view<Cell>(bytes, header, Section::Cells);
  t.ring_begin = view<std::uint32_t>(bytes, header, Section::RingBegin);
  t.ring_cell = view<std::uint32_t>(bytes, header, Section::RingCells);
  t.material = view<element::Material>(bytes, header, Section::Materials);
  t.buckets = {.origin_m = p.bucket_origin_m,
               .size_m = p.bucket_size_m,
               .count = p.bucket_count,
               .begin = view<std::uint32_t>(bytes, header, Section::BucketBegin),
               .cell = view<std::uint32_t>(bytes, header, Section::BucketCells)};
  t.compliance64 = view<double>(bytes, header, Section::Compliance64);
  t.compliance32 = view<float>(bytes, header, Section::Compliance32);
  found.law = view<contact::Law>(bytes, header, Section::Law).data();
  found.needle = p.needle;
  found.need = p.need;
  found.float32_error = p.float32_error;
  found.checksum = header.checksum;
  if (const ImageStatus status = verify(found); status != ImageStatus::Ok) return status;
  image = found;
  return ImageStatus::Ok;
}

const char* to_string(ImageStatus status) noexcept {
  switch (status) {
    case ImageStatus::Ok:
      return "good";
    case ImageStatus::TooShort:
      return "ends too early for a model image; copy or compile it again";
    case ImageStatus::NotAnImage:
      return "is not a model image; make one with: trocar scene compile";
    case ImageStatus::WrongByteOrder:
      return "was compiled on a machine of the other byte order; compile the scene on this kind of machine";
    case ImageStatus::WrongVersion:
      return "was compiled by another version of trocar; compile the scene again with this one";
    case ImageStatus::WrongSize:
      return "is longer than its header states; copy or compile it again";
    case ImageStatus::Misaligned:
      return "was not loaded to a multiple of 64 bytes; map the file instead of copying it into unaligned memory";
    case ImageStatus::Damaged:
      return "is damaged: its checksum does not match; copy or compile it again";
    case ImageStatus::BadLayout:
      return "has sections out of place although its checksum matches; compile the scene again";
    case ImageStatus::TooLarge:
      return "needs more than a capacity of this program (common/core/capacities.hpp); compile the scene again, or raise the capacity";
    case ImageStatus::BadTissue:
      return "has a tissue model, thickness or material that cannot be computed; compile the scene again";
    case ImageStatus::BadMesh:
      return "has candidate nodes or cells that make no mesh; compile the scene again";
    case ImageStatus::BadBuckets:
      return "has a cell search that does not hold its cells; compile the scene again";
    case ImageStatus::BadCompliance:
      return "has a compliance that is not finite, symmetric and positive; compile the scene again";
    case ImageStatus::BadLaw:
      return "has a contact law that cannot be computed; compile the scene again";
    case ImageStatus::BadNeedle:
      return "has a needle without a length; compile the scene again";
  }
  return "has an unknown status";
}

}  // namespace trocar::model
