// The tissue and the paths that accuracy is measured on: 100 x 100 x 11 mm, plane stress, held at its far side; a needle that enters at
// y = 0 and goes in straight or obliquely, undeformed.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "common/fem/mesh.hpp"
#include "common/scene/scene.hpp"

namespace trocar::bench {

inline constexpr double side_m = 0.1;
inline constexpr double needle_length_m = 0.06;
inline constexpr double shaft_n_per_m = 34.0, tip_n_per_m = 68.0, tip_zone_m = 0.0025;

// What the shaft between two depths carries at most while it cuts, its tip at tip_depth_m.
[[nodiscard]] double density_integral_n(double from_m, double to_m, double tip_depth_m);

struct Path {
  std::string name{};
  double entry_x_m{};
  double angle_rad{};  // from +y towards +x

  [[nodiscard]] fem::Point at(double depth_m) const;
  [[nodiscard]] std::array<double, 2> tangent() const;
};

// No path starts on a grid line of any mesh but the first, which runs on one of them all.
[[nodiscard]] std::vector<Path> paths();

[[nodiscard]] fem::Tissue block_tissue();  // without a grid
[[nodiscard]] scene::Scene block_scene(fem::Type element, int nodes_per_side, const Path& path);

// Places that somebody sees: a lattice of 5 mm, none on the held side.
[[nodiscard]] std::vector<fem::Point> visible_points();
[[nodiscard]] double distance_to_shaft_m(const Path& path, double depth_m, const fem::Point& x);

// 2 rows a place: displacement interpolated from all nodes.
[[nodiscard]] Eigen::VectorXd displacement_at(const fem::Locator& locator, const Eigen::VectorXd& u_m,
                                              const std::vector<fem::Point>& places);

}  // namespace trocar::bench
