#include "common/condense/candidates.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <string>
#include <thread>

#include "common/condense/corridor.hpp"
#include "common/condense/spread.hpp"
#include "common/core/capacities.hpp"
#include "common/fem/statics.hpp"

namespace trocar::condense {
namespace {

using model::Cell;
using model::Vector2;

constexpr double touching_m = 1e-9;

std::string text(double v) { return std::to_string(v); }

// A planar mesh of all the tissue in the needle's plane; candidates are chosen from it.
struct Plane {
  std::vector<Vector2> node_m{};
  std::vector<Cell> cell{};
};

std::vector<Vector2> polygon(const Plane& plane, const Cell& cell) {
  std::vector<Vector2> corner;
  for (std::size_t k = 0; k < cell.count; ++k) corner.push_back(plane.node_m[cell.node[k]]);
  return corner;
}

Plane planar_mesh(const fem::Mesh& mesh, const scene::Scene& scene) {
  Plane plane;
  for (const fem::Point& x : mesh.node) plane.node_m.push_back({x[0], x[1]});
  const std::vector<int> zone = fem::zones_of(mesh, scene.tissue.zones);
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    Cell cell{};
    cell.count = static_cast<std::uint16_t>(mesh.nodes_per_element());
    cell.material = static_cast<std::uint16_t>(zone[e]);
    for (std::size_t k = 0; k < cell.count; ++k) cell.node[k] = static_cast<std::uint32_t>(mesh.element[e][k]);
    plane.cell.push_back(cell);
  }
  return plane;
}

double mean_edge_m(const fem::Mesh& mesh) {
  double sum = 0.0;
  std::size_t count = 0;
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    const auto corner = mesh.corners(e);
    const int nodes = mesh.nodes_per_element();
    for (int a = 0; a < nodes; ++a)
      for (int b = a + 1; b < nodes; ++b) {
        // Bricks: only pairs that share an edge.
        if (nodes == 8 && !((a / 4 == b / 4 && (b - a == 1 || b - a == 3)) || b - a == 4)) continue;
        sum += (corner.col(a) - corner.col(b)).norm();
        ++count;
      }
  }
  return sum / static_cast<double>(count);
}

// Quads of a grid of lines in the plane, where they lie in the tissue. Nodes that no quad uses are dropped later.
Plane plane_through(const fem::Mesh& mesh, const scene::Scene& scene, const fem::Locator& locator, double z_m) {
  std::array<std::vector<double>, 2> line;
  const fem::Box bounds = fem::bounding_box(mesh);
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (scene.tissue.grid) {
      line[axis] = scene.tissue.grid->axis_m[axis];
      continue;
    }
    const double extent = bounds.max_m[axis] - bounds.min_m[axis];
    const int steps = std::max(1, static_cast<int>(std::lround(extent / mean_edge_m(mesh))));
    for (int i = 0; i < steps; ++i) line[axis].push_back(bounds.min_m[axis] + extent * i / steps);
    line[axis].push_back(bounds.max_m[axis]);
  }
  const std::vector<int> zone = fem::zones_of(mesh, scene.tissue.zones);
  Plane plane;
  const std::size_t nx = line[0].size();
  for (const double y : line[1])
    for (const double x : line[0]) plane.node_m.push_back({x, y});
  std::vector<bool> inside;
  for (const Vector2& x : plane.node_m) inside.push_back(locator.locate({x[0], x[1], z_m}).has_value());
  for (std::size_t j = 0; j + 1 < line[1].size(); ++j)
    for (std::size_t i = 0; i + 1 < nx; ++i) {
      const std::size_t n = j * nx + i;
      if (!inside[n] || !inside[n + 1] || !inside[n + nx] || !inside[n + nx + 1]) continue;
      const auto centre = locator.locate({0.5 * (line[0][i] + line[0][i + 1]), 0.5 * (line[1][j] + line[1][j + 1]), z_m});
      if (!centre) continue;
      Cell cell{};
      cell.count = 4;
      cell.material = static_cast<std::uint16_t>(zone[static_cast<std::size_t>(centre->element)]);
      const auto index = static_cast<std::uint32_t>(n);
      const auto row = static_cast<std::uint32_t>(nx);
      cell.node = {index, index + 1, index + 1 + row, index + row};
      plane.cell.push_back(cell);
    }
  return plane;
}

