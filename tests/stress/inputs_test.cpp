// Inputs that are no numbers, at every input, all along a walk: they leave no trace.
#include <gtest/gtest.h>

#include <limits>

#include "walk.hpp"

namespace trocar::stress {
namespace {

TEST(InputsStress, WhatIsNoNumberLeavesNoTrace) {
  const reference::GridImage grid({.element = fem::Type::Tri3, .nodes_x = 13, .nodes_y = 13});
  for (const contact::Method method : {contact::Method::Embedded, contact::Method::Snap, contact::Method::Adapt}) {
    contact::Law law = grid.law;
    law.method = method;
    model::Image image = grid.image();
    image.law = &law;
    const auto model = std::make_unique<insertion::Insertion>();
    const auto untouched = std::make_unique<insertion::Insertion>();
    model->open(image);
    untouched->open(image);
    Walker walker(3, {}, image.needle.length_m);
    reference::Random random(4);
    const std::array<double, 3> no_numbers{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(),
                                           -std::numeric_limits<double>::infinity()};
    for (long tick = 0; tick < counts(5'000, 300'000); ++tick) {
      const insertion::Pose pose = walker.next();
      if (random.below(3) == 0) {
        insertion::Pose bad = pose;
        const double value = no_numbers[random.below(3)];
        double dt_s = 1e-3;
        switch (random.below(4)) {
          case 0:
            bad.x_m = value;
            break;
          case 1:
            bad.y_m = value;
            break;
          case 2:
            bad.theta_rad = value;
            break;
          default:
            dt_s = value;
            break;
        }
        const insertion::Result refused = model->step(bad, dt_s);
        // Only the first step does without a time.
        if (tick > 0 || dt_s == 1e-3) {
          ASSERT_EQ(refused.status, insertion::Status::NotFinite);
        }
        if (tick == 0) continue;
      }
      const insertion::Result a = model->step(pose, 1e-3);
      const insertion::Result b = untouched->step(pose, 1e-3);
      ASSERT_EQ(a.base.fx_n, b.base.fx_n) << tick;
      ASSERT_EQ(a.base.fy_n, b.base.fy_n) << tick;
      ASSERT_EQ(a.base.tau_nm, b.base.tau_nm) << tick;
      ASSERT_EQ(a.status, b.status) << tick;
    }
  }
}

// A denormal is next to nothing, and takes no other way through the code than nothing does.
TEST(InputsStress, DenormalsAreNextToNothing) {
  const double denormal = std::numeric_limits<double>::denorm_min();
  const reference::GridImage grid({.nodes_x = 13, .nodes_y = 13});
  const auto tiny = std::make_unique<insertion::Insertion>();
  const auto zero = std::make_unique<insertion::Insertion>();
  tiny->open(grid.image());
  zero->open(grid.image());
  for (long tick = 0; tick < counts(3'000, 50'000); ++tick) {
    const double depth = 0.03 * (1 - std::cos(1e-3 * static_cast<double>(tick)));
    const insertion::Result a = tiny->step({tick % 2 == 0 ? denormal : -denormal, depth - 0.1, std::numbers::pi / 2}, 1e-3);
    const insertion::Result b = zero->step({0.0, depth - 0.1, std::numbers::pi / 2}, 1e-3);
    ASSERT_EQ(a.status, b.status);
    ASSERT_NEAR(a.base.fx_n, b.base.fx_n, 1e-9);
    ASSERT_NEAR(a.base.fy_n, b.base.fy_n, 1e-9);
  }
  // Time steps of next to nothing make speeds of next to infinity: the law's last row holds.
  contact::Law law = grid.law;
  law.velocity = {2, {0.001, 0.009}, {34.0, 60.0}, {68.0, 61.0}};
  model::Image image = grid.image();
  image.law = &law;
  tiny->open(image);
  double depth = 0.0;
  for (int k = 0; k < 200; ++k) {
    depth += 1e-4;
    const insertion::Result result = tiny->step({0.0, depth - 0.1, std::numbers::pi / 2}, k % 2 == 0 ? denormal : 1e-3);
    ASSERT_TRUE(std::isfinite(result.base.fy_n)) << k;
    ASSERT_TRUE(std::isfinite(tiny->speed_m_s())) << k;
    ASSERT_GE(tiny->shaft_n_per_m(), 34.0);
    ASSERT_LE(tiny->shaft_n_per_m(), 60.0);
  }
}

}  // namespace
}  // namespace trocar::stress
