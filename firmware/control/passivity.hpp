// Passivity guard: time-domain observer and controller of Hannaford and Ryu 2002 (IEEE Trans. Robotics and Automation 18(1))
// at the port between display and device, f_m and v_m.
//   observer     E_k = min(E_(k-1) - f_sent . (x_k - x_(k-1)), cap)   energy that the display has taken in, J
//   forecast     E^ = E_k - (f_m + commands under way) . v dt                   at the end of this command
//   controller   E^ < 0:  f = f_m - a D v,   a = min(-E^ / (v^T D v dt), a_max),   D = diag(1, 1, arm^2)
// f_sent is the command that was held over the last interval, after every limit and after the drives' delay: with it the sum is
// exact for the encoder's positions, whatever the sampling does; only the forecast needs a velocity.
// A flip of one count back and forth moves the handle by less than it shows, and is not counted; all other motion is.
//
// Total over x, y and theta, not per axis: passivity is a property of the whole port, and a tissue that is pushed along x and
// lets go along y is passive while its axes by themselves are not.
// A needle dissipates all the time; without a cap on what that adds up to, an oscillation could grow until the stock is used
// up. The cap is what the environment can really give back: cap = credit + |f|^2 / (2 softest), moments divided by `arm`.
//
// The port excludes the impedance law. Shaping M_d below M_c takes kinetic energy from the motors and returns it, legitimately;
// whether that loop is stable depends on the force observer's bandwidth and is not seen here. Nor are motions below a count.
// Admittance is active by
// nature where it moves the device against its own friction; the guard then damps a free motion a little.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/mechanism/types.hpp"
#include "firmware/control/velocity_observer.hpp"

namespace trocar::control {

struct PassivityConfig {
  bool active{true};              // false: observes, does not act
  double credit_j{0.005};         // most stock of energy without force. Ours: 0.3 kg at 0.18 m/s
  double softest_n_m{50.0};       // and with it, what the present command could hold in a spring as soft as this
  double initial_j{0.005};        // E at the start: the environment may be loaded when a display begins
  double bound_j{0.01};           // E below -bound: failed(). Ours: 0.3 kg at 0.26 m/s
  double damping_n_s_m{25.0};     // a_max. Alone, at 0.32 kg and two ticks of delay, 109 is the limit; a display's own damping adds to it
  double arm_m{0.0316};           // weighs rotation against translation, as in four_channel.hpp
  double bandwidth_rad_s{600.0};  // of the guard's own velocity
  std::size_t delay_ticks{1};     // from a tick's command to the SYNC at which it acts; at most most_delay_ticks
  mechanism::Vec3 step = mechanism::Vec3::Zero();  // of the pose, one count and a little: m, m, rad; 0 takes every position as exact
};

inline constexpr std::size_t most_delay_ticks = 3;

struct PassivityState {
  double energy_j{};        // E, for telemetry
  double dissipated_j{};    // by the controller, as forecast
  double damping_n_s_m{};   // a of this tick
  std::uint64_t acted{};    // ticks with damping
  std::uint64_t limited{};  // ticks in which a_max was not enough
  bool started{};
  mechanism::Vec3 pose = mechanism::Vec3::Zero();
  std::array<VelocityObserverState, 3> velocity{};
  mechanism::Vec3 held = mechanism::Vec3::Zero();            // pose behind the hysteresis
  mechanism::Vec3 counted = mechanism::Vec3::Zero();         // pose up to which energy_j counts
  mechanism::Vec3 pending_j = mechanism::Vec3::Zero();       // since then
  std::array<mechanism::Vec3, most_delay_ticks + 1> sent{};  // newest first
};

// As at the start, nothing under way.
inline void reset(PassivityState& state) noexcept {
  state = {};
  state.sent.fill(mechanism::Vec3::Zero());
}

// The display has given out more than the bound (or NaN): the caller stops it.
[[nodiscard]] inline bool failed(const PassivityConfig& config, const PassivityState& state) noexcept {
  return !(state.energy_j >= -config.bound_j);
}

// The command to use instead of f_m.
[[nodiscard]] mechanism::Vec3 update(const PassivityConfig& config, PassivityState& state, const mechanism::Vec3& pose,
                                     const mechanism::Vec3& f_m, double dt_s) noexcept;

// What was really sent of it. Once after every update.
void sent(PassivityState& state, const mechanism::Vec3& f_m) noexcept;

}  // namespace trocar::control
