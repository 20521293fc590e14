// A simulated camera over a marked phantom, as a plant file tells it, [camera]:
//   name = "thesis_half", rate_hz, setting = "clean" | "hard", exposure_s, read_noise, m_per_px, rows, columns, spacing_m, diameter_m
// Who renders its frames reads it (sim_plant/camera), and who tracks them (trocar demo).
#pragma once

#include <string>

#include "common/config/document.hpp"
#include "common/optics/marker_grid.hpp"
#include "common/optics/render.hpp"

namespace trocar::optics {

struct SimulatedCamera {
  std::string name{};  // of a camera in share/cameras, or a path
  double rate_hz{};
  Appearance appearance{};
  MarkerGrid grid{};
  double m_per_px{};
};
[[nodiscard]] SimulatedCamera read_simulated_camera(const config::Table& table);  // throws config::UserError

}  // namespace trocar::optics