struct Chosen {
  std::vector<bool> in_corridor{}, candidate{};  // of each cell of the plane
};

Chosen choose(const Plane& plane, const scene::Scene& scene, const Lists& ring, bool solid) {
  Chosen chosen;
  chosen.in_corridor.assign(plane.cell.size(), true);
  if (scene.corridor) {
    // A solid's cell has to reach into the corridor; one that merely borders on it brings nodes that lie outside.
    const double reach = scene.corridor->half_width_m + (solid ? -touching_m : touching_m);
    for (std::size_t c = 0; c < plane.cell.size(); ++c)
      chosen.in_corridor[c] = distance_m(*scene.corridor, polygon(plane, plane.cell[c])) <= reach;
  }
  chosen.candidate = chosen.in_corridor;
  if (!solid)
    for (std::size_t c = 0; c < plane.cell.size(); ++c)
      for (std::size_t k = 0; chosen.in_corridor[c] && k < plane.cell[c].count; ++k)
        for (const std::uint32_t other : ring[plane.cell[c].node[k]]) chosen.candidate[other] = true;
  if (std::find(chosen.candidate.begin(), chosen.candidate.end(), true) == chosen.candidate.end())
    throw fem::Error("the corridor holds no part of the tissue; move contact.corridor into the tissue or widen it");
  return chosen;
}

// One column a candidate degree of freedom, with `dimension` rows a node of the mesh.
Eigen::SparseMatrix<double> load_matrix(const fem::Mesh& mesh, const std::vector<std::vector<NodeWeight>>& weights) {
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t n = 0; n < weights.size(); ++n)
    for (const NodeWeight& w : weights[n])
      for (int axis = 0; axis < 2; ++axis) entries.emplace_back(mesh.dimension() * w.node + axis, static_cast<int>(2 * n) + axis, w.weight);
  Eigen::SparseMatrix<double> load(static_cast<Eigen::Index>(mesh.node.size()) * mesh.dimension(),
                                   static_cast<Eigen::Index>(2 * weights.size()));
  load.setFromTriplets(entries.begin(), entries.end());
  return load;
}

double needle_radius_m(const scene::Scene& scene) {
  if (!scene.needle || !scene.needle->outer_m)
    throw fem::Error(
        "the needle's diameter is missing: in a solid its force is spread over its cross-section; give needle.outer_m or needle.gauge");
  return 0.5 * *scene.needle->outer_m;
}

std::vector<std::vector<NodeWeight>> spread(const fem::Mesh& mesh, const fem::Locator& locator, const std::vector<Vector2>& node_m,
                                            double z_m, double radius_m) {
  // The shortest edge of the element around each point decides how fine its rule is.
  std::vector<int> order(node_m.size());
  std::map<int, BallRule> rules;
  for (std::size_t n = 0; n < node_m.size(); ++n) {
    const auto at = locator.locate({node_m[n][0], node_m[n][1], z_m});
    const auto corner = mesh.corners(static_cast<std::size_t>(at->element));
    double edge = (corner.col(0) - corner.col(1)).norm();
    for (int a = 0; a < mesh.nodes_per_element(); ++a)
      for (int b = 0; b < a; ++b) edge = std::min(edge, (corner.col(a) - corner.col(b)).norm());
    order[n] = ball_order(radius_m, edge);
    if (!rules.contains(order[n])) rules.emplace(order[n], ball_rule(order[n]));
  }
  std::vector<std::vector<NodeWeight>> weights(node_m.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t n = next++; n < node_m.size(); n = next++)
      weights[n] = ball_weights(locator, {node_m[n][0], node_m[n][1], z_m}, radius_m, rules.at(order[n]));
  };
  std::vector<std::thread> threads;
  for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();
  return weights;
}

std::uint8_t fixed_flags(const std::vector<bool>& fixed, const std::vector<NodeWeight>& weights, int dimension) {
  std::uint8_t flags = 0;
  for (std::size_t axis = 0; axis < 2; ++axis)
    if (std::all_of(weights.begin(), weights.end(),
                    [&](const NodeWeight& w) { return w.weight == 0.0 || fixed[static_cast<std::size_t>(dimension * w.node) + axis]; }))
      flags = static_cast<std::uint8_t>(flags | (axis == 0 ? model::fixed_x : model::fixed_y));
  return flags;
}

}  // namespace

