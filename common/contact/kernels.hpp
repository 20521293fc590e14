// The loops in which the contact solver spends its time, on columns of doubles. They stand apart because they alone are compiled with
// products and sums contracted (rounded once, where the processor can): one copy of each, so that the same inputs give the same bits.
#pragma once

#include <cstddef>

namespace trocar::contact::kernel {

// y[begin, end) -= x_0 a_0 + x_1 a_1 + … over `count` columns a_l that lie `stride` apart; rounded up to a multiple of 4 rows.
void subtract(double* y, std::size_t begin, std::size_t end, const double* a, std::size_t stride, const double* x,
              std::size_t count) noexcept;

// x_r = v_x xx_r + v_y yx_r, y_r = v_x xy_r + v_y yy_r, n_r = tx_r y_r - ty_r x_r for r < rows, a multiple of 4: the products of the
// direction v with the columns of one contact, and their parts along every other contact's normal.
struct Products {
  double *x, *y, *n;
};
void project(const Products& to, std::size_t rows, double v_x, double v_y, const double* x_column, const double* y_column, std::size_t half,
             const double* tx, const double* ty) noexcept;

// The largest magnitude among n numbers; n is rounded up to a multiple of 4.
[[nodiscard]] double largest(const double* x, std::size_t n) noexcept;

// How far x is a multiple of another vector: x = share other + rest. n is rounded up to a multiple of 4.
struct Proportion {
  double share;          // x . other / other . other
  double rest, largest;  // largest components of the rest and of x
};
[[nodiscard]] Proportion proportion(const double* x, const double* other, std::size_t n) noexcept;

}  // namespace trocar::contact::kernel
