#include "host/camera/corners.hpp"

#include <gtest/gtest.h>

#include "photographs.hpp"

namespace trocar::camera {
namespace {

TEST(Corners, LieWhereTheyWereDrawn) {
  for (const Window& window : {Window{}, Window{.half_px = 5}, Window{.by_spacing = true}}) {
    const Corners found = find_corners(drawn_board(9, 6), board_9x6, window);
    ASSERT_EQ(found.problem, "");
    ASSERT_EQ(found.pixel.size(), 54u);
    EXPECT_NEAR(found.closest_px, 40.0, 1.0);
    // From either end of the board.
    const bool turned = found.pixel.front().u_px > found.pixel.back().u_px;
    for (std::size_t k = 0; k < 54; ++k) {
      const std::size_t n = turned ? 53 - k : k;
      // The edge between two pixels lies half a pixel before the second one's centre.
      EXPECT_NEAR(found.pixel[k].u_px, 60.0 + 40.0 * static_cast<double>(n % 9 + 1) - 0.5, 0.02);
      EXPECT_NEAR(found.pixel[k].v_px, 60.0 + 40.0 * static_cast<double>(n / 9 + 1) - 0.5, 0.02);
    }
  }
}

TEST(Corners, AreFoundOnAllThirteenPhotographs) {
  for (const View& view : photographed_views()) {
    EXPECT_EQ(view.corners.problem, "") << view.file;
    EXPECT_EQ(view.corners.pixel.size(), 54u) << view.file;
    EXPECT_GT(view.corners.closest_px, 20.0) << view.file;
  }
}

// However the image is held, the order turns right-handed.
TEST(Corners, AreNumberedRightHandedHoweverTheBoardLies) {
  const cv::Mat photograph = read_image(photographs()[0], Colour::Grey);
  for (const int turn : {-1, static_cast<int>(cv::ROTATE_90_CLOCKWISE), static_cast<int>(cv::ROTATE_180),
                         static_cast<int>(cv::ROTATE_90_COUNTERCLOCKWISE)}) {
    cv::Mat held = photograph;
    if (turn >= 0) cv::rotate(photograph, held, turn);
    const Corners found = find_corners(held, board_9x6, {});
    ASSERT_EQ(found.pixel.size(), 54u) << turn;
    const auto& p = found.pixel;
    EXPECT_GT((p[8].u_px - p[0].u_px) * (p[45].v_px - p[0].v_px), (p[8].v_px - p[0].v_px) * (p[45].u_px - p[0].u_px));
  }
}

TEST(Corners, NameABoardOfAnotherSize) {
  const auto problem = [](const cv::Mat& grey, int columns, int rows) { return find_corners(grey, {columns, rows, 0.025}, {}).problem; };
  for (const auto& [columns, rows] : {std::pair{8, 6}, {9, 5}, {8, 5}, {7, 6}, {10, 7}, {12, 6}, {4, 3}}) {
    EXPECT_NE(problem(drawn_board(9, 6), columns, rows), "") << columns << 'x' << rows;
    EXPECT_NE(problem(read_image(photographs()[3], Colour::Grey), columns, rows), "") << columns << 'x' << rows;
  }
  // Of these OpenCV finds a part on most photographs.
  for (const int columns : {8, 7})
    for (const auto& file : photographs()) EXPECT_NE(problem(read_image(file, Colour::Grey), columns, 6), "") << columns << ' ' << file;
  EXPECT_NE(problem(read_image(photographs()[2], Colour::Grey), 8, 6).find("goes on beyond 8 x 6"), std::string::npos);
  EXPECT_EQ(problem(drawn_board(8, 6), 8, 6), "");
  EXPECT_NE(problem(drawn_board(10, 7), 9, 6).find("another board: a grid of 10 x 7 is seen, the board should have 9 x 6"),
            std::string::npos);
}

TEST(Corners, NameAnEmptyOrHiddenBoard) {
  const auto problem = [](const cv::Mat& grey) { return find_corners(grey, board_9x6, {}).problem; };
  EXPECT_NE(problem(cv::Mat(480, 640, CV_8U, cv::Scalar(0))).find("the frame is black"), std::string::npos);
  EXPECT_NE(problem(cv::Mat(480, 640, CV_8U, cv::Scalar(200))).find("the frame is empty"), std::string::npos);
  for (const cv::Size size : {cv::Size(1, 2), cv::Size(7, 7), cv::Size(500, 3), cv::Size(31, 31)}) {
    cv::Mat small(size, CV_8U, cv::Scalar(0));
    small.at<unsigned char>(0, 0) = 255;
    EXPECT_NE(problem(small), "") << size;
  }
  EXPECT_NE(find_corners(drawn_board(9, 6), board_9x6, {.half_px = 250}).problem.find("too small"), std::string::npos);
  cv::Mat noise(480, 640, CV_8U);
  cv::theRNG().state = 1;
  cv::randu(noise, 0, 255);
  EXPECT_NE(problem(noise).find("9 x 6"), std::string::npos);
  cv::Mat hidden = drawn_board(9, 6);
  hidden(cv::Rect(0, 0, 200, hidden.rows)) = 230;
  EXPECT_NE(problem(hidden).find("too few corners: a grid of 6 x 6 is seen"), std::string::npos) << problem(hidden);
}

}  // namespace
}  // namespace trocar::camera
