#include "sim_plant/phantom/monotone_cubic.hpp"

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include "common/fem/tissue.hpp"

namespace trocar::sim_plant {

MonotoneCubic::MonotoneCubic(const char* name, std::vector<double> x, std::vector<double> y) : x_(std::move(x)), y_(std::move(y)) {
  if (x_.empty() || x_.size() != y_.size())
    throw fem::Error(std::string(name) + ": " + std::to_string(x_.size()) + " abscissae and " + std::to_string(y_.size()) +
                     " values; give as many of one as of the other, at least one");
  for (std::size_t i = 0; i < x_.size(); ++i)
    if (!std::isfinite(x_[i]) || !std::isfinite(y_[i]) || (i > 0 && !(x_[i] > x_[i - 1])))
      throw fem::Error(std::string(name) + ": row " + std::to_string(i + 1) + " is not finite or its abscissa does not increase");

  const std::size_t n = x_.size();
  slope_.assign(n, 0.0);
  if (n < 2) return;
  const auto width = [this](std::size_t i) { return x_[i + 1] - x_[i]; };
  const auto secant = [&](std::size_t i) { return (y_[i + 1] - y_[i]) / width(i); };
  for (std::size_t i = 1; i + 1 < n; ++i) {
    const double left = secant(i - 1);
    const double right = secant(i);
    if (left * right <= 0.0) continue;
    const double a = 2 * width(i) + width(i - 1);
    const double b = width(i) + 2 * width(i - 1);
    slope_[i] = (a + b) / (a / left + b / right);
  }
  // Secants at the ends: monotone with any inner slopes that are.
  slope_[0] = secant(0);
  slope_[n - 1] = secant(n - 2);
}

double MonotoneCubic::operator()(double x) const noexcept {
  if (!(x > x_.front())) return y_.front();
  if (!(x < x_.back())) return y_.back();
  std::size_t i = 0;
  while (x >= x_[i + 1]) ++i;
  const double h = x_[i + 1] - x_[i];
  const double s = (x - x_[i]) / h;
  const double r = 1 - s;
  return y_[i] * r * r * (1 + 2 * s) + y_[i + 1] * s * s * (3 - 2 * s) + h * s * r * (slope_[i] * r - slope_[i + 1] * s);
}

}  // namespace trocar::sim_plant
