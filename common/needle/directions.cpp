#include "common/needle/directions.hpp"

#include <cmath>

namespace trocar::needle {
namespace {

constexpr double largest_rad = 1e5;
constexpr double two_over_pi = 0.63661977236758134308;
// pi/2 = high + low; high has 33 bits, so that its product with a quadrant below 2^20 is exact.
constexpr double high = 0x1.921fb544p+0;
constexpr double low = 0x1.0b4611a626331p-34;
constexpr double to_integer = 0x1.8p52;  // added and taken away, it rounds to the nearest integer

constexpr double inverse_factorial(int n) { return n == 0 ? 1.0 : inverse_factorial(n - 1) / n; }

}  // namespace

void directions(const double* __restrict angle_rad, double* __restrict cosine, double* __restrict sine, std::size_t count) noexcept {
  double largest = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double size = std::abs(angle_rad[i]);
    largest = size <= largest ? largest : size;  // what is no number gets through
  }
  if (!(largest < largest_rad)) {
    for (std::size_t i = 0; i < count; ++i) {
      cosine[i] = std::cos(angle_rad[i]);
      sine[i] = std::sin(angle_rad[i]);
    }
    return;
  }
  constexpr double s3 = -inverse_factorial(3), s5 = inverse_factorial(5), s7 = -inverse_factorial(7), s9 = inverse_factorial(9),
                   s11 = -inverse_factorial(11), s13 = inverse_factorial(13), s15 = -inverse_factorial(15);
  constexpr double c4 = inverse_factorial(4), c6 = -inverse_factorial(6), c8 = inverse_factorial(8), c10 = -inverse_factorial(10),
                   c12 = inverse_factorial(12), c14 = -inverse_factorial(14), c16 = inverse_factorial(16);
  for (std::size_t i = 0; i < count; ++i) {
    const double quadrant = (angle_rad[i] * two_over_pi + to_integer) - to_integer;
    const double r = (angle_rad[i] - quadrant * high) - quadrant * low;
    const double q = r * r;
    const double s = r + r * q * (s3 + q * (s5 + q * (s7 + q * (s9 + q * (s11 + q * (s13 + q * s15))))));
    const double c = 1.0 - 0.5 * q + q * q * (c4 + q * (c6 + q * (c8 + q * (c10 + q * (c12 + q * (c14 + q * c16))))));
    // quadrant mod 4 as 0, 1, 2, -1: by arithmetic, because a branch would not run in vectors.
    const double quarter = quadrant - 4.0 * ((0.25 * quadrant + to_integer) - to_integer);
    const double odd = quarter * quarter == 1.0 ? 1.0 : 0.0;
    const double turned_c = odd * s + (1.0 - odd) * c;
    const double turned_s = odd * c + (1.0 - odd) * s;
    // (0, 1, +-2, -1): cos +, -, -, +; sin +, +, -, -
    cosine[i] = quarter == 1.0 || quarter * quarter == 4.0 ? -turned_c : turned_c;
    sine[i] = quarter == -1.0 || quarter * quarter == 4.0 ? -turned_s : turned_s;
  }
}

}  // namespace trocar::needle
