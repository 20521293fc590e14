#include "tests/benchmarks/haptic/z_width.hpp"

#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <cmath>

namespace trocar::bench {
namespace {

using control::Display;
using reference::AxisPlant;
using reference::Hand;
using reference::HapticAxis;

// Everything that a tick remembers.
std::vector<double*> memory(HapticAxis& axis, std::size_t delay_ticks, Display display) {
  auto& s = axis.state;
  std::vector<double*> all{&s.x, &s.v, &s.force_seen, &s.force_rate, &s.velocity.position, &s.velocity.velocity};
  for (std::size_t i = 0; i < delay_ticks; ++i) all.push_back(&s.under_way[i]);
  if (display != Display::Impedance) {
    all.push_back(axis.haptic.display.slave.pose.data());
    all.push_back(axis.haptic.display.slave.velocity.data());
  }
  return all;
}

bool passive(const AxisPlant& plant, const Scheme& scheme, double stiffness, double damping) {
  for (const double mass : {0.0, 0.3, 3.0, 0.1, 1.0, 10.0})
    for (const double spring : {0.0, 300.0, 3000.0, 30.0, 100.0, 1000.0, 10000.0})
      if (spectral_radius(plant, {mass, 0.0, spring}, scheme, stiffness, damping) > 1.0 + 1e-9) return false;
  return true;
}

}  // namespace

double spectral_radius(const AxisPlant& plant, const Hand& hand, const Scheme& scheme, double stiffness, double damping) {
  control::HapticConfig config;
  config.impedance.device_mass = true;
  config.guard.active = false;
  config.fade.duration_s = config.display.glide.duration_s = 0.0;
  config.limits = {1e30, 1e30, 1e30, 1e30, 1e30, 2e30, 1e30, 2e30};
  config.display.four_channel.adaptive = {0.0, 0.0, mechanism::Vec3::Constant(scheme.adaptive_damping_n_s_m)};
  HapticAxis axis(plant, hand, config, [=](double x, double v) { return stiffness * x + damping * v; });
  axis.enter(scheme.display);
  axis.haptic.begins = false;
  const HapticAxis::State rest = axis.state;
  const control::HapticState haptic = axis.haptic;
  const std::vector<double*> all = memory(axis, plant.delay_ticks, scheme.display);
  const auto n = static_cast<Eigen::Index>(all.size());
  Eigen::MatrixXd step(n, n);
  for (Eigen::Index j = 0; j < n; ++j) {
    axis.state = rest;
    axis.haptic = haptic;
    *all[static_cast<std::size_t>(j)] = 1.0;
    axis.tick(0.0, 0.0, 0.0);
    for (Eigen::Index i = 0; i < n; ++i) step(i, j) = *all[static_cast<std::size_t>(i)];
  }
  return step.eigenvalues().cwiseAbs().maxCoeff();
}

WallRow largest_wall(const AxisPlant& plant, const Scheme& scheme, double damping) {
  WallRow row{scheme.name, plant.tick_hz, damping, 0.0};
  constexpr double ratio = 1.25;
  double k = least_wall_n_m;
  while (k <= most_wall_n_m && passive(plant, scheme, k, damping)) {
    row.stiffness_n_m = k;
    k *= ratio;
  }
  if (row.stiffness_n_m == 0.0 || k > most_wall_n_m) return row;
  double high = k;
  for (int i = 0; i < 5; ++i) {
    const double middle = std::sqrt(row.stiffness_n_m * high);
    (passive(plant, scheme, middle, damping) ? row.stiffness_n_m : high) = middle;
  }
  return row;
}

}  // namespace trocar::bench
