#include "common/needle/tube.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "common/needle/bevel.hpp"

namespace trocar::needle {
namespace {

TEST(Tube, GaugesShrinkFrom14To30) {
  ASSERT_EQ(gauges().size(), 17u);
  double outer = 1.0;
  int number = 14;
  for (const Gauge& gauge : gauges()) {
    EXPECT_EQ(gauge.name, std::to_string(number++) + "G");
    EXPECT_LT(gauge.outer_m, outer);
    EXPECT_GT(gauge.inner_m, 0.3 * gauge.outer_m);
    EXPECT_LT(gauge.inner_m, 0.8 * gauge.outer_m);
    outer = gauge.outer_m;
    EXPECT_EQ(find_gauge(gauge.name)->outer_m, gauge.outer_m);
  }
  EXPECT_EQ(find_gauge("20"), nullptr);
  EXPECT_EQ(find_material("brass"), nullptr);
}

TEST(Tube, SteelOfTwentyGaugeIsThatOfTheModels) {
  const Gauge* const gauge = find_gauge("20G");
  ASSERT_NE(gauge, nullptr);
  const Section steel = section_of(gauge->outer_m, gauge->inner_m, find_material("steel")->young_pa);
  EXPECT_NEAR(steel.bending_nm2, 5.38e-3, 0.005e-3);
  EXPECT_NEAR(steel.axial_n, 200e9 * std::numbers::pi / 4.0 * (0.908e-3 * 0.908e-3 - 0.603e-3 * 0.603e-3), 1e-9);
  EXPECT_NEAR(section_of(gauge->outer_m, gauge->inner_m, find_material("nitinol")->young_pa).bending_nm2, 0.375 * steel.bending_nm2, 1e-15);
  EXPECT_NEAR(section_of(2.0, 0.0, 1.0).bending_nm2, std::numbers::pi / 4.0, 1e-15);
}

TEST(Bevel, PushesTowardsItsPoint) {
  constexpr double degree = std::numbers::pi / 180.0;
  EXPECT_EQ(lateral_per_axial({}), 0.0);
  EXPECT_NEAR(lateral_per_axial({45.0 * degree, 0.0}), 1.0, 1e-15);
  EXPECT_NEAR(lateral_per_axial({30.0 * degree, 0.0}), std::sqrt(3.0), 1e-14);
  EXPECT_NEAR(lateral_per_axial({-30.0 * degree, 0.0}), -std::sqrt(3.0), 1e-14);
  EXPECT_NEAR(lateral_per_axial({30.0 * degree, 0.5}), 1.0 / std::tan(30.0 * degree + std::atan(0.5)), 1e-14);
  EXPECT_NEAR(lateral_per_axial({90.0 * degree, 0.0}), 0.0, 1e-15);
  EXPECT_EQ(lateral_per_axial({60.0 * degree, 1.0}), 0.0);  // friction holds what slides
}

}  // namespace
}  // namespace trocar::needle
