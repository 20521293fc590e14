// Wrench of the hand on the handle, and joint velocities, from encoders and motor torques (thesis A.2): one observer for each linkage.
//   D(theta) theta'' + C(theta, theta') theta' = tau - tau_f(theta') + r,   r = J^T f, f the force of the rest on the end point
// The rigid handle (mass m, centre of mass a of the coupling's length from P0, inertia I) is for both linkages the same as masses
// (1-a) m at P0 and a m at P1, and a pure inertia, the spare S = I - m a (1-a) coupling^2. With those masses in D,
//   wrench = H^T (r_0, r_1) + (0, 0, S theta'')     H = J_e^-1 J_o of twin.hpp; it exists at parallel singularities too
// Forces along the coupling are in r and not in H^T r. Signs: the wrench is what the hand applies to the mechanism (f_x, f_y in N, moment
// about the handle in N m); a push to +x reads +f_x. The thesis prints the feedback with the other sign, with which it diverges.
//
// Nicosia (S. Nicosia, P. Tomei, IEEE Trans. Automatic Control 35(9), 1990, 1058; thesis A.4 to A.6), e = theta - theta_hat:
//   theta_hat' = v + k_v e,  v' = D^-1 (-C theta'_hat - tau_f + tau + k_p e),   k_v = sqrt(2) w,  k_p = w^2 D(theta)
//   D e'' + (C(theta, theta') + C(theta, theta'_hat) + k_v D) e' + k_p e = J^T f;   at rest J^T f = k_p e
//   k_p grows with D, so every joint has the same poles in every pose and w is the -3 dB bandwidth of the force. A tick integrates exactly,
//   D frozen at its middle and the remaining torques held (disturbance.hpp: a0, a1, b). Stability, by the small-gain theorem (G. Zames,
//   same Transactions 11, 1966): unmodelled in the frozen error is an acceleration D^-1 (C(theta, theta') + C(theta, theta'_hat) + slope of
//   tau_f) times the velocity error, and of the exact sampled dynamics
//     velocity error / acceleration = T (1+a1+a0)/4 (z-1)/(z^2 - a1 z + a0), on |z| = 1 at most
//     gain = T (1+a1+a0)/4 / sqrt(a1 (1+a0) - 4 a0 + 2 b sqrt(a0))      (T -> 0: 1/(sqrt(2) w))
//   Errors vanish if gain * (3 |D^-1 C| + |D^-1 tau_f'|) < 1 over poses and speeds (3: while the velocity error is at most the
//   greatest speed itself). It bounds w from below; Nicosia and Tomei's bound on k_d has the same form.
// Momentum (A. De Luca, R. Mattone, IEEE ICRA 2005, 999), momentum D theta' from plain differences:
//   d/dt (D theta') = tau - tau_f + C^T theta' + r,   r_hat' = w (r - r_hat): exact for torques held over a tick
//   Nothing is fed back but the measurement itself: stable at every w.
// Above, w is bounded by encoder counts (white errors, uniform over one count; at rest they are steady and smaller) and by the tick.
// A linkage whose D is not known to scale changes r in proportion, and no pole.
#pragma once

#include <array>
#include <cstdint>

#include "common/mechanism/twin.hpp"
#include "common/rig/rig.hpp"
#include "firmware/control/disturbance.hpp"
#include "firmware/control/friction.hpp"

