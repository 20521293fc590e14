// A square of a frame as grey levels, from the raw samples: only what a marker's search needs is ever converted.
//   Mono8     the samples
//   Rgb8      the least of red, green and blue (DiMaio 2003, section 3.3, step 4): a dot is dark in all of them
//   BayerRG8  Least: the same, with the two missing colours the mean of their nearest samples. Balanced: each sample times the gain of
//             its colour, which makes the slab grey and keeps the resolution
// Outside of the image the border's samples go on.
#pragma once

#include <array>
#include <vector>

#include "common/optics/frame.hpp"

namespace trocar::tracking {

enum class Grey { Least, Balanced };
using Gains = std::array<float, 3>;  // of red, green, blue

// That make the means of the three colours over the frame's bright parts equal to that of the least; ones where there are no colours.
[[nodiscard]] Gains white_balance(const optics::Frame& frame);

struct Window {
  int left{}, top{}, width{}, height{};
  std::vector<float> level{};  // row by row

  [[nodiscard]] float at(int u, int v) const noexcept {  // within the window, from its corner
    return level[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) + static_cast<std::size_t>(u)];
  }
};

// Fills `window` with the rectangle; its storage is used again.
void take_window(const optics::Frame& frame, Grey grey, const Gains& gains, int left, int top, int width, int height, Window& window);

}  // namespace trocar::tracking
