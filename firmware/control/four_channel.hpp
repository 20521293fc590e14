// Four-channel coupling of the haptic device (master) and a virtual slave (thesis A.4, figure A.6, A.9).
//   general    Z_m v_m = f_h - C_2 f_e - C_4 v_s - C_m v_m,      Z_s v_s = C_1 v_m + C_3 f_h - f_e - C_s v_s
//   thesis     C_1 = C_s,  C_2 = C_3 = 1,  C_4 = -C_m,           C = damping + stiffness / s on velocity
//   master     f_m = C_m (v_s - v_m) - f_e                       goes to the impedance law, which makes Z_m
//   slave      M_s v_s' + B_s v_s = (C_s + B_a)(v_m - v_s) + f_h - f_e
//   damping    B_a = K_b |f_e| + B_min, in C_s and C_1 alike
// Signs: f_h force of the hand on the mechanism, f_e force of the slave on its environment. Stiffness acts on x_m - x_s, which
// `enter` makes zero. |f_e| is the length of the force for x and y, the moment for theta.
//
// With Z_m = Z_s the two move as one and the hand feels Z_s + Z_e. Transparency (Lawrence 1993; Hashtrudi-Zaad and Salcudean
// 2001, no local force feedback) wants C_1 = Z_s + C_s, C_4 = -(Z_m + C_m), C_2 = C_3 = 1. The thesis's choice leaves out Z_s and
// Z_m, that is an acceleration of the master; what the hand feels too much is just Z_s. As both masses are ours to choose, a
// lighter pair does the same as partial acceleration channels would.
// The scan of A.9 keeps only "35 +", "100" and fragments of the left sides: which of C_1 and C_4 carries the minus, that the
// damping is in N s/m and the stiffness in N/m, and that B_a enters C_1 too, is fixed by those conditions.
//
// The slave is integrated by backward Euler in the coupling and damping, so that any B_a is stable; f_e is taken at the slave's
// pose of this tick, which bounds an environment's stiffness by 4 M_s / dt^2 (1.2 MN/m at 0.3 kg and 1 kHz).
#pragma once

#include "common/mechanism/types.hpp"

namespace trocar::control {

// On velocity: damping + stiffness / s.
struct LocalController {
  mechanism::Vec3 damping = mechanism::Vec3::Zero();    // N s/m, N s/m, N m s/rad
  mechanism::Vec3 stiffness = mechanism::Vec3::Zero();  // N/m, N/m, N m/rad
};

// Translation: A.9. Rotation is ours: the same at an arm of sqrt(1/1000) m, about that of the thesis's PID gains.
inline const LocalController thesis_local_controller{{35.0, 35.0, 0.035}, {100.0, 100.0, 0.1}};

struct AdaptiveDamping {
  double per_force_s_m{60.0};                       // K_b, translation (A.9)
  double per_moment_s_rad{1.9};                     // K_b, rotation: ours, 60 s/m at the same arm
  mechanism::Vec3 least = mechanism::Vec3::Zero();  // B_min: N s/m, N s/m, N m s/rad
};

struct VirtualSlave {
  mechanism::Vec3 mass{0.3, 0.3, 2.5e-4};             // M_s of the needle: kg, kg, kg m^2; > 0. Ours: equal to M_d
  mechanism::Vec3 damping = mechanism::Vec3::Zero();  // B_s: N s/m, N s/m, N m s/rad
};

struct FourChannelConfig {
  LocalController master = thesis_local_controller;  // C_m, and -C_4
  LocalController slave = thesis_local_controller;   // C_s, and C_1
  AdaptiveDamping adaptive{};
  VirtualSlave needle{};
};

struct SlaveState {
  mechanism::Vec3 pose = mechanism::Vec3::Zero();      // m, m, rad (not wrapped)
  mechanism::Vec3 velocity = mechanism::Vec3::Zero();  // m/s, m/s, rad/s
};

// One tick of any display.
struct DisplayInput {
  mechanism::Vec3 pose = mechanism::Vec3::Zero();               // of the master: m, m, rad
  mechanism::Vec3 velocity = mechanism::Vec3::Zero();           // of the master
  mechanism::Vec3 hand_force = mechanism::Vec3::Zero();         // f_h
  mechanism::Vec3 environment_force = mechanism::Vec3::Zero();  // f_e, for the slave's pose of this tick
  double dt_s{};
};

// B_a.
[[nodiscard]] mechanism::Vec3 adaptive_damping(const AdaptiveDamping& config, const mechanism::Vec3& environment_force) noexcept;

// Returns f_m of this tick and leaves the slave at the next one.
[[nodiscard]] mechanism::Vec3 update(const FourChannelConfig& config, SlaveState& slave, const DisplayInput& input) noexcept;

}  // namespace trocar::control
