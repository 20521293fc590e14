#include "host/solve/loads.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/config/csv.hpp"

namespace trocar::host {
namespace {

std::string in_words(const fem::Point& x, int dimension) {
  return dimension == 2 ? fmt::format("({}, {}) m", x[0], x[1]) : fmt::format("({}, {}, {}) m", x[0], x[1], x[2]);
}

}  // namespace

Loads read_loads(const std::filesystem::path& file, const fem::Mesh& mesh) {
  const auto d = static_cast<std::size_t>(mesh.dimension());
  constexpr std::string_view planar = "x_m,y_m,fx_n,fy_n";
  constexpr std::string_view solid = "x_m,y_m,z_m,fx_n,fy_n,fz_n";
  const config::Csv csv = d == 2 ? config::Csv::load(file, {planar}) : config::Csv::load(file, {solid});

  const fem::Box bounds = fem::bounding_box(mesh);
  double size = 1.0;
  for (std::size_t a = 0; a < 3; ++a) size = std::max(size, bounds.max_m[a] - bounds.min_m[a]);
  const fem::Locator locator(mesh);
  Loads loads;
  loads.rows = csv.rows();
  loads.force_n = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size() * d));
  std::vector<bool> loaded(mesh.node.size(), false);
  for (std::size_t row = 0; row < csv.rows(); ++row) {
    fem::Point x{};
    for (std::size_t a = 0; a < d; ++a) x[a] = csv(row, a);
    const auto node = static_cast<std::size_t>(locator.nearest_node(x));
    const fem::Point& at = mesh.node[node];
    if (const double distance = std::hypot(at[0] - x[0], at[1] - x[1], at[2] - x[2]); distance > 1e-9 * size)
      csv.fail(row, fmt::format("{} is not a node; the nearest is node {} at {}, {:.3g} m away: write its coordinates",
                                in_words(x, mesh.dimension()), node, in_words(at, mesh.dimension()), distance));
    for (std::size_t a = 0; a < d; ++a) loads.force_n[static_cast<Eigen::Index>(node * d + a)] += csv(row, d + a);
    loaded[node] = true;
  }
  loads.nodes = static_cast<std::size_t>(std::count(loaded.begin(), loaded.end(), true));
  return loads;
}

}  // namespace trocar::host
