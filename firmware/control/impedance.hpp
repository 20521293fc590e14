// Impedance law in the workspace (x, y, theta), thesis A.8: makes the device move like another one.
//   device    M_c x'' + C_c x' = f_h + u                                        (A.3)
//   wanted    M_d x'' + B_d x' + K_d (x - x_0) = f_h + f_m                      (A.7)
//   so        u = (G - 1) f_h + G f_m + (C_c - G B_d) x' - G K_d (x - x_0),   G = M_c M_d^-1
// Signs: f_h is the force of the hand on the mechanism, u what the motors add to it, f_m the command of a display.
// Units: N, N, N m on (x, y, theta). The scan of A.7 and A.8 has lost its primes and superscripts and its K_d x has no rest
// pose: the above follows from A.3 and A.7, and the test checks it against them.
//
// f_h enters only where M_d differs from M_c. A light M_d feeds the hand back with gain G - 1, through the lag of whatever
// measures f_h: half of the device's mass is cautious, the whole (device_mass = true) needs no f_h at all.
#pragma once

#include "common/mechanism/types.hpp"

namespace trocar::control {

// Ours: about the haptic rig's own mass, nothing else.
struct ImpedanceConfig {
  bool device_mass{};                                         // M_d = M_c: `mass` and f_h are not used
  mechanism::Vec3 mass{0.3, 0.3, 2.5e-4};                     // kg, kg, kg m^2; diagonal of M_d, > 0
  mechanism::Vec3 damping = mechanism::Vec3::Zero();          // N s/m, N s/m, N m s/rad; diagonal of B_d
  mechanism::Vec3 stiffness = mechanism::Vec3::Zero();        // N/m, N/m, N m/rad; diagonal of K_d
  mechanism::Vec3 rest_pose_m_rad = mechanism::Vec3::Zero();  // x_0; matters only with stiffness
};

// Of this tick. M_c and C_c from mechanism::dynamics, or a model of one axis.
struct DeviceState {
  mechanism::Mat3 M = mechanism::Mat3::Identity();
  mechanism::Mat3 C = mechanism::Mat3::Zero();
  mechanism::Vec3 pose = mechanism::Vec3::Zero();        // m, m, rad
  mechanism::Vec3 velocity = mechanism::Vec3::Zero();    // m/s, m/s, rad/s
  mechanism::Vec3 hand_force = mechanism::Vec3::Zero();  // f_h
};

// u for a display's command f_m.
[[nodiscard]] mechanism::Vec3 impedance_force(const ImpedanceConfig& config, const DeviceState& device,
                                              const mechanism::Vec3& f_m) noexcept;

// The f_m for which impedance_force gives u: what is left of a command after limits, or what an earlier law amounts to.
[[nodiscard]] mechanism::Vec3 display_force(const ImpedanceConfig& config, const DeviceState& device, const mechanism::Vec3& u) noexcept;

}  // namespace trocar::control
