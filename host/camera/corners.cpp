#include "host/camera/corners.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace trocar::camera {
namespace {

using Points = std::vector<cv::Point2f>;

struct Grid {
  const Points& point;
  int columns, rows;
  [[nodiscard]] bool has(int i, int j) const { return i >= 0 && j >= 0 && i < columns && j < rows; }
  [[nodiscard]] cv::Point2f at(int i, int j) const {
    return point[static_cast<std::size_t>(j) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(i)];
  }
  [[nodiscard]] double to_neighbour(int i, int j) const {
    double least = std::numeric_limits<double>::infinity();
    for (const auto& [di, dj] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}})
      if (has(i + di, j + dj)) least = std::min(least, cv::norm(at(i + di, j + dj) - at(i, j)));
    return least;
  }
};

void refine(const cv::Mat& grey, Points& points, int half_px, double until_px) {
  cv::cornerSubPix(grey, points, {half_px, half_px}, {-1, -1}, {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 30, until_px});
}

void refine_by_spacing(const cv::Mat& grey, Points& points, const Board& board) {
  const Points coarse = points;
  const Grid grid{coarse, board.columns, board.rows};
  for (int j = 0; j < board.rows; ++j) {
    for (int i = 0; i < board.columns; ++i) {
      const int half = static_cast<int>(std::clamp(0.3 * grid.to_neighbour(i, j), 2.0, 20.0));
      Points one{grid.at(i, j)};
      refine(grey, one, half, 0.001);
      points[static_cast<std::size_t>(j) * static_cast<std::size_t>(board.columns) + static_cast<std::size_t>(i)] = one[0];
    }
  }
}

// Is there a corner between four squares that alternate at `at`, with the board's directions `a` and `b` (a square each)? Asked a quarter
// of a square away from it, because outermost squares are often printed narrow.
enum class Seen { Outside, Corner, Other };
Seen look(const cv::Mat& grey, const cv::Point2f& at, const cv::Point2f& a, const cv::Point2f& b, double contrast) {
  const int half = std::max(1, static_cast<int>(0.1 * std::min(cv::norm(a), cv::norm(b))));
  const cv::Rect inside(half, half, grey.cols - 2 * half, grey.rows - 2 * half);
  std::array<double, 4> mean{};
  const std::array<cv::Point2f, 4> centre{at + 0.25F * (a + b), at + 0.25F * (b - a), at - 0.25F * (a + b), at + 0.25F * (a - b)};
  for (std::size_t k = 0; k < 4; ++k) {
    const cv::Point p(cvRound(centre[k].x), cvRound(centre[k].y));
    if (!inside.contains(p)) return Seen::Outside;
    mean[k] = cv::mean(grey(cv::Rect(p.x - half, p.y - half, 2 * half + 1, 2 * half + 1)))[0];
  }
  const double darkest_light = std::max(std::min(mean[0], mean[2]), std::min(mean[1], mean[3]));
  const double lightest_dark = std::min(std::max(mean[0], mean[2]), std::max(mean[1], mean[3]));
  return darkest_light - lightest_dark > 0.4 * contrast ? Seen::Corner : Seen::Other;
}

