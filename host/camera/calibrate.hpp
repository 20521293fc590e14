// Lens and poses from views of one chessboard, by OpenCV's calibration (Zhang's closed form, then least squares over all corners).
#pragma once

#include <string>
#include <vector>

#include "common/optics/camera_file.hpp"
#include "host/camera/corners.hpp"

namespace trocar::camera {

struct View {
  std::string file{};
  Corners corners{};  // or their problem: then the view is left out under it
};

struct FitOptions {
  bool fixed_aspect{};      // fx = fy
  int radial_terms{3};      // k1 to k3; 0 to 3
  bool tangential{true};    // p1, p2
  bool without_outliers{};  // leave them out and fit again, until there are none
};

struct Residual {
  optics::Pixel at{};       // the corner as found
  double du_px{}, dv_px{};  // found minus fitted
  bool outlier{};           // its view is one
};

struct Fit {
  optics::Camera camera{};            // with its calibration; date is the caller's
  std::vector<Residual> residuals{};  // of the views that were used
};

// An outlier's RMS is above this many times the median of all views'. Noise alone moves a view of 54 corners by some 7 %.
inline constexpr double outlier_factor = 3.0;
[[nodiscard]] double median_rms_px(const optics::Calibration& calibration);  // of the views that were used
// Fewer do not determine a lens of nine numbers.
inline constexpr std::size_t least_views = 3;

// Standard deviations are those of least squares: noise of the residuals (2 numbers a corner, less the parameters fitted) through the
// normal matrix. They hold where residuals are noise, and say nothing about a bent board.
//
// Frames that were mirrored or half turned after they were taken. A chessboard looks the same in a mirror, so no single view shows it: the
// view then belongs to the mirrored camera. It is told from the rest by the lens (axis off the centre, tangential terms): a view that fits
// much better after its corners are mirrored or turned back within the frame is left out by that name, the worst first, and the rest is
// fitted again. Most frames must be right: when all are turned, or half of them, nothing tells which. When the lens has its axis in the
// centre it cannot be told, and makes no difference.
//
// Throws config::UserError: fewer than three usable views (with what is wrong with the others), views that do not determine the lens.
[[nodiscard]] Fit calibrate(const std::vector<View>& views, int width_px, int height_px, const Board& board, const FitOptions& options);

}  // namespace trocar::camera