Candidates candidates_of(const fem::Mesh& mesh, const scene::Scene& scene) {
  const bool solid = mesh.dimension() == 3;
  const fem::Box bounds = fem::bounding_box(mesh);
  const double z_m = scene.plane_z_m.value_or(0.5 * (bounds.min_m[2] + bounds.max_m[2]));
  if (solid && !(z_m >= bounds.min_m[2] && z_m <= bounds.max_m[2]))
    throw fem::Error("contact.plane_z_m = " + text(z_m) + ": outside of the tissue, which reaches from " + text(bounds.min_m[2]) + " to " +
                     text(bounds.max_m[2]) + " m; move the plane");
  if (scene.tissue.zones.size() > 0xFFFF) throw fem::Error("more than 65535 materials; merge some of [[tissue.material]]");

  const double radius_m = solid ? needle_radius_m(scene) : 0.0;
  const fem::Locator locator(mesh);
  Plane plane = solid ? plane_through(mesh, scene, locator, z_m) : planar_mesh(mesh, scene);
  const Lists ring = rings_of(plane.cell, plane.node_m.size());
  join(plane.cell, ring);
  const Chosen chosen = choose(plane, scene, ring, solid);

  Candidates result;
  for (const fem::Zone& zone : scene.tissue.zones) result.material.push_back(zone.material);
  constexpr std::uint32_t none = 0xFFFFFFFF;
  std::vector<std::uint32_t> new_node(plane.node_m.size(), none);
  std::vector<std::int32_t> new_cell(plane.cell.size(), model::limit);
  for (std::size_t c = 0; c < plane.cell.size(); ++c) {
    if (!chosen.candidate[c]) continue;
    new_cell[c] = static_cast<std::int32_t>(result.cell.size());
    result.cell.push_back(plane.cell[c]);
    for (std::size_t k = 0; k < plane.cell[c].count; ++k) new_node[plane.cell[c].node[k]] = 0;
  }
  std::vector<std::size_t> old_node;
  for (std::size_t n = 0; n < new_node.size(); ++n) {
    if (new_node[n] == none) continue;
    new_node[n] = static_cast<std::uint32_t>(old_node.size());
    old_node.push_back(n);
    result.node_m.push_back(plane.node_m[n]);
  }
  for (Cell& cell : result.cell)
    for (std::size_t k = 0; k < 4; ++k) {
      cell.node[k] = k < cell.count ? new_node[cell.node[k]] : 0;
      cell.neighbour[k] = k >= cell.count || cell.neighbour[k] < 0 ? model::surface : new_cell[static_cast<std::size_t>(cell.neighbour[k])];
    }
  std::vector<Cell> in_corridor;
  for (std::size_t c = 0; c < plane.cell.size(); ++c)
    if (chosen.in_corridor[c]) in_corridor.push_back(plane.cell[c]);
  result.edge_length_m = mean_edge_length_m(plane.node_m, in_corridor);
  result.ring = rings_of(result.cell, result.node_m.size());
  result.buckets = buckets_of(result.node_m, result.cell);

  std::vector<std::vector<NodeWeight>> weights;
  if (solid) {
    weights = spread(mesh, locator, result.node_m, z_m, ball_per_needle_radius * radius_m);
  } else {
    for (const std::size_t n : old_node) weights.push_back({{static_cast<int>(n), 1.0}});
  }
  result.load = load_matrix(mesh, weights);

  const std::vector<bool> fixed = fem::supported_degrees_of_freedom(mesh, scene.tissue.supports);
  for (std::size_t n = 0; n < result.node_m.size(); ++n) {
    std::uint8_t flags = fixed_flags(fixed, weights[n], mesh.dimension());
    const std::size_t around = result.ring[n].size();
    if (around == ring[old_node[n]].size() && around <= capacity::ring_cells) flags = static_cast<std::uint8_t>(flags | model::whole_ring);
    result.flags.push_back(flags);
  }
  return result;
}

}  // namespace trocar::condense
