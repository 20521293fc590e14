// What draws a dot's edge aside, on dots painted pixel by pixel, without the renderer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "host/tracking/locate.hpp"

namespace trocar::tracking {
namespace {

// Independent of the renderer: a dark disc on bright ground, each pixel the mean of 8 x 8 samples, then a Gaussian of 0.7 px by direct sum.
struct PaintedDot {
  int side_px{61};
  double u_px{30.0}, v_px{30.0}, radius_px{11.0};
  double bright{200.0}, dark{40.0};
  double slope{};                                        // of the light, levels a pixel along u
  double hole_u_px{}, hole_v_px{}, hole_radius_px{0.0};  // from the dot's centre; bright
  double shadow_from_px{1e9};                            // v from which on the light is `shade` of what it was
  double shade{0.6};
};
optics::Frame paint(const PaintedDot& d) {
  const auto n = static_cast<std::size_t>(d.side_px);
  std::vector<double> sharp(n * n), blurred(n * n);
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t u = 0; u < n; ++u) {
      double sum = 0.0;
      for (int j = 0; j < 8; ++j) {
        for (int i = 0; i < 8; ++i) {
          const double x = static_cast<double>(u) + (i - 3.5) / 8 - d.u_px, y = static_cast<double>(v) + (j - 3.5) / 8 - d.v_px;
          const bool hole = std::hypot(x - d.hole_u_px, y - d.hole_v_px) < d.hole_radius_px;
          const double level = std::hypot(x, y) < d.radius_px ? (hole ? 250.0 : d.dark) : d.bright + d.slope * x;
          sum += level * (y + d.v_px > d.shadow_from_px ? d.shade : 1.0);
        }
      }
      sharp[v * n + u] = sum / 64.0;
    }
  }
  optics::Frame frame{0, 0, d.side_px, d.side_px, optics::PixelFormat::Mono8, std::vector<std::uint8_t>(n * n)};
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t u = 0; u < n; ++u) {
      double sum = 0.0, weight = 0.0;
      for (std::ptrdiff_t j = -3; j <= 3; ++j) {
        for (std::ptrdiff_t i = -3; i <= 3; ++i) {
          const auto y = std::clamp(static_cast<std::ptrdiff_t>(v) + j, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(n) - 1);
          const auto x = std::clamp(static_cast<std::ptrdiff_t>(u) + i, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(n) - 1);
          const double w = std::exp(-static_cast<double>(i * i + j * j) / (2 * 0.49));
          sum += w * sharp[static_cast<std::size_t>(y) * n + static_cast<std::size_t>(x)];
          weight += w;
        }
      }
      frame.pixels[v * n + u] = static_cast<std::uint8_t>(std::clamp(std::lround(sum / weight), 0L, 255L));
    }
  }
  return frame;
}

constexpr Gains grey{1.0F, 1.0F, 1.0F};

double error_of(const PaintedDot& dot) {
  Scratch scratch;
  const Located l = locate_by_edge(paint(dot), grey, {dot.u_px + 2.0, dot.v_px - 1.5}, dot.radius_px, scratch);
  EXPECT_TRUE(l.found);
  return std::hypot(l.u_px - dot.u_px, l.v_px - dot.v_px);
}

TEST(Edge, IsExactWhereverTheDotLiesBetweenPixels) {
  for (const double radius : {4.0, 8.0, 11.4}) {
    for (const double phase : {0.0, 0.25, 0.5, 0.8}) {
      PaintedDot dot;
      dot.radius_px = radius;
      dot.u_px += phase;
      dot.v_px += 0.6 * phase;
      EXPECT_LT(error_of(dot), 0.012) << radius << ' ' << phase;
    }
  }
}

TEST(Edge, MeasuresTheRadius) {
  Scratch scratch;
  PaintedDot dot;
  dot.radius_px = 9.3;
  const Located l = locate_by_edge(paint(dot), grey, {30.0, 30.0}, 11.0, scratch);
  ASSERT_TRUE(l.found);
  EXPECT_NEAR(l.radius_px, 9.3, 0.06);
  EXPECT_GT(l.score, 0.98);
}

TEST(Edge, IsNotDrawnAsideByUnevenLight) {
  PaintedDot dot;
  dot.slope = 1.0;  // 22 levels over the dot
  EXPECT_LT(error_of(dot), 0.045);
}

TEST(Edge, IsNotDrawnAsideByAHoleOnOneSide) {
  for (const double away : {2.0, 4.5, 6.0}) {
    PaintedDot dot;
    dot.hole_u_px = away;
    dot.hole_radius_px = 3.0;
    EXPECT_LT(error_of(dot), 0.08) << away;
  }
}

TEST(Edge, IsNotDrawnAsideByTheEdgeOfAShadow) {
  for (const double at : {20.0, 27.0, 33.0}) {
    PaintedDot dot;
    dot.shadow_from_px = at;
    EXPECT_LT(error_of(dot), 0.12) << at;
  }
}

}  // namespace
}  // namespace trocar::tracking
