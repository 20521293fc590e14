#include "tests/reference/haptic_axis/haptic_axis.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::reference {

using control::Display;
using mechanism::Vec3;

namespace {
control::DeviceState along_x(double mass_kg, double x, double v, double hand_force) {
  control::DeviceState d;
  d.M(0, 0) = mass_kg;
  d.pose[0] = x;
  d.velocity[0] = v;
  d.hand_force[0] = hand_force;
  return d;
}
}  // namespace

double HapticAxis::encoder() const {
  const double q = plant_.encoder_step_m;
  return q > 0.0 ? q * std::floor(state.x / q) : state.x;
}

control::DeviceState HapticAxis::measured() {
  const double x = encoder();
  state.held = control::hysteresis(state.held, x, plant_.hysteresis ? 1.001 * plant_.encoder_step_m : 0.0);
  const double v = control::update({plant_.velocity_bandwidth_rad_s}, state.velocity, state.held, 1.0 / plant_.tick_hz);
  return along_x(plant_.mass_kg, x, v, state.force_seen);
}

void HapticAxis::enter(Display display, double u) {
  const double x = encoder();
  state.held = x;
  state.velocity = {x, 0.0, true};
  state.under_way.fill(u);
  control::enter(haptic, display, along_x(plant_.mass_kg, x, 0.0, state.force_seen), {u, 0.0, 0.0});
}

void HapticAxis::change(Display display) {
  control::change(law_, haptic, display, along_x(plant_.mass_kg, encoder(), state.velocity.velocity, state.force_seen));
}

void HapticAxis::tick(double r, double r_dot, double push) {
  const double dt = 1.0 / plant_.tick_hz;
  const control::DeviceState device = measured();
  const double x_s = control::slave_pose(law_, haptic, device)[0];
  const double v_s = haptic.display.display == Display::Impedance ? device.velocity[0] : haptic.display.slave.velocity[0];
  f_e_ = environment_(x_s, v_s);
  u_ = control::update(law_, haptic, device, {f_e_, 0.0, 0.0}, dt)[0];
  std::copy_backward(state.under_way.begin(), state.under_way.end() - 1, state.under_way.end());
  state.under_way[0] = u_;
  const double u = state.under_way[plant_.delay_ticks];

  const double h = dt / plant_.substeps;
  const double mass = plant_.mass_kg + hand_.mass_kg;
  const double w = plant_.force_bandwidth_rad_s;
  for (int i = 0; i < plant_.substeps; ++i) {
    const double muscle = hand_.damping_n_s_m * (r_dot - state.v) + hand_.stiffness_n_m * (r - state.x) + push;
    const double v0 = state.v;
    double v1 = v0 + h * (u + muscle - plant_.viscous_n_s_m * v0) / mass;
    const double grip = h * plant_.coulomb_n / mass;
    v1 = std::abs(v1) <= grip ? 0.0 : v1 - std::copysign(grip, v1);
    state.v = v1;
    state.x += h * v1;
    r += h * r_dot;
    state.hand_force = muscle - hand_.mass_kg * (v1 - v0) / h;
    state.force_rate += h * (w * w * (state.hand_force - state.force_seen) - 2.0 * w * state.force_rate);
    state.force_seen += h * state.force_rate;
  }
}

}  // namespace trocar::reference
