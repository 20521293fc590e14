// The exact cantilever under one dead force on its tip, by shooting from the tip: EI theta'' = -(f.n)(1 + f.t / EA), theta'(L) = M / EI,
// with the tip's angle such that theta(0) = 0. Runge and Kutta's fourth order in many steps: right to about 1e-13.
#pragma once

#include <array>
#include <cmath>

namespace trocar::needle::testing {

struct Elastica {
  double x_m{}, y_m{}, theta_rad{};  // of the tip, base at the origin along +x
};

struct Cantilever {
  double length_m{1.0}, bending_nm2{1.0}, axial_n{1e300};
};

// theta, theta', and how far the tip is from s, at s = 0.
inline std::array<double, 4> shoot(const Cantilever& c, double fx, double fy, double tip_rad, int steps) {
  const auto slope = [&](const std::array<double, 4>& q) {
    const double cosine = std::cos(q[0]), sine = std::sin(q[0]);
    const double stretch = 1.0 + (fx * cosine + fy * sine) / c.axial_n;
    return std::array{q[1], -(fy * cosine - fx * sine) * stretch / c.bending_nm2, stretch * cosine, stretch * sine};
  };
  std::array<double, 4> q{tip_rad, 0.0, 0.0, 0.0};
  const double h = -c.length_m / steps;
  for (int k = 0; k < steps; ++k) {
    const auto at = [&](const std::array<double, 4>& d, double part) {
      std::array<double, 4> moved{};
      for (std::size_t i = 0; i < 4; ++i) moved[i] = q[i] + part * h * d[i];
      return moved;
    };
    const auto a = slope(q), b = slope(at(a, 0.5)), e = slope(at(b, 0.5)), d = slope(at(e, 1.0));
    for (std::size_t i = 0; i < 4; ++i) q[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * e[i] + d[i]);
  }
  return q;
}

// The tip's angle is looked for between 0 and `most_rad`.
inline Elastica elastica(const Cantilever& c, double fx, double fy, double most_rad = 1.5707, int steps = 4000) {
  double low = 0.0, high = most_rad;
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (shoot(c, fx, fy, middle, steps)[0] < 0.0 ? low : high) = middle;
  }
  const double tip = 0.5 * (low + high);
  const auto q = shoot(c, fx, fy, tip, steps);
  return {-q[2], -q[3], tip};
}

}  // namespace trocar::needle::testing