namespace trocar::control {

using ObserverKind = rig::ForceObserver;

struct ForceObserverConfig {
  ObserverKind kind{};
  double bandwidth_rad_s{};
  std::array<JointFriction, 4> friction{};
  mechanism::TwinModel model{};  // end points carry their share of the handle, whose own mass is not read
  double spare_inertia_kg_m2{};  // S
  // Play that takes the chatter of one count out of every angle (hysteresis.hpp); 0 takes them as they are. The observer multiplies a count
  // by M w^2: at rest on the edge between two counts that alone, fed back by a display, is a limit cycle. In motion the angle is half a
  // count late, which no force and no velocity shows.
  double play_rad{};
};

// Friction from the rig file, smoothed over what one count feigns at this bandwidth (bandwidth * count) and at least
// least_smoothing_rad_s. Play of one count and a little. Twin rigs only.
inline constexpr double least_smoothing_rad_s = 0.1;  // 1 cm/s of a handle 0.1 m from the motors
[[nodiscard]] ForceObserverConfig force_observer_config(const rig::Rig& rig, ObserverKind kind, double bandwidth_rad_s) noexcept;
// As the rig file asks for it.
[[nodiscard]] inline ForceObserverConfig force_observer_config(const rig::Rig& rig) noexcept {
  return force_observer_config(rig, rig.haptic.observer, rig.haptic.observer_bandwidth_rad_s);
}

struct ForceEstimate {
  mechanism::Vec3 wrench = mechanism::Vec3::Zero();           // N, N, N m of the hand on the mechanism
  mechanism::Vec4 joint_velocity = mechanism::Vec4::Zero();   // rad/s
  mechanism::Vec3 handle_velocity = mechanism::Vec3::Zero();  // m/s, m/s, rad/s
  mechanism::Vec4 external_torque = mechanism::Vec4::Zero();  // r, N m
};

struct ForceObserverState {
  bool started{};
  double gap_s{};                                   // since the last sample that was taken
  mechanism::Vec4 angle = mechanism::Vec4::Zero();  // behind the play
  std::array<DisturbanceState, 4> joint{};          // Nicosia
  struct {                                          // Momentum, in the middle of the last step
    bool known{};
    double step_s{};
    mechanism::Vec4 momentum = mechanism::Vec4::Zero();  // N m s
    mechanism::Vec4 torque = mechanism::Vec4::Zero();    // known ones, N m
    mechanism::Vec4 low_pass_velocity = mechanism::Vec4::Zero();
  } last{};
  ForceEstimate estimate{};
};

// angle_rad: as sampled, turns unbroken. torque_nm: at the joints, behind gear and efficiency, mean over the dt_s > 0 since the sample
// before. The first sample starts at rest with no force. What is not Ok (NaN; a pose that cannot be) leaves estimate and state as they
// were, and its dt_s counts for the next sample.
mechanism::Status update(const ForceObserverConfig& config, ForceObserverState& state, const mechanism::Vec4& angle_rad,
                         const mechanism::Vec4& torque_nm, double dt_s) noexcept;

enum class Admissible : std::uint8_t {
  Yes,
  NotPositive,      // bandwidth, tick or counts: zero, negative or NaN; or a friction without a smoothing speed
  NotAPose,         // a corner of the workspace cannot be taken, or a linkage has no positive inertia
  TooFastForTick,   // b > 4 sqrt(a0), w T > 1.99: from there on the gain is greatest at the Nyquist frequency, nothing is filtered any more
  TooSlowForSpeed,  // Nicosia: the gain above with C alone is 1 or more
  FrictionTooSteep,  // Nicosia: with friction it is; smooth it more
  EncoderTooCoarse,  // counts alone make a force error above the RMS allowed
};
[[nodiscard]] const char* to_text(Admissible verdict) noexcept;

struct Admission {
  Admissible verdict{};
  double speed_gain{};     // gain * 3 |D^-1 C|: below 1; 0 for Momentum
  double friction_gain{};  // gain * |D^-1 tau_f'|: below 1 - speed_gain; 0 for Momentum
  double count_force_n{};  // RMS of |(f_x, f_y)| from encoder counts, at the worst pose
};

// At start, milliseconds: over poses of the rig's workspace limits and speeds up to its velocity faults, with its encoder and tick.
[[nodiscard]] Admission admit(const ForceObserverConfig& config, const rig::Rig& rig, double count_force_allowed_n) noexcept;
[[nodiscard]] inline Admission admit(const rig::Rig& rig) noexcept {
  return admit(force_observer_config(rig), rig, rig.haptic.observer_count_force_n);
}

}  // namespace trocar::control
