// Piecewise cubic Hermite interpolation that keeps the data's monotonicity (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980):
// slopes at the points are the weighted harmonic means of the neighbouring secants, zero where those change sign.
// Once continuously differentiable between the end points, constant beyond them.
#pragma once

#include <vector>

namespace trocar::sim_plant {

class MonotoneCubic {
 public:
  // Throws fem::Error unless x increases strictly and both have the same length, at least one. `name` opens the message.
  MonotoneCubic(const char* name, std::vector<double> x, std::vector<double> y);
  [[nodiscard]] double operator()(double x) const noexcept;

 private:
  std::vector<double> x_, y_, slope_;
};

}  // namespace trocar::sim_plant
