// Cosine and sine of many angles at once, so that the compiler works in whole vectors: a tick of a bent needle wants 150 of them.
//   Quadrant by rounding, remainder from pi/2 in two parts (Cody and Waite 1980), Taylor series up to pi/4. Within 2e-16 of the exact value
//   for |angle| < 1e5; beyond, and for what is no number, the library's.
#pragma once

#include <cstddef>

namespace trocar::needle {

// `count` angles in rad; the results must not overlap them.
void directions(const double* angle_rad, double* cosine, double* sine, std::size_t count) noexcept;

}  // namespace trocar::needle
