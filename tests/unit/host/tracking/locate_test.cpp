#include "host/tracking/locate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "scenes.hpp"

namespace trocar::tracking {
namespace {

using testing::Film;

TEST(Correlation, EqualsOpenCvsTemplateMatching) {
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0.0F, 8.0F);
  constexpr int side = 41;
  const Disc disc(8.3);
  std::vector<float> darkness(side * side);
  for (int v = 0; v < side; ++v)
    for (int u = 0; u < side; ++u)
      darkness[static_cast<std::size_t>(v * side + u)] = (std::hypot(u - 21.3, v - 18.8) < 8.0 ? 180.0F : 60.0F) + noise(random);
  std::vector<float> sums, squares, ours;
  correlate(darkness, side, side, disc, sums, squares, ours);

  cv::Mat pattern(disc.width(), disc.width(), CV_32F, cv::Scalar(0));
  int pixels = 0;
  for (int v = 0; v < disc.width(); ++v)
    for (int u = 0; u < disc.width(); ++u)
      if (std::hypot(u - disc.width() / 2, v - disc.width() / 2) <= 8.3) {
        pattern.at<float>(v, u) = 1.0F;
        ++pixels;
      }
  EXPECT_EQ(disc.pixels(), pixels);
  cv::Mat theirs;
  cv::matchTemplate(cv::Mat(side, side, CV_32F, darkness.data()), pattern, theirs, cv::TM_CCOEFF_NORMED);
  ASSERT_EQ(ours.size(), theirs.total());
  for (int v = 0; v < theirs.rows; ++v)
    for (int u = 0; u < theirs.cols; ++u) EXPECT_NEAR(ours[static_cast<std::size_t>(v * theirs.cols + u)], theirs.at<float>(v, u), 2e-4);
  EXPECT_GT(*std::ranges::max_element(ours), 0.8F);
}

TEST(Correlation, AFlatFieldCorrelatesWithNothing) {
  std::vector<float> flat(41 * 41, 100.0F), sums, squares, out;
  correlate(flat, 41, 41, Disc(8.0), sums, squares, out);
  for (const float c : out) EXPECT_EQ(c, 0.0F);
}

TEST(Correlation, TheCubicFindsACubicsMaximum) {
  // y = 2 - (x - 0.3)^2 + 0.1 (x - 0.3)^3 has its maximum at 0.3.
  const auto y = [](double x) { return 2.0 - std::pow(x - 0.3, 2) + 0.1 * std::pow(x - 0.3, 3); };
  EXPECT_NEAR(cubic_peak({y(-1), y(0), y(1), y(2)}), 0.3, 1e-12);
  EXPECT_NEAR(cubic_peak({0.0, 1.0, 1.0, 0.0}), 0.5, 1e-12);  // a parabola
  EXPECT_NEAR(cubic_peak({0.0, 1.0, 0.0, -3.0}), 0.0, 1e-12);
  EXPECT_EQ(cubic_peak({1.0, 1.0, 1.0, 1.0}), 0.0);
}

// Both methods from starts that are off by up to 5 px.
template <class Locate>
testing::Errors errors_of(Film& film, Locate locate) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> off(-3.5, 3.5);
  const auto& frame = film.frame(20);
  std::vector<Marker> markers;
  for (const auto& truth : film.truth()) {
    const Located l = locate(frame, Place{truth.pixel.u_px + off(random), truth.pixel.v_px + off(random)});
    markers.push_back({l.found, l.u_px, l.v_px, l.score, l.covariance});
  }
  testing::Errors e;
  testing::add(e, markers, film.truth(), 5.0);
  return e;
}

TEST(Edge, FindsCleanDotsToAFiftiethOfAPixelAndHardOnesToASeventh) {
  Scratch scratch;
  const auto edge = [&](const optics::Frame& frame, const Place& start) {
    return locate_by_edge(frame, white_balance(frame), start, 7.6, scratch);
  };
  Film clean = testing::small_film(optics::MotionKind::Insertion);
  const testing::Errors e = errors_of(clean, edge);
  EXPECT_EQ(e.lost, 0u);
  EXPECT_LT(e.rms_px, 0.02);
  Film hard = testing::small_film(optics::MotionKind::Insertion, optics::hard_appearance());
  const testing::Errors h = errors_of(hard, edge);
  EXPECT_EQ(h.lost, 0u);
  EXPECT_LT(h.rms_px, 0.15);
}

TEST(Edge, ColourAndBayerImagesDoAsWell) {
  for (const auto format : {optics::PixelFormat::Rgb8, optics::PixelFormat::BayerRG8}) {
    optics::Appearance appearance = optics::clean_appearance();
    appearance.format = format;
    Film film = testing::small_film(optics::MotionKind::Shear, appearance);
    Scratch scratch;
    const testing::Errors e = errors_of(film, [&](const optics::Frame& frame, const Place& start) {
      return locate_by_edge(frame, white_balance(frame), start, 7.6, scratch);
    });
    EXPECT_EQ(e.lost, 0u);
    EXPECT_LT(e.rms_px, 0.03);
  }
}

TEST(Correlation, FindsDotsInAllFormats) {
  for (const auto format : {optics::PixelFormat::Mono8, optics::PixelFormat::Rgb8, optics::PixelFormat::BayerRG8}) {
    optics::Appearance appearance = optics::hard_appearance();
    appearance.format = format;
    Film film = testing::small_film(optics::MotionKind::Insertion, appearance);
    Scratch scratch;
    const Disc disc(7.6);
    const testing::Errors e = errors_of(film, [&](const optics::Frame& frame, const Place& start) {
      return locate_by_correlation(frame, white_balance(frame), start, disc, 41, scratch);
    });
    EXPECT_EQ(e.lost, 0u);
    EXPECT_LT(e.rms_px, 0.25);
  }
}

