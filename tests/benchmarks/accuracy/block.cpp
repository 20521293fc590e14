#include "tests/benchmarks/accuracy/block.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace trocar::bench {

double density_integral_n(double from_m, double to_m, double tip_depth_m) {
  const double in_zone = std::max(0.0, to_m - std::max(from_m, tip_depth_m - tip_zone_m));
  return shaft_n_per_m * (to_m - from_m) + (tip_n_per_m - shaft_n_per_m) * in_zone;
}

fem::Point Path::at(double depth_m) const { return {entry_x_m + depth_m * std::sin(angle_rad), depth_m * std::cos(angle_rad), 0.0}; }

std::array<double, 2> Path::tangent() const { return {std::sin(angle_rad), std::cos(angle_rad)}; }

std::vector<Path> paths() {
  const double degree = std::numbers::pi / 180.0;
  return {{"on_grid_line", 0.0, 0.0},
          {"off_grid_line", 0.0031, 0.0},
          {"oblique_15", -0.0057, 15.0 * degree},
          {"oblique_30", -0.0119, 30.0 * degree}};
}

fem::Tissue block_tissue() {
  fem::Tissue tissue;
  tissue.model = fem::Model::PlaneStress;
  tissue.thickness_m = 0.011;
  tissue.zones = {{.material = {25.3e3, 0.48}}};
  tissue.supports = {{fem::Side::YMax, {true, true, false}}};
  return tissue;
}

scene::Scene block_scene(fem::Type element, int nodes_per_side, const Path& path) {
  scene::Scene scene;
  scene.tissue = block_tissue();
  scene.tissue.grid = fem::uniform_grid(element, {-0.5 * side_m, 0.0, 0.0}, {side_m, side_m, 0.0}, {nodes_per_side, nodes_per_side, 1});
  scene.needle = scene::Needle{.length_m = needle_length_m};
  scene.contact = contact::Law{.shaft_n_per_m = shaft_n_per_m, .tip_n_per_m = tip_n_per_m, .tip_zone_m = tip_zone_m};
  const fem::Point from = path.at(0.0), to = path.at(0.05);
  scene.corridor = scene::Corridor{{from[0], from[1]}, {to[0], to[1]}, 0.5 * side_m / (nodes_per_side - 1)};
  return scene;
}

std::vector<fem::Point> visible_points() {
  constexpr double pitch_m = 0.005;
  std::vector<fem::Point> places;
  for (int j = 0; j < 20; ++j)
    for (int i = 0; i <= 20; ++i) places.push_back({pitch_m * (i - 10), pitch_m * j, 0.0});
  return places;
}

double distance_to_shaft_m(const Path& path, double depth_m, const fem::Point& x) {
  const fem::Point entry = path.at(0.0);
  const auto [tx, ty] = path.tangent();
  const fem::Point nearest = path.at(std::clamp((x[0] - entry[0]) * tx + (x[1] - entry[1]) * ty, 0.0, depth_m));
  return std::hypot(x[0] - nearest[0], x[1] - nearest[1]);
}

Eigen::VectorXd displacement_at(const fem::Locator& locator, const Eigen::VectorXd& u_m, const std::vector<fem::Point>& places) {
  Eigen::VectorXd u = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(places.size()));
  for (std::size_t p = 0; p < places.size(); ++p) {
    const std::optional<fem::Embedding> at = locator.locate(places[p]);
    if (!at) throw std::logic_error("a visible point lies outside of the mesh");
    for (int k = 0; k < at->count; ++k)
      u.segment<2>(2 * static_cast<Eigen::Index>(p)) +=
          at->weight[static_cast<std::size_t>(k)] * u_m.segment<2>(2 * at->node[static_cast<std::size_t>(k)]);
  }
  return u;
}

}  // namespace trocar::bench
