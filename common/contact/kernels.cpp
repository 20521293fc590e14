#include "common/contact/kernels.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace trocar::contact::kernel {
namespace {

using Four = double __attribute__((vector_size(4 * sizeof(double))));

Four load(const double* from) noexcept {
  Four v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
void store(double* to, const Four& v) noexcept { std::memcpy(to, &v, sizeof v); }

void keep_larger(Four& most, const Four& v) noexcept {
  most = most > v ? most : v;
  most = most > -v ? most : -v;
}
double largest_of(const Four& v) noexcept { return std::max(std::max(v[0], v[1]), std::max(v[2], v[3])); }

// 4 * `fours` rows. The sums stay in registers, two of them, so that products need not wait for each other.
template <std::size_t fours>
void subtract_rows(double* y, const double* a, std::size_t stride, const double* x, std::size_t count) noexcept {
  std::array<Four, fours> even{}, odd{};
  for (std::size_t k = 0; k < count / 4; ++k, x += 4, a += 4 * stride)
    for (std::size_t r = 0; r < fours; ++r) {
      even[r] += x[0] * load(a + 4 * r);
      odd[r] += x[1] * load(a + stride + 4 * r);
      even[r] += x[2] * load(a + 2 * stride + 4 * r);
      odd[r] += x[3] * load(a + 3 * stride + 4 * r);
    }
  for (std::size_t k = 0; k < count % 4; ++k, ++x, a += stride)
    for (std::size_t r = 0; r < fours; ++r) even[r] += x[0] * load(a + 4 * r);
  for (std::size_t r = 0; r < fours; ++r) store(y + 4 * r, load(y + 4 * r) - (even[r] + odd[r]));
}

}  // namespace

void subtract(double* y, std::size_t begin, std::size_t end, const double* a, std::size_t stride, const double* x,
              std::size_t count) noexcept {
  std::size_t r = begin;
  for (; r + 12 < end; r += 16) subtract_rows<4>(y + r, a + r, stride, x, count);
  for (; r + 4 < end; r += 8) subtract_rows<2>(y + r, a + r, stride, x, count);
  if (r < end) subtract_rows<1>(y + r, a + r, stride, x, count);
}

void project(const Products& to, std::size_t rows, double v_x, double v_y, const double* x_column, const double* y_column, std::size_t half,
             const double* tx, const double* ty) noexcept {
  for (std::size_t r = 0; r < rows; r += 4) {
    const Four x = v_x * load(x_column + r) + v_y * load(y_column + r);
    const Four y = v_x * load(x_column + half + r) + v_y * load(y_column + half + r);
    store(to.x + r, x);
    store(to.y + r, y);
    store(to.n + r, load(tx + r) * y - load(ty + r) * x);
  }
}

double largest(const double* x, std::size_t n) noexcept {
  Four most{};
  for (std::size_t k = 0; k < n; k += 4) keep_larger(most, load(x + k));
  return largest_of(most);
}

Proportion proportion(const double* x, const double* other, std::size_t n) noexcept {
  Four both{}, own{};
  for (std::size_t k = 0; k < n; k += 4) {
    const Four b = load(other + k);
    both += load(x + k) * b;
    own += b * b;
  }
  const double share = ((both[0] + both[1]) + (both[2] + both[3])) / ((own[0] + own[1]) + (own[2] + own[3]));
  Four rest{}, most{};
  for (std::size_t k = 0; k < n; k += 4) {
    const Four a = load(x + k);
    keep_larger(rest, a - share * load(other + k));
    keep_larger(most, a);
  }
  return {share, largest_of(rest), largest_of(most)};
}

}  // namespace trocar::contact::kernel
