// `trocar camera register`: marks on the tool as tracked, and the rig's capture of the same motion, in; registration.toml out:
//   [registration] date, camera, rms_px, used, outliers, outside, delay_s, delay_deviation_s
//   [rig_plane]    rotation_rad, translation_m (optics/plane.hpp), rotation_deviation_rad, translation_deviation_m
//   [[mark]]       row, col, x_m, y_m, x_deviation_m, y_deviation_m          place in the tool, x along the needle
//   [phantom]      x_m, y_m, height_m, angle_rad, tilt_rad                   with --phantom; host/camera/registration.hpp
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <vector>

namespace trocar::camera {

struct RegisterOptions {
  std::filesystem::path camera{};
  std::filesystem::path marks{};    // CSV of `trocar track`, or t_s,u_px,v_px of one mark
  std::filesystem::path capture{};  // MCAP
  std::filesystem::path phantom{};  // TOML with rotation_rad and translation_m of the phantom's plane; or none
  std::filesystem::path out{};
  std::vector<double> mark_m{};  // x and y of each mark in the tool, in the order of their rows and columns; empty: to be found
  double delay_s{};
  bool known_delay{};
  bool json{};
};

// Exit code. Throws config::UserError; then nothing was written.
int run_register(const RegisterOptions& options);

}  // namespace trocar::camera
