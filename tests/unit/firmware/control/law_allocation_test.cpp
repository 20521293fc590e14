// A program of its own, because its allocator counts: no haptic law allocates, in any display, through changes and resets.
#include <gtest/gtest.h>

#include <memory>

#include "firmware/control/haptic.hpp"
#include "tests/reference/allocations/allocations.hpp"

namespace trocar::control {
namespace {

using mechanism::Vec3;

TEST(HapticLaws, NothingAllocates) {
  const std::size_t before = reference::allocations();
  const auto counted = std::make_unique<HapticState>();
  ASSERT_GT(reference::allocations(), before);  // the counter works

  HapticConfig config;
  config.limits = {8.0, 0.1, 800.0, 10.0, 0.5, 0.9, 10.0, 18.0};
  HapticState& state = *counted;
  DeviceState device;
  device.M = Vec3(0.3, 0.35, 2.5e-4).asDiagonal();
  device.C(0, 1) = 0.1;
  Vec3 sum = Vec3::Zero();
  const std::size_t start = reference::allocations();
  for (const bool device_mass : {false, true}) {
    config.impedance.device_mass = device_mass;
    for (const Display d : {Display::Impedance, Display::Admittance, Display::FourChannel}) {
      enter(state, d, device, {1.0, 0.5, 0.01});
      for (int k = 0; k < 200; ++k) {
        if (k == 100) change(config, state, Display::Impedance, device);
        device.pose += Vec3(1e-4, -1e-4, 1e-3);
        device.velocity = {0.1, -0.1, 1.0};
        device.hand_force = {1.0, -1.0, 0.02};
        const Vec3 f_e = 500.0 * slave_pose(config, state, device);
        sum += update(config, state, device, f_e, 1e-3);
      }
    }
  }
  EXPECT_EQ(reference::allocations(), start);
  EXPECT_TRUE(sum.allFinite());
}

}  // namespace
}  // namespace trocar::control
