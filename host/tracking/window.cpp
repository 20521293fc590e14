#include "host/tracking/window.hpp"

#include <algorithm>

namespace trocar::tracking {
namespace {

using optics::Frame;
using optics::PixelFormat;

std::size_t bayer_colour(int u, int v) noexcept { return v % 2 == 0 ? (u % 2 == 0 ? 0U : 1U) : (u % 2 == 0 ? 1U : 2U); }

// Mean of the samples of each colour among the nine about a pixel, then the least.
float least_of_bayer(const Frame& f, int u, int v) noexcept {
  std::array<int, 3> sum{}, count{};
  for (int y = std::max(0, v - 1); y <= std::min(f.height_px - 1, v + 1); ++y) {
    for (int x = std::max(0, u - 1); x <= std::min(f.width_px - 1, u + 1); ++x) {
      const std::size_t c = bayer_colour(x, y);
      const bool own = c == bayer_colour(u, v);
      if (own && (x != u || y != v)) continue;  // its own colour was measured here
      sum[c] += f.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(f.width_px) + static_cast<std::size_t>(x)];
      ++count[c];
    }
  }
  float least = 255.0F;
  for (std::size_t c = 0; c < 3; ++c)
    if (count[c] > 0) least = std::min(least, static_cast<float>(sum[c]) / static_cast<float>(count[c]));
  return least;
}

}  // namespace

Gains white_balance(const Frame& frame) {
  if (frame.format == PixelFormat::Mono8) return {1.0F, 1.0F, 1.0F};
  // The brighter half of each colour: dots are dark, and differ.
  std::array<std::array<std::uint32_t, 256>, 3> histogram{};
  const auto width = static_cast<std::size_t>(frame.width_px);
  for (int v = 0; v < frame.height_px; ++v) {
    for (int u = v % 2; u < frame.width_px; u += 3) {
      const std::size_t i = static_cast<std::size_t>(v) * width + static_cast<std::size_t>(u);
      if (frame.format == PixelFormat::BayerRG8)
        ++histogram[bayer_colour(u, v)][frame.pixels[i]];
      else
        for (std::size_t c = 0; c < 3; ++c) ++histogram[c][frame.pixels[3 * i + c]];
    }
  }
  Gains mean{};
  for (std::size_t c = 0; c < 3; ++c) {
    std::uint64_t all = 0, seen = 0, sum = 0;
    for (const std::uint32_t n : histogram[c]) all += n;
    for (std::size_t level = 256; level-- > 0 && 2 * seen < all;) {
      seen += histogram[c][level];
      sum += level * histogram[c][level];
    }
    mean[c] = seen > 0 ? std::max(1.0F, static_cast<float>(sum) / static_cast<float>(seen)) : 1.0F;
  }
  const float least = *std::ranges::min_element(mean);
  return {least / mean[0], least / mean[1], least / mean[2]};
}

void take_window(const Frame& frame, Grey grey, const Gains& gains, int left, int top, int width, int height, Window& window) {
  window.left = left;
  window.top = top;
  window.width = width;
  window.height = height;
  window.level.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  float* out = window.level.data();
  for (int y = 0; y < height; ++y) {
    const int v = std::clamp(top + y, 0, frame.height_px - 1);
    const std::size_t row = static_cast<std::size_t>(v) * static_cast<std::size_t>(frame.width_px);
    const bool inside = left >= 0 && left + width <= frame.width_px;
    if (inside && frame.format == PixelFormat::Mono8) {
      const std::uint8_t* in = &frame.pixels[row + static_cast<std::size_t>(left)];
      for (int x = 0; x < width; ++x) *out++ = static_cast<float>(in[x]);
      continue;
    }
    for (int x = 0; x < width; ++x) {
      const int u = std::clamp(left + x, 0, frame.width_px - 1);
      const std::size_t i = row + static_cast<std::size_t>(u);
      switch (frame.format) {
        case PixelFormat::Mono8:
          *out++ = static_cast<float>(frame.pixels[i]);
          break;
        case PixelFormat::Rgb8:
          *out++ = static_cast<float>(std::min({frame.pixels[3 * i], frame.pixels[3 * i + 1], frame.pixels[3 * i + 2]}));
          break;
        case PixelFormat::BayerRG8:
          *out++ = grey == Grey::Least ? least_of_bayer(frame, u, v) : gains[bayer_colour(u, v)] * static_cast<float>(frame.pixels[i]);
          break;
      }
    }
  }
}

}  // namespace trocar::tracking
