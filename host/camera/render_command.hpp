// `trocar camera render`: synthetic frames of a marked phantom, with the truth beside them. A new folder, whole or not at all:
//   frame_NNNNNN.png   Bayer: its pattern in one channel
//   truth.csv          frame,t_s,row,col,u_px,v_px,x_m,y_m,visible      common/optics/render.hpp says what truth is
//   pose.toml          rotation_rad, translation_m of the phantom's plane in the camera's frame
//   render.toml        what was asked for
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>

#include "common/optics/marker_grid.hpp"
#include "common/optics/synthetic_motion.hpp"

namespace trocar::camera {

struct RenderOptions {
  std::string camera{"thesis"};  // name, or path
  std::filesystem::path out{};
  optics::MarkerGrid grid{};
  optics::SyntheticMotion motion{};
  optics::Appearance appearance{};
  std::string setting{"clean"}, motion_name{"still"};  // for render.toml
  int frames{1};
  double rate_hz{30.0};
  double m_per_px{optics::thesis_m_per_px};
  double tilt_rad{};  // of the camera about the image's horizontal axis
  std::uint64_t seed{1};
};

// Exit code. Throws config::UserError; then nothing was written.
int run_render(const RenderOptions& options, const std::atomic<bool>& stop);

}  // namespace trocar::camera
