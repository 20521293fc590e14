// The model image: everything of a scene that the tick needs, in one read-only block of bytes. common/condense writes it on the host,
// the real-time process maps, verifies and swaps it in. Layout: image_layout.hpp.
// open() verifies all that a tick relies on, so that a tick needs no checks: checksum; sections that lie inside of the bytes and are
// aligned; every index in range; counter-clockwise convex cells with positive area; neighbours that name each other; rings and buckets that
// hold exactly the cells that they should, within the capacities; finite numbers; a symmetric compliance with a positive diagonal on every
// degree of freedom that is not fixed; a law that can be computed; explicit contacts inside of candidate cells. It reads nothing outside of
// the bytes, whatever they are, and allocates nothing. It takes about a second a gigabyte: call it outside of the tick.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "common/model/law.hpp"
#include "common/model/tissue.hpp"

namespace trocar::model {

inline constexpr std::size_t image_alignment = 64;          // bytes; of the first byte in memory and of every section
inline constexpr std::size_t max_nodes = 1U << 20U;         // candidates; far beyond any memory, so that sizes cannot overflow
inline constexpr double explicit_point_tolerance_m = 1e-9;  // how far outside of a cell an explicit contact may lie

struct Needle {
  double length_m{};         // from base to tip
  double radius_m{};         // outer; 0 when the scene gives none (planar scenes need none)
  std::uint64_t elements{};  // of the beam; 0 for a rigid needle, and then the next three are 0 too
  double bending_nm2{};      // EI
  double axial_n{};          // EA
  double curvature_per_m{};  // of the unloaded needle
  double face_rad{};         // of a bevelled tip, bend it or not: angle between face and shaft, and lateral over cutting force,
  double tip_lateral{};      // both as in needle/bevel.hpp; 0 for a symmetric tip
};

// What a scene takes of common/core/capacities.hpp.
struct Need {
  std::uint32_t contacts{};  // a needle that is all in tissue, or the explicit ones
  std::uint32_t cells_per_bucket{};
  std::uint32_t ring_cells{};  // around a node that may be moved
};

// What storing the compliance in float32 costs, whether it was done or not. Measured by the compiler, which alone has both.
struct Float32Error {
  double compliance{};  // max |C32 - C| / sqrt(C_ii C_jj)
  double force{};       // max |f32 - f| / max |f| of a stuck line of contacts along the corridor under unit lateral and axial displacement
};

// Views into the bytes, which have to outlive it.
struct Image {
  Tissue tissue{};
  const contact::Law* law{};
  Needle needle{};
  Need need{};
  Float32Error float32_error{};
  std::uint32_t checksum{};  // filled by open(): names this image to the file that draws it
};

enum class ImageStatus : std::uint8_t {
  Ok,
  TooShort,        // ends before its header or before the size that the header states
  NotAnImage,      // no magic
  WrongByteOrder,  // written on a machine of the other byte order
  WrongVersion,    // of the format, or of the structs that it stores
  WrongSize,       // longer than the header states
  Misaligned,      // first byte not on image_alignment
  Damaged,         // checksum
  BadLayout,       // sections do not follow each other as they should
  TooLarge,        // exceeds a capacity
  BadTissue,       // model, thickness, materials
  BadMesh,         // nodes, cells, neighbours, rings
  BadBuckets,
  BadCompliance,
  BadLaw,
  BadNeedle,
};

// One clause that says what is wrong and what to do, for a message "FILE: …".
[[nodiscard]] const char* to_string(ImageStatus status) noexcept;

// `image` is written only with Ok.
[[nodiscard]] ImageStatus open(std::span<const std::byte> bytes, Image& image) noexcept;

// The image that is running. A refused one leaves it running.
class Slot {
 public:
  [[nodiscard]] ImageStatus swap(std::span<const std::byte> bytes) noexcept {
    const ImageStatus status = open(bytes, image_);
    loaded_ = loaded_ || status == ImageStatus::Ok;
    return status;
  }
  [[nodiscard]] const Image* image() const noexcept { return loaded_ ? &image_ : nullptr; }

 private:
  Image image_{};
  bool loaded_{};
};

// Writing. The image's views may point anywhere; write() does not check what open() does.
[[nodiscard]] std::size_t image_size(const Image& image) noexcept;
// bytes.size() == image_size(image), and aligned. The same image gives the same bytes: padding is zero.
void write(const Image& image, std::span<std::byte> bytes) noexcept;

}  // namespace trocar::model
