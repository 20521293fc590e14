#include <gtest/gtest.h>

#include <numeric>
#include <opencv2/imgproc.hpp>

#include "scene.hpp"

namespace trocar::tracking {
namespace {

constexpr Gains grey{1.0F, 1.0F, 1.0F};

TEST(CubicPeak, IsExactForACubic) {
  for (const double peak : {0.0, 0.21, 0.5, 0.93}) {
    // f'(x) = (x - peak)(x + 3 - peak) (-1): one maximum at `peak`.
    const auto f = [peak](double x) {
      const double z = x - peak;
      return 0.7 - z * z * z / 3.0 - 1.5 * z * z;
    };
    EXPECT_NEAR(cubic_peak({f(-1.0), f(0.0), f(1.0), f(2.0)}), peak, 1e-12);
  }
}

TEST(CubicPeak, IsExactForAParabola) {
  const auto f = [](double x) { return 1.0 - (x - 0.4) * (x - 0.4); };
  EXPECT_NEAR(cubic_peak({f(-1.0), f(0.0), f(1.0), f(2.0)}), 0.4, 1e-12);
}

TEST(Correlate, AgreesWithOpenCvOnRandomLevels) {
  constexpr int width = 53, height = 47;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> level(0.0F, 255.0F);
  std::vector<float> image(static_cast<std::size_t>(width * height));
  for (float& x : image) x = level(random);
  const Disc disc(6.3);
  std::vector<float> sums, squares, ours;
  correlate(image, width, height, disc, sums, squares, ours);
  cv::Mat plate = cv::Mat::zeros(disc.width(), disc.width(), CV_32F);
  for (int v = 0; v < disc.width(); ++v)
    for (int u = -disc.reach(v); u <= disc.reach(v); ++u) plate.at<float>(v, disc.width() / 2 + u) = 1.0F;
  EXPECT_EQ(cv::countNonZero(plate), disc.pixels());
  cv::Mat theirs;
  cv::matchTemplate(cv::Mat(height, width, CV_32F, image.data()), plate, theirs, cv::TM_CCOEFF_NORMED);
  ASSERT_EQ(ours.size(), theirs.total());
  for (int v = 0; v < theirs.rows; ++v)
    for (int u = 0; u < theirs.cols; ++u)
      ASSERT_NEAR(ours[static_cast<std::size_t>(v * theirs.cols + u)], theirs.at<float>(v, u), 2e-4F) << u << ' ' << v;
}

TEST(LocateByCorrelation, FindsADotFromFarAndFillsItsHole) {
  Scratch scratch;
  for (const double hole : {0.0, 3.0}) {
    Dot dot;
    dot.side_px = 101;
    dot.u_px = 50.3;
    dot.v_px = 49.8;
    dot.hole_u_px = 2.0;
    dot.hole_radius_px = hole;
    const Located l = locate_by_correlation(paint(dot), grey, {59.0, 42.0}, Disc(dot.radius_px), 41, scratch);
    ASSERT_TRUE(l.found);
    EXPECT_NEAR(l.u_px, dot.u_px, 0.12);
    EXPECT_NEAR(l.v_px, dot.v_px, 0.12);
    EXPECT_GT(l.score, 0.9);
  }
}

TEST(LocateByCorrelation, FindsNothingWhereNothingIs) {
  Scratch scratch;
  Dot dot;
  dot.dark = dot.bright;
  EXPECT_FALSE(locate_by_correlation(paint(dot), grey, {30.0, 30.0}, Disc(11.0), 41, scratch).found);
  EXPECT_FALSE(locate_by_correlation(paint(dot, 3.0), grey, {30.0, 30.0}, Disc(11.0), 41, scratch).found);
  EXPECT_FALSE(locate_by_correlation(paint(dot), grey, {-5.0, 30.0}, Disc(11.0), 41, scratch).found);
}

}  // namespace
}  // namespace trocar::tracking
