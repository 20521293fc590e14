// `trocar camera calibrate`: images of a chessboard in, camera.toml and a picture of the residuals out.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "host/camera/calibrate.hpp"

namespace trocar::camera {

struct CalibrateOptions {
  std::vector<std::filesystem::path> images{};
  Board board{};
  Window window{};
  FitOptions fit{};
  std::filesystem::path out{};
  std::filesystem::path picture{};  // SVG; empty: out's name and .svg
  bool json{};
};

// "9x6" into `board`; what is wrong with the text, for the command line's parser, else empty.
[[nodiscard]] std::string parse_board(const std::string& text, Board& board);

// Exit code. Throws config::UserError; then nothing was written. Views that are left out, outliers and doubts are lines on stderr.
int run_calibrate(const CalibrateOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::camera
