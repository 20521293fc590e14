#include "common/optics/plane.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace trocar::optics {
namespace {

constexpr Lens thesis{1884.0, 1884.0, 1044.0, 737.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}};

TEST(Plane, StraightBelowTheCameraIsUpsideDownAndScaled) {
  // 1000 px of focal length, 0.5 m away: 2 px for a millimetre; y of the plane goes up in the image.
  const PlaneView view({1000.0, 1000.0, 320.0, 240.0, {}}, {{std::numbers::pi, 0.0, 0.0}, {0.0, 0.0, 0.5}});
  const auto pixel = view.project({0.01, 0.02});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->u_px, 340.0, 1e-9);
  EXPECT_NEAR(pixel->v_px, 200.0, 1e-9);
}

TEST(Plane, ATiltedPlaneFollowsThePinholeEquation) {
  // Turned by 30 degrees about its x axis: z of (0, y) is t + y / 2.
  const PlaneView view({1000.0, 1000.0, 0.0, 0.0, {}}, {{std::numbers::pi / 6.0, 0.0, 0.0}, {0.0, 0.0, 1.0}});
  const auto pixel = view.project({0.0, 0.1});
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->v_px, 1000.0 * 0.1 * std::cos(std::numbers::pi / 6.0) / 1.05, 1e-9);
}

TEST(Plane, WhatIsSeenIsLocatedAgain) {
  const PlaneView view(thesis, {{3.05, 0.08, -0.1}, {-0.052, 0.047, 0.149}});
  for (int row = 0; row < 21; ++row) {
    for (int column = 0; column < 21; ++column) {
      const PlanePoint point{0.005 * column, 0.005 * row};
      const auto pixel = view.project(point);
      ASSERT_TRUE(pixel);
      const auto found = view.locate(*pixel);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->x_m, point.x_m, 1e-11);
      EXPECT_NEAR(found->y_m, point.y_m, 1e-11);
    }
  }
}

TEST(Plane, TheJacobianIsTheDerivative) {
  const PlaneView view(thesis, {{3.05, 0.08, -0.1}, {-0.052, 0.047, 0.149}});
  constexpr double h = 1e-6;
  for (const PlanePoint p : {PlanePoint{0.0, 0.0}, PlanePoint{0.05, 0.02}, PlanePoint{0.1, 0.1}}) {
    const Jacobian2 j = view.jacobian(p);
    const auto xp = view.project({p.x_m + h, p.y_m}), xm = view.project({p.x_m - h, p.y_m});
    const auto yp = view.project({p.x_m, p.y_m + h}), ym = view.project({p.x_m, p.y_m - h});
    ASSERT_TRUE(xp && xm && yp && ym);
    EXPECT_NEAR(j[0][0], (xp->u_px - xm->u_px) / (2 * h), 1e-4);
    EXPECT_NEAR(j[1][0], (xp->v_px - xm->v_px) / (2 * h), 1e-4);
    EXPECT_NEAR(j[0][1], (yp->u_px - ym->u_px) / (2 * h), 1e-4);
    EXPECT_NEAR(j[1][1], (yp->v_px - ym->v_px) / (2 * h), 1e-4);
  }
}

TEST(Plane, NothingIsSeenBehindThePinholeNorBeyondTheFold) {
  const PlaneView behind({1000.0, 1000.0, 320.0, 240.0, {}}, {{}, {0.0, 0.0, -0.5}});
  EXPECT_FALSE(behind.project({0.0, 0.0}));
  EXPECT_FALSE(behind.locate({320.0, 240.0}));
  const PlaneView barrel({500.0, 500.0, 320.0, 240.0, {-0.3, 0.0, 0.0, 0.0, 0.0}}, {{}, {0.0, 0.0, 0.1}});
  EXPECT_TRUE(barrel.project({0.05, 0.0}));
  EXPECT_FALSE(barrel.project({0.2, 0.0}));  // r = 2, folded at 1.05
}

}  // namespace
}  // namespace trocar::optics
