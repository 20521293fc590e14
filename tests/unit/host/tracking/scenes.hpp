// Synthetic frames for the tests of the tracker: a third of the thesis's image, or the whole.
#pragma once

#include <cmath>
#include <vector>

#include "common/optics/render.hpp"
#include "common/optics/synthetic_motion.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking::testing {

inline optics::Camera thesis_camera() {  // MODELS section 10
  return {2056, 1544, {1884.0, 1884.0, 1044.0, 737.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}}, {}};
}
inline optics::Camera small_camera() {  // the same lens, every third pixel
  return {686, 514, {628.0, 628.0, 348.0, 246.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}}, {}};
}
inline optics::MarkerGrid small_grid() { return {7, 9, 0.008, 0.0036}; }

class Film {
 public:
  Film(const optics::Camera& camera, const optics::MarkerGrid& grid, const optics::Appearance& appearance, optics::SyntheticMotion motion,
       double m_per_px, std::uint64_t seed = 1)
      : grid_(grid), motion_(motion), renderer_(camera, optics::looking_down(camera, grid, m_per_px), grid, appearance, seed) {}

  const optics::Frame& frame(int k, double rate_hz = 30.0) {
    const double t_s = k / rate_hz;
    renderer_.render(motion_.markers(grid_, t_s), motion_.needle(grid_, t_s), static_cast<std::uint64_t>(k), std::llround(1e9 * t_s),
                     frame_);
    return frame_;
  }
  [[nodiscard]] optics::Frame& last() { return frame_; }
  [[nodiscard]] std::span<const optics::MarkerTruth> truth() const { return renderer_.truth(); }
  [[nodiscard]] const optics::PlaneView& view() const { return renderer_.view(); }
  [[nodiscard]] const optics::MarkerGrid& grid() const { return grid_; }

  // A disc of one level over the image: a hand, dirt, a reflection.
  void cover(double u, double v, double radius, std::uint8_t level) {
    for (int y = 0; y < frame_.height_px; ++y)
      for (int x = 0; x < frame_.width_px; ++x)
        if (std::hypot(x - u, y - v) <= radius)
          frame_.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(frame_.width_px) + static_cast<std::size_t>(x)] = level;
  }

 private:
  optics::MarkerGrid grid_;
  optics::SyntheticMotion motion_;
  optics::Renderer renderer_;
  optics::Frame frame_{};
};

inline Film small_film(optics::MotionKind kind, optics::Appearance appearance = optics::clean_appearance()) {
  return {small_camera(), small_grid(), appearance, {kind, 0.008, 0.02}, 2.37e-4};
}

struct Errors {
  double rms_px{}, worst_px{};
  std::size_t seen{}, lost{}, wrong{};  // wrong: further off than a dot is wide
};
inline void add(Errors& e, std::span<const Marker> markers, std::span<const optics::MarkerTruth> truth, double radius_px) {
  double squares = e.rms_px * e.rms_px * static_cast<double>(e.seen);
  for (std::size_t k = 0; k < markers.size(); ++k) {
    if (!markers[k].valid) {
      ++e.lost;
      continue;
    }
    const double d = std::hypot(markers[k].u_px - truth[k].pixel.u_px, markers[k].v_px - truth[k].pixel.v_px);
    squares += d * d;
    e.worst_px = std::max(e.worst_px, d);
    if (d > radius_px) ++e.wrong;
    ++e.seen;
  }
  e.rms_px = e.seen > 0 ? std::sqrt(squares / static_cast<double>(e.seen)) : 0.0;
}

}  // namespace trocar::tracking::testing