TEST(Edge, CovarianceIsNeverTooSmallAndRightWhereNoiseRules) {
  // The same dots in 40 noises: scatter against what each fit says.
  optics::Appearance appearance = optics::clean_appearance();
  appearance.read_noise = 8.0;
  Film film = testing::small_film(optics::MotionKind::Still, appearance);
  Scratch scratch;
  const std::size_t n = film.grid().markers();
  std::vector<double> sum(n), square(n), said(n);
  constexpr int frames = 40;
  for (int k = 0; k < frames; ++k) {
    const auto& frame = film.frame(k);
    for (std::size_t i = 0; i < n; ++i) {
      const auto& truth = film.truth()[i].pixel;
      const Located l = locate_by_edge(frame, white_balance(frame), {truth.u_px, truth.v_px}, 7.6, scratch);
      ASSERT_TRUE(l.found);
      sum[i] += l.u_px;
      square[i] += (l.u_px - truth.u_px) * (l.u_px - truth.u_px);
      said[i] += l.covariance[0];
    }
  }
  double scatter = 0.0, stated = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    scatter += square[i] / frames;
    stated += said[i] / frames;
  }
  EXPECT_GT(stated / scatter, 0.8);
  EXPECT_LT(stated / scatter, 2.0);
}

TEST(Edge, FindsDotsOfAnySize) {
  for (const double radius : {3.5, 5.0, 40.0, 90.0, 180.0}) {
    const int side = static_cast<int>(4.0 * radius) + 40;
    optics::Frame frame{0, 0, side, side, optics::PixelFormat::Mono8, {}};
    const double u = 0.5 * side + 0.3, v = 0.5 * side - 0.4;
    for (int y = 0; y < side; ++y)
      for (int x = 0; x < side; ++x)
        frame.pixels.push_back(
            static_cast<std::uint8_t>(std::lround(200.0 - 160.0 * std::clamp(radius + 0.5 - std::hypot(x - u, y - v), 0.0, 1.0))));
    Scratch scratch;
    const Located l = locate_by_edge(frame, white_balance(frame), {u + 1.0, v - 1.0}, radius, scratch);
    ASSERT_TRUE(l.found) << radius;
    EXPECT_NEAR(l.u_px, u, 0.1) << radius;
    EXPECT_NEAR(l.v_px, v, 0.1) << radius;
    EXPECT_NEAR(l.radius_px, radius, 0.3) << radius;
  }
}

TEST(Locate, FindsNothingWhereNothingIs) {
  optics::Frame frame{0, 0, 200, 150, optics::PixelFormat::Mono8, std::vector<std::uint8_t>(200 * 150, 0)};
  Scratch scratch;
  const Gains gains = white_balance(frame);
  const Disc disc(7.0);
  for (const int level : {0, 128, 255}) {
    std::ranges::fill(frame.pixels, static_cast<std::uint8_t>(level));
    EXPECT_FALSE(locate_by_edge(frame, gains, {100, 75}, 7.0, scratch).found);
    EXPECT_FALSE(locate_by_correlation(frame, gains, {100, 75}, disc, 41, scratch).found);
  }
  std::mt19937 random(1);
  for (auto& p : frame.pixels) p = static_cast<std::uint8_t>(random());
  EXPECT_FALSE(locate_by_edge(frame, gains, {100, 75}, 7.0, scratch).found);
  EXPECT_FALSE(locate_by_correlation(frame, gains, {100, 75}, disc, 41, scratch).found);
  // An edge without a dot, outside of the image, and no number.
  for (std::size_t k = 0; k < frame.pixels.size(); ++k) frame.pixels[k] = k % 200 < 100 ? 30 : 220;
  EXPECT_FALSE(locate_by_edge(frame, gains, {100, 75}, 7.0, scratch).found);
  EXPECT_FALSE(locate_by_edge(frame, gains, {-50, 75}, 7.0, scratch).found);
  EXPECT_FALSE(locate_by_correlation(frame, gains, {1e6, 75}, disc, 41, scratch).found);
}

TEST(Window, TakesTheLeastColourAndGoesOnBeyondTheBorder) {
  optics::Frame rgb{0, 0, 2, 1, optics::PixelFormat::Rgb8, {30, 20, 10, 5, 7, 9}};
  Window w;
  take_window(rgb, Grey::Least, {1, 1, 1}, -1, -1, 4, 3, w);
  EXPECT_EQ(w.at(0, 0), 10.0F);
  EXPECT_EQ(w.at(1, 1), 10.0F);
  EXPECT_EQ(w.at(2, 1), 5.0F);
  EXPECT_EQ(w.at(3, 2), 5.0F);
  // R G / G B: at the red sample green is 40 and blue 50.
  optics::Frame bayer{0, 0, 2, 2, optics::PixelFormat::BayerRG8, {90, 40, 40, 50}};
  take_window(bayer, Grey::Least, {1, 1, 1}, 0, 0, 2, 2, w);
  EXPECT_EQ(w.at(0, 0), 40.0F);
  take_window(bayer, Grey::Balanced, {0.5F, 1.0F, 2.0F}, 0, 0, 2, 2, w);
  EXPECT_EQ(w.at(0, 0), 45.0F);
  EXPECT_EQ(w.at(1, 1), 100.0F);
}

}  // namespace
}  // namespace trocar::tracking
