// The residuals of a calibration, drawn.
#pragma once

#include <ostream>

#include "host/camera/calibrate.hpp"

namespace trocar::camera {

// SVG: an arrow for each corner over the image plane (outlier views in another colour), and a histogram of both components beside the
// normal distribution of the same spread. By gnuplot; throws config::UserError when that is not installed or fails.
void draw_residuals(std::ostream& svg, const Fit& fit);

}  // namespace trocar::camera
