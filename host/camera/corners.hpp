// Inner corners of a chessboard in an image.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "common/optics/lens.hpp"

namespace trocar::camera {

struct Board {
  int columns{}, rows{};  // inner corners, each at least 3
  double square_m{};
  [[nodiscard]] std::size_t corners() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
};

// Half the side of the square in which the gradients about a corner are gathered.
struct Window {
  // A fixed half side, ended when a corner moves by less than 0.1 px: as OpenCV's calibration sample does, and with 11 px its published
  // numbers come out. Too wide where squares are smaller than the window: a neighbouring edge pulls the corner.
  int half_px{11};
  // Instead: three tenths of the way to the nearest neighbour, of each corner, ended at 0.001 px.
  bool by_spacing{};
};

struct Corners {
  std::vector<optics::Pixel> pixel{};  // row by row, columns first; the order turns right-handed with v downwards. Empty when not found
  double closest_px{};                 // least distance of two neighbours
  std::string problem{};               // why there are none
};

// `grey`: 8 bits, one channel. A board half turned about is found as well: numbering from either end fits the same board.
[[nodiscard]] Corners find_corners(const cv::Mat& grey, const Board& board, const Window& window);

}  // namespace trocar::camera
