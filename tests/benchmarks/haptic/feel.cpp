#include "tests/benchmarks/haptic/feel.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace trocar::bench {
namespace {

using reference::AxisPlant;
using reference::Hand;
using reference::HapticAxis;

constexpr double tau = 2.0 * std::numbers::pi;
constexpr Hand usual_hand{0.1, 4.0, 300.0};

AxisPlant rig() {
  AxisPlant plant;
  plant.encoder_step_m = tau / 16000 * 0.105;
  return plant;
}

control::HapticConfig chain(const AxisPlant& plant) {
  control::HapticConfig config;
  config.impedance.device_mass = true;
  config.limits = {8.0, 0.1, 800.0, 10.0, 0.5, 0.9, 10.0, 18.0};
  config.guard.delay_ticks = plant.delay_ticks;
  config.guard.step[0] = 1.001 * plant.encoder_step_m;
  return config;
}

}  // namespace

// 0.1 Hz, so that the device's own mass takes 0.13 N/m off; up to about 2.5 N: r swings so far that hand and spring in series share it.
FeltRow felt_stiffness(const Scheme& scheme, double rendered) {
  const AxisPlant plant = rig();
  HapticAxis axis(plant, usual_hand, chain(plant), [=](double x, double) { return rendered * x; });
  axis.enter(scheme.display);
  FeltRow row{scheme.name, rendered, 0.0, 0.0, 0.0};
  const double w = tau * 0.1, swing = 2.5 * (1.0 / usual_hand.stiffness_n_m + 1.0 / rendered);
  double n = 0, sx = 0, sf = 0, sxx = 0, sxf = 0, sff = 0;
  for (int k = 0; k < 30000; ++k) {
    const double t = k / plant.tick_hz;
    axis.tick(swing * 0.5 * (1.0 - std::cos(w * t)), swing * 0.5 * w * std::sin(w * t), 0.0);
    row.least_energy_j = std::min(row.least_energy_j, axis.haptic.guard.energy_j);
    if (k < 10000) continue;  // two whole swings
    const double x = axis.state.x, f = axis.state.hand_force;
    n += 1, sx += x, sf += f, sxx += x * x, sxf += x * f, sff += f * f;
  }
  const double vxx = sxx - sx * sx / n, vxf = sxf - sx * sf / n, vff = sff - sf * sf / n;
  row.felt_n_m = vxf / vxx;
  row.ripple_n = std::sqrt(std::max(0.0, (vff - vxf * vxf / vxx) / n));
  return row;
}

FreeRow free_space(const Scheme& scheme, double frequency) {
  const AxisPlant plant = rig();
  HapticAxis axis(plant, usual_hand, chain(plant), [](double, double) { return 0.0; });
  axis.enter(scheme.display);
  const double w = tau * frequency, speed = 0.1;
  const int period = static_cast<int>(std::lround(plant.tick_hz / frequency));
  std::complex<double> f{}, v{};
  for (int k = 0; k < 2000 + 8 * period; ++k) {
    const double t = k / plant.tick_hz;
    axis.tick(speed / w * std::sin(w * t), speed * std::cos(w * t), 0.0);
    if (k < 2000) continue;
    const std::complex<double> turn = std::polar(1.0, -w * t);
    f += axis.state.hand_force * turn;
    v += axis.state.v * turn;
  }
  const std::complex<double> felt = f / v;
  return {scheme.name, frequency, felt.imag() / w, felt.real()};
}

}  // namespace trocar::bench
