// A small phantom before a small camera, and a dot painted pixel by pixel, for the tests of this folder.
#pragma once

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "common/optics/render.hpp"
#include "common/optics/synthetic_motion.hpp"
#include "host/tracking/tracker.hpp"

namespace trocar::tracking {

inline optics::Camera small_camera() {  // the thesis's lens, a third as wide
  return {640, 640, {700.0, 700.0, 325.0, 312.0, {-0.268, 0.183, -0.00096, -0.00650, 0.0}}, {}};
}
inline optics::MarkerGrid small_grid() { return {9, 9, 0.005, 0.0018}; }
inline optics::Pose small_pose(double tilt_rad = 0.0) {
  optics::Pose pose = optics::looking_down(small_camera(), small_grid(), 8e-5);
  pose.rotation_rad[0] += tilt_rad;
  return pose;
}

inline double distance_px(const Marker& m, const optics::MarkerTruth& t) {
  return std::hypot(m.u_px - t.pixel.u_px, m.v_px - t.pixel.v_px);
}

// Independent of the renderer: a dark disc on bright ground, each pixel the mean of 8 x 8 samples, then a Gaussian of 0.7 px by direct sum.
struct Dot {
  int side_px{61};
  double u_px{30.0}, v_px{30.0}, radius_px{11.0};
  double bright{200.0}, dark{40.0};
  double slope{};                                        // of the light, levels a pixel along u
  double hole_u_px{}, hole_v_px{}, hole_radius_px{0.0};  // from the dot's centre; bright
  double shadow_from_px{1e9};                            // v from which on the light is `shade` of what it was
  double shade{0.6};
};
inline optics::Frame paint(const Dot& d, double noise = 0.0, unsigned seed = 1) {
  const auto n = static_cast<std::size_t>(d.side_px);
  std::vector<double> sharp(n * n), blurred(n * n);
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t u = 0; u < n; ++u) {
      double sum = 0.0;
      for (int j = 0; j < 8; ++j) {
        for (int i = 0; i < 8; ++i) {
          const double x = static_cast<double>(u) + (i - 3.5) / 8 - d.u_px, y = static_cast<double>(v) + (j - 3.5) / 8 - d.v_px;
          const bool hole = std::hypot(x - d.hole_u_px, y - d.hole_v_px) < d.hole_radius_px;
          const double level = std::hypot(x, y) < d.radius_px ? (hole ? 250.0 : d.dark) : d.bright + d.slope * x;
          sum += level * (y + d.v_px > d.shadow_from_px ? d.shade : 1.0);
        }
      }
      sharp[v * n + u] = sum / 64.0;
    }
  }
  optics::Frame frame{0, 0, d.side_px, d.side_px, optics::PixelFormat::Mono8, std::vector<std::uint8_t>(n * n)};
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  for (std::size_t v = 0; v < n; ++v) {
    for (std::size_t u = 0; u < n; ++u) {
      double sum = 0.0, weight = 0.0;
      for (std::ptrdiff_t j = -3; j <= 3; ++j) {
        for (std::ptrdiff_t i = -3; i <= 3; ++i) {
          const auto y = std::clamp(static_cast<std::ptrdiff_t>(v) + j, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(n) - 1);
          const auto x = std::clamp(static_cast<std::ptrdiff_t>(u) + i, std::ptrdiff_t{0}, static_cast<std::ptrdiff_t>(n) - 1);
          const double w = std::exp(-static_cast<double>(i * i + j * j) / (2 * 0.49));
          sum += w * sharp[static_cast<std::size_t>(y) * n + static_cast<std::size_t>(x)];
          weight += w;
        }
      }
      const double level = sum / weight + (noise > 0.0 ? noise * normal(random) : 0.0);
      frame.pixels[v * n + u] = static_cast<std::uint8_t>(std::clamp(std::lround(level), 0L, 255L));
    }
  }
  return frame;
}

}  // namespace trocar::tracking
