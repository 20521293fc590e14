#include "common/optics/simulated_camera.hpp"

#include <algorithm>

namespace trocar::optics {

SimulatedCamera read_simulated_camera(const config::Table& table) {
  SimulatedCamera c;
  c.name = table.text("name", "of a camera in share/cameras, such as \"thesis_half\"");
  c.rate_hz = table.number("rate_hz", {0.1, 1000.0}, "frames a second, such as 15");
  c.appearance = table.one_of("setting", {"clean", "hard"}) == "hard" ? hard_appearance() : clean_appearance();
  c.appearance.shadow_depth = std::max(c.appearance.shadow_depth, 0.3);
  c.appearance.exposure_s = table.number("exposure_s", {0.0, 1.0}, "such as 0.0006, as in the thesis");
  c.appearance.read_noise = table.number("read_noise", {0.0, 50.0}, "grey levels, such as 1.2");
  c.m_per_px = table.number("m_per_px", {1e-7, 0.1}, "of the phantom a pixel, such as 1.58e-4");
  c.grid.rows = static_cast<int>(table.integer("rows", 2, 200, "markers along y, such as 21"));
  c.grid.columns = static_cast<int>(table.integer("columns", 2, 200, "markers along x, such as 21"));
  c.grid.spacing_m = table.number("spacing_m", {1e-5, 1.0}, "such as 0.005");
  c.grid.diameter_m = table.number("diameter_m", {1e-6, 1.0}, "such as 0.0018");
  return c;
}

}  // namespace trocar::optics