// Does the chessboard go on behind one of its sides? Then the board asked for is a part of the one in the image.
bool goes_on(const cv::Mat& grey, const Grid& grid) {
  std::vector<double> lights, darks;
  for (int j = 0; j + 1 < grid.rows; ++j) {
    for (int i = 0; i + 1 < grid.columns; ++i) {
      const cv::Point2f centre = 0.25F * (grid.at(i, j) + grid.at(i + 1, j) + grid.at(i, j + 1) + grid.at(i + 1, j + 1));
      const cv::Point p(cvRound(centre.x), cvRound(centre.y));
      if (p.x < 0 || p.y < 0 || p.x >= grey.cols || p.y >= grey.rows) continue;
      ((i + j) % 2 == 0 ? lights : darks).push_back(grey.at<unsigned char>(p));
    }
  }
  const double contrast = std::abs(cv::mean(lights)[0] - cv::mean(darks)[0]);
  // The next corner outwards by the last three of its line, which a parabola follows through perspective and distortion.
  const auto side = [&](int length, auto inward) {
    int seen = 0, corners = 0;
    for (int k = 0; k < length; ++k) {
      const cv::Point2f next = 3.0F * inward(k, 0) - 3.0F * inward(k, 1) + inward(k, 2);
      const cv::Point2f out = next - inward(k, 0);
      const cv::Point2f along = k + 1 < length ? inward(k + 1, 0) - inward(k, 0) : inward(k, 0) - inward(k - 1, 0);
      const Seen what = look(grey, next, out, along, contrast);
      seen += what != Seen::Outside ? 1 : 0;
      corners += what == Seen::Corner ? 1 : 0;
    }
    return seen >= 3 && 4 * corners >= 3 * seen;
  };
  return side(grid.rows, [&](int k, int depth) { return grid.at(depth, k); }) ||
         side(grid.rows, [&](int k, int depth) { return grid.at(grid.columns - 1 - depth, k); }) ||
         side(grid.columns, [&](int k, int depth) { return grid.at(k, depth); }) ||
         side(grid.columns, [&](int k, int depth) { return grid.at(k, grid.rows - 1 - depth); });
}

// Why the board was not found, by the largest grid of corners that another detector of OpenCV sees.
std::string what_is_there(const cv::Mat& grey, const Board& board) {
  Points points;
  cv::Mat grid;
  const bool any = cv::findChessboardCornersSB(grey, {3, 3}, points, cv::CALIB_CB_LARGER | cv::CALIB_CB_NORMALIZE_IMAGE, grid);
  const auto [less, more] = std::minmax({grid.cols, grid.rows});
  const auto [fewer, many] = std::minmax({board.columns, board.rows});
  if (!any || (less == fewer && more == many)) return fmt::format("no board of {} x {} inner corners was found", board.columns, board.rows);
  return fmt::format("{}: a grid of {} x {} is seen, the board should have {} x {}",
                     less <= fewer && more <= many ? "too few corners" : "another board", more, less, board.columns, board.rows);
}

Corners look_for_corners(const cv::Mat& grey, const Board& board, const Window& window) {
  double darkest = 0.0, lightest = 0.0;
  cv::minMaxLoc(grey, &darkest, &lightest);
  constexpr double least_contrast = 10.0;  // of 255
  if (lightest - darkest < least_contrast) {
    if (lightest < 2 * least_contrast) return {.problem = fmt::format("the frame is black: its lightest pixel is {:.0f} of 255", lightest)};
    return {.problem = fmt::format("the frame is empty: all pixels are between {:.0f} and {:.0f} of 255", darkest, lightest)};
  }
  const cv::Size size(board.columns, board.rows);
  Points points;
  // Equalised, or, where that joins a board with what lies about it, as the camera gave it.
  const auto find = [&](int flags) {
    return cv::findChessboardCorners(grey, size, points, flags | cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_FAST_CHECK);
  };
  if (!find(cv::CALIB_CB_NORMALIZE_IMAGE) && !find(0)) return {.problem = what_is_there(grey, board)};
  const Grid grid{points, board.columns, board.rows};
  Corners found;
  found.closest_px = std::numeric_limits<double>::infinity();
  for (int j = 0; j < board.rows; ++j)
    for (int i = 0; i < board.columns; ++i) found.closest_px = std::min(found.closest_px, grid.to_neighbour(i, j));
  Points fine = points;
  refine_by_spacing(grey, fine, board);
  if (goes_on(grey, {fine, board.columns, board.rows}))
    return {.problem =
                fmt::format("the board goes on beyond {} x {} inner corners; count those between four squares", board.columns, board.rows)};
  if (window.by_spacing)
    points = fine;
  else
    refine(grey, points, window.half_px, 0.1);
  for (const cv::Point2f& p : points) found.pixel.push_back({static_cast<double>(p.x), static_cast<double>(p.y)});
  return found;
}

}  // namespace

Corners find_corners(const cv::Mat& grey, const Board& board, const Window& window) {
  try {
    return look_for_corners(grey, board, window);
  } catch (const cv::Exception&) {  // it asserts that its windows fit into the image
    return {.problem = fmt::format("the image of {} x {} px is too small for the board or the window", grey.cols, grey.rows)};
  }
}

}  // namespace trocar::camera
