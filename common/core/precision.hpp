// Tolerances for the precision that the real-time side is compiled in.
// It is written in double throughout. For processors whose floating-point unit has single precision alone the same sources are compiled
// with float in the place of double, word by word (tests/targets/float32.cmake). What cannot follow by itself is a tolerance near the
// rounding of double: it is named here for both.
#pragma once

namespace trocar {

inline constexpr bool single_precision = sizeof(double) == sizeof(float);  // where this line reads float twice

[[nodiscard]] constexpr double tolerance(double float64, double float32) noexcept { return single_precision ? float32 : float64; }

}  // namespace trocar
