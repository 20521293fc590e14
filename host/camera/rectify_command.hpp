// `trocar camera rectify`: images or points as a camera without distortion, and the same fx, fy, cx, cy, would see them.
#pragma once

#include <atomic>
#include <filesystem>
#include <vector>

namespace trocar::camera {

struct RectifyOptions {
  std::filesystem::path camera{};               // camera.toml
  std::vector<std::filesystem::path> images{};  // or `points`
  std::filesystem::path points{};               // CSV u_px,v_px
  // Images: a new folder, with NAME.png for each; whole or not at all. Points: a CSV u_px,v_px,iterations,status, a row for each, in order;
  // status as in common/optics, and nan for what is not ok.
  std::filesystem::path out{};
  bool fixed_point{};  // the inverse for points: fixed point instead of Newton
  bool distort{};      // points the other way: from the rectified image to the camera's
  bool json{};
};

// Exit code. Throws config::UserError; then nothing was written.
int run_rectify(const RectifyOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::camera
