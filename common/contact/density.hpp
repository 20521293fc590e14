// Friction per length of shaft, and at the cutting tip, over the base's speed along the shaft: a monotone cubic through the law's
// rows (Fritsch and Carlson, SIAM J. Numer. Anal. 17, 1980: slopes at the points are the weighted harmonic means of the neighbouring
// secants, zero where those change sign), constant beyond its ends. Without a velocity law the two constants of the scene.
#pragma once

#include <array>
#include <cstddef>

#include "common/core/capacities.hpp"
#include "common/model/law.hpp"

namespace trocar::contact {

class Density {
 public:
  // The law's rows increase in speed (the scene reader and the image reader see to it).
  void open(const Law& law) noexcept;
  [[nodiscard]] double shaft_n_per_m(double speed_m_s) const noexcept;
  [[nodiscard]] double tip_n_per_m(double speed_m_s) const noexcept;
  // Without a velocity law speed changes nothing.
  [[nodiscard]] bool depends_on_speed() const noexcept { return rows_ > 1; }

 private:
  using Values = std::array<double, capacity::velocity_law_rows>;
  struct Curve {
    Values value{};
    Values slope{};
  };
  void fit(Curve& curve) const noexcept;
  [[nodiscard]] double at(const Curve& curve, double speed_m_s) const noexcept;

  std::size_t rows_{0};
  Values speed_{};
  Curve shaft_{}, tip_{};
};

}  // namespace trocar::contact
