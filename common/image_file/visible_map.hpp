// The second file of a compiled scene: displacements of the nodes that are drawn, from the published forces on the candidates.
//   u_V = A_VC f_C     u: `dimension` rows a visible node [m]; f: the image's candidate order, 2 * node + (0 for x, 1 for y) [N]
// A_VC is stored in float32, column after column: only columns with a force are touched. Relative error of a displacement about 1e-7.
// Layout, version 1: header, node coordinates (3 float64 each), faces (4 uint32 each, the last `no_corner` in a triangle), A_VC; each on
// the next multiple of 64 bytes. Only the host reads it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "common/image_file/bytes.hpp"

namespace trocar::image_file {

inline constexpr std::uint32_t no_corner = 0xFFFFFFFF;
using Face = std::array<std::uint32_t, 4>;  // visible nodes around it

struct VisibleContent {
  std::uint32_t image_checksum{};  // of the image that it belongs to
  std::uint32_t dimension{};       // 2 or 3
  std::span<const std::array<double, 3>> node_m{};
  std::span<const Face> face{};
  std::uint64_t columns{};              // the image's unknowns
  std::span<const float> compliance{};  // dimension * nodes * columns
};

[[nodiscard]] std::size_t visible_size(std::uint32_t dimension, std::size_t nodes, std::size_t faces, std::size_t columns);
void write_visible(const VisibleContent& content, std::span<std::byte> bytes);  // bytes.size() == visible_size(…)

class VisibleMap {
 public:
  // Verifies checksum, sizes, indices and that all numbers are finite. Throws config::UserError: "FILE: what is wrong; what to do".
  explicit VisibleMap(const std::filesystem::path& file);
  [[nodiscard]] const VisibleContent& content() const { return content_; }
  // forces_n.size() == columns, u_m.size() == dimension * nodes.
  void displacements(std::span<const double> forces_n, std::span<double> u_m) const;

 private:
  MappedFile file_;
  VisibleContent content_{};
};

}  // namespace trocar::image_file
