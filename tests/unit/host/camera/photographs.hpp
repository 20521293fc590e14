// Chessboards of the tests: the thirteen photographs in tests/data, and drawn ones.
#pragma once

#include <cmath>
#include <filesystem>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "host/camera/calibrate.hpp"
#include "host/camera/image.hpp"

namespace trocar::camera {

inline const Board board_9x6{9, 6, 0.025};

inline std::vector<std::filesystem::path> photographs() {
  std::vector<std::filesystem::path> files;
  for (const char* number : {"01", "02", "03", "04", "05", "06", "07", "08", "09", "11", "12", "13", "14"})
    files.push_back(std::filesystem::path(TROCAR_TEST_DATA) / "calibration-left" / (std::string("left") + number + ".jpg"));
  return files;
}

inline View view_of(const std::string& name, const cv::Mat& grey, const Window& window = {}) {
  return {name, find_corners(grey, board_9x6, window)};
}

inline std::vector<View> photographed_views(const Window& window = {}) {
  std::vector<View> views;
  for (const auto& file : photographs()) views.push_back(view_of(file.filename().string(), read_image(file, Colour::Grey), window));
  return views;
}

// Black and white squares of 40 px behind a white margin, seen from the front, slightly blurred. `columns`, `rows`: inner corners.
inline cv::Mat drawn_board(int columns, int rows) {
  constexpr int square = 40, margin = 60;
  cv::Mat image(2 * margin + (rows + 1) * square, 2 * margin + (columns + 1) * square, CV_8U, cv::Scalar(230));
  for (int j = 0; j <= rows; ++j)
    for (int i = 0; i <= columns; ++i)
      if ((i + j) % 2 == 0) image(cv::Rect(margin + i * square, margin + j * square, square, square)) = 20;
  cv::GaussianBlur(image, image, {0, 0}, 1.0);
  return image;
}

}  // namespace trocar::camera
