// Where one dark dot is, to a fraction of a pixel, near a place where it is expected. Two methods.
//
// Correlation (DiMaio 2003, section 3.3): grey levels, holes filled by a morphological opening (the closing of the dark dots), normalised
// cross-correlation of a neighbourhood of 41 x 41 px with a binary disc, cubic through the coefficients along each axis, re-centred until
// the peak is in the middle.
//   ncc = (S_d - (n_d / n) S) / sqrt((Q - S^2 / n) n_d (1 - n_d / n))     S, Q sums of levels and squares under the template of n pixels,
//                                                                       S_d sum under its disc of n_d: row by row from running sums
//   covariance: (1 - ncc^2) / (n ncc |ncc''|) per axis, what white noise of the remaining variance would cause
//
// Edge (ours): rays from the centre; on each the place e where the level passes from that inside to that outside, by the sum of
// (I_out - I) / (I_out - I_in) along it, which noise, blur and uneven light leave in place. A ray on which half of the step is passed
// elsewhere than at e has something on it, such as a hole, and is left out. An outline through the e by least squares with Tukey's
// biweight, so that holes, a shadow's edge and dirt count for nothing:
//   e(a) = r + dx cos a + dy sin a + p cos 2a + q sin 2a
//   p, q: oval by lens, perspective and strain; drawn towards 0 as far as the rays do not say
//   covariance: s^2 (J^T W J)^-1, s^2 from the weighted residuals: noise, and dots that are not oval. What moves a dot's
//   image as a whole (its centroid against its centre, by lens and perspective: 0.01 px in the thesis's geometry) is not in it
#pragma once

#include <array>
#include <vector>

#include "host/tracking/window.hpp"

namespace trocar::tracking {

enum class Method { Correlation, Edge };

struct Located {
  bool found{};
  double u_px{}, v_px{};
  double radius_px{};
  double score{};                      // 0 … 1: correlation coefficient, or the part of the rays that agree
  std::array<double, 3> covariance{};  // uu, uv, vv; px^2
};

inline constexpr double least_correlation = 0.6;
inline constexpr double least_rays = 0.5;
inline constexpr float least_contrast = 12.0F;  // grey levels between dot and slab

// Work space of one thread.
struct Scratch {
  Window window{};
  std::vector<float> sums{}, squares{}, coefficients{};
  std::vector<unsigned char> bytes{}, opened{};
  std::vector<float> edge{}, weight{}, residual{}, sorted{};
};

// Binary disc of `radius_px` in a square of odd width 2 margin + 1, margin = ceil(radius) + 3.
class Disc {
 public:
  explicit Disc(double radius_px);
  [[nodiscard]] double radius_px() const noexcept { return radius_; }
  [[nodiscard]] int width() const noexcept { return width_; }
  [[nodiscard]] int pixels() const noexcept { return pixels_; }
  [[nodiscard]] int reach(int row) const noexcept { return reach_[static_cast<std::size_t>(row)]; }  // half the run of a row, -1: none

 private:
  double radius_{};
  int width_{}, pixels_{};
  std::vector<int> reach_{};
};

// Coefficients of all places of the template within the image of `width` x `height` complemented levels, row by row:
// (width - disc.width() + 1) x (height - disc.width() + 1).
void correlate(const std::vector<float>& darkness, int width, int height, const Disc& disc, std::vector<float>& sums,
               std::vector<float>& squares, std::vector<float>& coefficients);

// Extreme of the cubic through four equally spaced values about the greatest, y[1] or y[2], from y[1] on; within (-1, 2).
[[nodiscard]] double cubic_peak(const std::array<double, 4>& y) noexcept;

struct Place {
  double u_px{}, v_px{};
};

// `neighbourhood_px`: side of the search, odd; grows by itself where the disc would not fit in with a few places to spare.
[[nodiscard]] Located locate_by_correlation(const optics::Frame& frame, const Gains& gains, const Place& start, const Disc& disc,
                                            int neighbourhood_px, Scratch& scratch);

// Finds a dot of a radius of 3.5 px or more whose centre is within some 8 px, or 0.7 of the radius, of the start.
[[nodiscard]] Located locate_by_edge(const optics::Frame& frame, const Gains& gains, const Place& start, double radius_px,
                                     Scratch& scratch);

}  // namespace trocar::tracking
