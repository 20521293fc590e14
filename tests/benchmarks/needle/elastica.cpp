#include "tests/benchmarks/needle/elastica.hpp"

#include <cmath>
#include <numbers>

namespace trocar::bench {
namespace {

double first(double p, double phi) { return std::comp_ellint_1(p) - std::ellint_1(p, phi); }
double second(double p, double phi) { return std::comp_ellint_2(p) - std::ellint_2(p, phi); }
double modulus(double tip_rad) { return std::sqrt(0.5 * (1.0 + std::sin(tip_rad))); }
double start(double p) { return std::asin(std::fmin(1.0, 1.0 / (p * std::numbers::sqrt2))); }

}  // namespace

ElasticaTip elastica(double load) {
  const double wanted = std::sqrt(load);
  double low = 0.0;
  double high = 0.5 * std::numbers::pi - 1e-12;
  for (int k = 0; k < 100; ++k) {
    const double middle = 0.5 * (low + high);
    const double p = modulus(middle);
    (first(p, start(p)) < wanted ? low : high) = middle;
  }
  const double tip = 0.5 * (low + high);
  const double p = modulus(tip);
  return {std::sqrt(2.0 * std::sin(tip)) / wanted, 1.0 - 2.0 * second(p, start(p)) / wanted, tip};
}

}  // namespace trocar::bench
