// One image of a camera, as its sensor gives it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace trocar::optics {

enum class PixelFormat : std::uint8_t {
  Mono8,
  BayerRG8,  // even rows R G R G ..., odd rows G B G B ...
  Rgb8,      // R, G, B of a pixel side by side
};
[[nodiscard]] constexpr std::size_t channels(PixelFormat format) noexcept { return format == PixelFormat::Rgb8 ? 3 : 1; }

// Whose clock Frame::time_ns is.
enum class Clock : std::uint8_t {
  Camera,  // its own, from an arbitrary zero
  Host,    // CLOCK_MONOTONIC of this machine
  Rig,     // the controller's, from its start
  Rate,    // none: frame number over the rate given
};

struct Frame {
  std::uint64_t number{};  // the camera's count; a gap is a frame that was lost
  // Middle of the exposure of the image's middle row. Which clock, its source says.
  std::int64_t time_ns{};
  int width_px{}, height_px{};
  PixelFormat format{PixelFormat::Mono8};
  std::vector<std::uint8_t> pixels{};  // row by row from the top, without padding; width * height * channels bytes
  std::int64_t time_uncertainty_ns{};  // of an estimated time (host/camera/rig_clock.hpp), else 0
  std::int64_t arrived_ns{};           // when this process had it, CLOCK_MONOTONIC; 0 for files
};

}  // namespace trocar::optics
