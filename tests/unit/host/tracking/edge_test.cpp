#include <gtest/gtest.h>

#include "scene.hpp"

namespace trocar::tracking {
namespace {

constexpr Gains grey{1.0F, 1.0F, 1.0F};

double error_of(const Dot& dot, double noise = 0.0) {
  Scratch scratch;
  const Located l = locate_by_edge(paint(dot, noise), grey, {dot.u_px + 2.0, dot.v_px - 1.5}, dot.radius_px, scratch);
  EXPECT_TRUE(l.found);
  return std::hypot(l.u_px - dot.u_px, l.v_px - dot.v_px);
}

TEST(LocateByEdge, IsExactWhereverTheDotLiesBetweenPixels) {
  for (const double radius : {4.0, 8.0, 11.4}) {
    for (const double phase : {0.0, 0.25, 0.5, 0.8}) {
      Dot dot;
      dot.radius_px = radius;
      dot.u_px += phase;
      dot.v_px += 0.6 * phase;
      EXPECT_LT(error_of(dot), 0.012) << radius << ' ' << phase;
    }
  }
}

TEST(LocateByEdge, MeasuresTheRadius) {
  Scratch scratch;
  Dot dot;
  dot.radius_px = 9.3;
  const Located l = locate_by_edge(paint(dot), grey, {30.0, 30.0}, 11.0, scratch);
  ASSERT_TRUE(l.found);
  EXPECT_NEAR(l.radius_px, 9.3, 0.06);
  EXPECT_GT(l.score, 0.98);
}

TEST(LocateByEdge, IsNotDrawnAsideByUnevenLight) {
  Dot dot;
  dot.slope = 1.0;  // 22 levels over the dot
  EXPECT_LT(error_of(dot), 0.045);
}

TEST(LocateByEdge, IsNotDrawnAsideByAHoleOnOneSide) {
  for (const double away : {2.0, 4.5, 6.0}) {
    Dot dot;
    dot.hole_u_px = away;
    dot.hole_radius_px = 3.0;
    EXPECT_LT(error_of(dot), 0.08) << away;
  }
}

TEST(LocateByEdge, IsNotDrawnAsideByTheEdgeOfAShadow) {
  for (const double at : {20.0, 27.0, 33.0}) {
    Dot dot;
    dot.shadow_from_px = at;
    EXPECT_LT(error_of(dot), 0.12) << at;
  }
}

TEST(LocateByEdge, StatesTheScatterThatNoiseCauses) {
  constexpr int repeats = 300;
  for (const double noise : {2.0, 6.0}) {
    Dot dot;
    dot.u_px = 30.37;
    Scratch scratch;
    double su = 0.0, sv = 0.0, suu = 0.0, svv = 0.0, stated = 0.0;
    for (unsigned k = 0; k < repeats; ++k) {
      const Located l = locate_by_edge(paint(dot, noise, k + 1), grey, {30.0, 30.0}, dot.radius_px, scratch);
      ASSERT_TRUE(l.found);
      su += l.u_px;
      sv += l.v_px;
      suu += l.u_px * l.u_px;
      svv += l.v_px * l.v_px;
      stated += l.covariance[0] + l.covariance[2];
    }
    const double scatter = (suu - su * su / repeats + svv - sv * sv / repeats) / (repeats - 1);
    stated /= repeats;
    // 2 (repeats - 1) degrees of freedom: 4 % by chance alone; the rest is the noise that neighbouring rays share.
    EXPECT_GT(scatter / stated, 0.6) << noise;
    EXPECT_LT(scatter / stated, 2.0) << noise;
  }
}

TEST(LocateByEdge, FindsNothingWhereNothingIs) {
  Scratch scratch;
  Dot dot;
  dot.dark = dot.bright;
  EXPECT_FALSE(locate_by_edge(paint(dot, 3.0), grey, {30.0, 30.0}, 11.0, scratch).found);
  EXPECT_FALSE(locate_by_edge(paint(dot), grey, {1e6, 30.0}, 11.0, scratch).found);
  Dot edge;  // of a shadow
  edge.dark = edge.bright;
  edge.shadow_from_px = 30.0;
  EXPECT_FALSE(locate_by_edge(paint(edge), grey, {30.0, 30.0}, 11.0, scratch).found);
  Dot small;  // a speck where a dot should be
  small.radius_px = 4.0;
  EXPECT_FALSE(locate_by_edge(paint(small), grey, {30.0, 30.0}, 11.0, scratch).found);
}

}  // namespace
}  // namespace trocar::tracking
