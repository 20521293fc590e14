#include "common/contact/density.hpp"

#include <algorithm>

namespace trocar::contact {

void Density::open(const Law& law) noexcept {
  if (law.velocity.rows == 0) {
    rows_ = 1;
    speed_[0] = 0.0;
    shaft_.value[0] = law.shaft_n_per_m;
    tip_.value[0] = law.tip_n_per_m;
  } else {
    rows_ = std::min<std::size_t>(law.velocity.rows, capacity::velocity_law_rows);
    speed_ = law.velocity.speed_m_s;
    shaft_.value = law.velocity.shaft_n_per_m;
    tip_.value = law.velocity.tip_n_per_m;
  }
  fit(shaft_);
  fit(tip_);
}

void Density::fit(Curve& curve) const noexcept {
  curve.slope = {};
  if (rows_ < 2) return;
  const auto width = [this](std::size_t i) { return speed_[i + 1] - speed_[i]; };
  const auto secant = [&](std::size_t i) { return (curve.value[i + 1] - curve.value[i]) / width(i); };
  for (std::size_t i = 1; i + 1 < rows_; ++i) {
    const double left = secant(i - 1);
    const double right = secant(i);
    if (left * right <= 0.0) continue;
    const double a = 2 * width(i) + width(i - 1);
    const double b = width(i) + 2 * width(i - 1);
    curve.slope[i] = (a + b) / (a / left + b / right);
  }
  // Secants at the ends: monotone with any inner slopes that are.
  curve.slope[0] = secant(0);
  curve.slope[rows_ - 1] = secant(rows_ - 2);
}

double Density::at(const Curve& curve, double speed_m_s) const noexcept {
  const std::size_t last = rows_ - 1;
  if (!(speed_m_s > speed_[0])) return curve.value[0];
  if (!(speed_m_s < speed_[last])) return curve.value[last];
  std::size_t i = 0;
  while (i + 2 < rows_ && speed_m_s >= speed_[i + 1]) ++i;
  const double h = speed_[i + 1] - speed_[i];
  const double s = (speed_m_s - speed_[i]) / h;
  const double r = 1 - s;
  return curve.value[i] * r * r * (1 + 2 * s) + curve.value[i + 1] * s * s * (3 - 2 * s) +
         h * s * r * (curve.slope[i] * r - curve.slope[i + 1] * s);
}

double Density::shaft_n_per_m(double speed_m_s) const noexcept { return at(shaft_, speed_m_s); }
double Density::tip_n_per_m(double speed_m_s) const noexcept { return at(tip_, speed_m_s); }

}  // namespace trocar::contact
