// Synthetic images of a marked phantom, as a rolling-shutter camera sees it.
//   level(u, v) = base(colour) light(u, v) [shadow] [dots] + noise, rounded to 8 bits
//   dot      darkens by density * C, C = Phi(-(|P - c| - r) s / sigma): P the pixel's place in the plane (exact lens and perspective),
//            c centre, r radius, s px per metre there, sigma^2 = spread_px^2 + 1/12 (a pixel's own width); a curved edge taken as straight
//   hole     a specular reflection: a smaller disc of white within the dot
//   shadow   of the needle, through the translucent slab: darkens by shadow_depth within shadow_width_m of its line, with soft edges
//   blur     mean over the exposure: the dot at evenly spaced times, at most half a pixel of motion apart (the shadow is not blurred)
//   rolling  row v is exposed about time_ns + (v - (height - 1) / 2) line_s: a dot is seen where it is while its rows are exposed
//   noise    standard deviation sqrt(read^2 + shot * level), grey levels; from a fixed table, entered anew in each row
// Truth is the image of the dot's centre, at the middle of the exposure of the row that it falls on; the blob's centroid is moved off it by
// perspective and lens, a hundredth of a pixel at the border of the thesis's image.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/optics/camera_file.hpp"
#include "common/optics/frame.hpp"
#include "common/optics/marker_grid.hpp"
#include "common/optics/plane.hpp"

namespace trocar::optics {

struct Appearance {
  PixelFormat format{PixelFormat::Mono8};
  double diameter_spread{};  // dots' diameters differ by up to this part of it, either way
  double density_spread{};   // their darkness is less by up to this part
  double edge_wave{};        // and their radius waves by this part of it, three to five times about
  double hole_part{};        // of the dots have a hole
  double light_fall{};       // light lost in the corners, of that in the middle; and a third of it across the image
  double shadow_depth{};     // light that the needle takes; 0: none is seen
  double shadow_width_m{0.0015};
  double spread_px{0.7};  // of a point by lens and sensor, standard deviation
  double exposure_s{0.0006};
  double line_s{};  // from a row's exposure to the next one's; 0: all at once
  double read_noise{};
  double shot_noise{};
};
// As the thesis's camera in good light (3.3: 0.6 ms of exposure); and everything at once that makes tracking hard: dots of differing size
// and darkness, a hole in every fifth, uneven light, the needle's shadow, a rolling shutter, noise, and an exposure of 18 ms, in which 9
// mm/s are two pixels.
[[nodiscard]] Appearance clean_appearance() noexcept;
[[nodiscard]] Appearance hard_appearance() noexcept;

struct MarkerState {  // at a frame's time, phantom frame
  PlanePoint at{};
  double vx_m_s{}, vy_m_s{};
};

struct MarkerTruth {
  Pixel pixel{};
  PlanePoint at{};
  bool visible{};  // whole, within the image
};

// Straight down on the middle of the grid: `m_per_px` of the phantom a pixel at the image's centre; x right, y up.
[[nodiscard]] Pose looking_down(const Camera& camera, const MarkerGrid& grid, double m_per_px) noexcept;
inline constexpr double thesis_m_per_px = 7.9e-5;  // of its full image (3.2)

class Renderer {
 public:
  // What differs from dot to dot, and all noise, comes from the seed. Keeps some 20 bytes a pixel. Throws std::invalid_argument for an
  // appearance out of range, or a plane that the camera does not see wholly within its lens's fold.
  Renderer(const Camera& camera, const Pose& plane, const MarkerGrid& grid, const Appearance& appearance, std::uint64_t seed);

  // `markers` in the grid's order; `needle` a line of points in the plane, from where it enters to its tip, or empty. Equal input to equal
  // renderers gives equal bytes; noise follows `number`.
  void render(std::span<const MarkerState> markers, std::span<const PlanePoint> needle, std::uint64_t number, std::int64_t time_ns,
              Frame& frame);
  // Of the last frame, in the grid's order.
  [[nodiscard]] std::span<const MarkerTruth> truth() const noexcept { return truth_; }
  [[nodiscard]] const PlaneView& view() const noexcept { return view_; }

 private:
  struct Dot {
    double radius_m{}, darkness{};
    double wave{}, wave_phase{};
    int waves{};
    double hole_x_m{}, hole_y_m{}, hole_radius_m{};  // radius 0: none
  };
  void draw_dot(const Dot& dot, const MarkerState& state, MarkerTruth& truth) noexcept;
  void draw_shadow(std::span<const PlanePoint> needle) noexcept;
  void expose(std::uint64_t number, Frame& frame) const noexcept;
  [[nodiscard]] double row_delay_s(double v_px) const noexcept;

  Camera camera_;
  PlaneView view_;
  MarkerGrid grid_;
  Appearance appearance_;
  std::vector<Dot> dots_{};
  std::vector<float> plane_x_{}, plane_y_{};  // of each pixel
  std::vector<float> base_{}, level_{};       // of each sample of a pixel: without anything on it, and of this frame
  std::vector<float> noise_{};                // standard normal
  std::vector<MarkerTruth> truth_{};
};

}  // namespace trocar::optics
