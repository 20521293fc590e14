// camera.toml: a camera's image size and lens, and the calibration that they come from.
//   [image]  width_px, height_px
//   [lens]   fx_px, fy_px, cx_px, cy_px, distortion = [k1, k2, p1, p2, k3]      model and frames in lens.hpp
//   [calibration]                                    absent when the numbers come from elsewhere
//            date                                    ISO 8601, UTC
//            rms_px                                  root mean square distance of all corners used
//            fixed_aspect                            fx = fy was imposed
//            board = [columns, rows]                 inner corners
//            square_m
//            standard_deviation = { fx_px, fy_px, cx_px, cy_px, distortion = [..] }     0 for what was not fitted
//   [[calibration.view]]
//            file
//            rms_px, rotation_rad, translation_m     board to camera: x_camera = exp([rotation]x) x_board + translation; z of the board
//            away
//                                                    from the camera
//            outlier                                 true or absent
//            left_out                                why the view was not used; instead of the numbers, or beside them
// Reading throws config::UserError with file, line, key, value and remedy.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "common/optics/lens.hpp"

namespace trocar::optics {

struct BoardPose {
  double rms_px{};
  std::array<double, 3> rotation_rad{};  // axis times angle
  std::array<double, 3> translation_m{};
};

struct CalibratedView {
  std::string file{};
  std::optional<BoardPose> pose{};
  bool outlier{};
  std::string left_out{};  // the reason; empty for a view that was used
};

struct Calibration {
  std::string date{};
  double rms_px{};
  bool fixed_aspect{};
  int columns{}, rows{};
  double square_m{};
  Lens standard_deviation{};
  std::vector<CalibratedView> views{};
};

struct Camera {
  int width_px{}, height_px{};
  Lens lens{};
  std::optional<Calibration> calibration{};
};

[[nodiscard]] Camera read_camera(const std::filesystem::path& file);
void write_camera(std::ostream& stream, const Camera& camera);  // what read_camera takes, to the last bit

}  // namespace trocar::optics
