// Model images as inputs: in aligned memory of exactly their size, and mutated so that they get past the checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "common/core/checksum.hpp"
#include "common/model/image_layout.hpp"
#include "tiny_image.hpp"

#ifdef TROCAR_FUZZ
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);
#endif

namespace trocar::fuzz {

inline model::testing::Bytes aligned(const std::uint8_t* data, std::size_t size) {
  return model::testing::Bytes(std::as_bytes(std::span(data, size)));
}

#ifdef TROCAR_FUZZ
// Three of four times within one section, so that the layout stays sound; the checksum is then made to match, but for one in 64.
inline std::size_t mutate_image(std::uint8_t* data, std::size_t size, std::size_t max_size, unsigned seed) {
  using namespace model::layout;
  Header header{};
  if (size < sizeof header || seed % 4 == 0) {
    size = LLVMFuzzerMutate(data, size, max_size);
  } else {
    std::memcpy(&header, data, sizeof header);
    const std::size_t which = (seed >> 2) % sections;
    const SectionEntry& entry = header.section[which];
    if (entry.count == 0 || entry.offset > size || entry.count > (size - entry.offset) / element_bytes[which]) {
      size = LLVMFuzzerMutate(data, size, max_size);
    } else {
      const std::size_t bytes = entry.count * element_bytes[which];
      // A whole number or one element: mutations of all of a section at once seldom leave it valid.
      const std::size_t part = (seed >> 8) % 2 == 0 ? 8 : element_bytes[which];
      const std::size_t length = part < bytes ? part : bytes;
      const std::size_t at = (seed >> 9) % (bytes / length) * length;
      (void)LLVMFuzzerMutate(data + entry.offset + at, length, length);
    }
  }
  if (size >= sizeof header && seed % 64 != 1) {
    std::memset(data + offsetof(Header, checksum), 0, 4);
    const std::uint32_t crc = crc32(std::as_bytes(std::span(data, size)));
    std::memcpy(data + offsetof(Header, checksum), &crc, 4);
  }
  return size;
}
#endif

}  // namespace trocar::fuzz
