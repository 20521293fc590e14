// Passivity guard: time-domain observer and controller of Hannaford and Ryu 2002 (IEEE Trans. Robotics and Automation 18(1))
// at the port between display and device, f_m and v_m.
//   observer     E_k = min(E_(k-1) - f_sent . (x_k - x_(k-1)), credit)          energy that the display has taken in, J
//   forecast     E^ = E_k - (f_m + commands under way) . v dt                   at the end of this command
//   controller   E^ < 0:  f = f_m - a D v,   a = min(-E^ / (v^T D v dt), a_max),   D = diag(1, 1, arm^2)
// f_sent is the command that was held over the last interval, after every limit and after the drives' delay: with it the sum is
// exact for the encoder's positions, whatever the sampling does; only the forecast needs a velocity.
//
// Total over x, y and theta, not per axis: passivity is a property of the whole port, and a tissue that is pushed along x and
// lets go along y is passive while its axes by themselves are not.
// Not per tick but never forgetting would be the other mistake: a needle dissipates all the time, and a stock of energy lets an
// oscillation grow until it is used up. `credit_j` caps the stock at what the environment can really give back.
//
// The port excludes the impedance law. Shaping M_d below M_c takes kinetic energy from the motors and returns it, legitimately;
// whether that loop is stable is a matter of the force observer's bandwidth and is not seen here. Nor are sub-count motions.
// Both start at E = 0: whatever the environment has stored when the display begins counts as active when given back.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/mechanism/types.hpp"

namespace trocar::control {

struct PassivityConfig {
  bool active{true};           // false: observes, does not act
  double credit_j{0.005};      // most stock of energy. Ours: 3 N on a spring of 1 kN/m hold 4.5 mJ
  double bound_j{0.005};       // E below -bound: the guard has failed, the caller stops. Not used here
  double damping_n_s_m{30.0};  // a_max. Stable by itself at 0.3 kg, a velocity of 300 rad/s and two ticks of delay: there the limit is 78
  double arm_m{0.0316};        // weighs rotation against translation, as in four_channel.hpp
  std::size_t delay_ticks{1};  // from a tick's command to the SYNC at which it acts; at most most_delay_ticks
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
  std::array<mechanism::Vec3, most_delay_ticks + 1> sent{};  // newest first
};

// E = 0, nothing under way.
inline void reset(PassivityState& state) noexcept {
  state = {};
  state.sent.fill(mechanism::Vec3::Zero());
}

// The command to use instead of f_m.
[[nodiscard]] mechanism::Vec3 update(const PassivityConfig& config, PassivityState& state, const mechanism::Vec3& pose,
                                     const mechanism::Vec3& velocity, const mechanism::Vec3& f_m, double dt_s) noexcept;

// What was really sent of it. Once after every update.
void sent(PassivityState& state, const mechanism::Vec3& f_m) noexcept;

}  // namespace trocar::control
