#include "sim_plant/camera/camera.hpp"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "common/config/share.hpp"
#include "common/config/user_error.hpp"

namespace trocar::sim_plant {

Surface::Surface(const Phantom& phantom, const scene::Scene& scene, const optics::MarkerGrid& grid) : grid_(grid) {
  const auto refuse = [&](const std::string& why) {
    throw config::UserError(fmt::format("{}: {}; leave the camera away (--no-camera)", scene.file.string(), why));
  };
  const model::Tissue& tissue = phantom.tissue();
  if (tissue.model == element::Model::Solid) refuse("the simulated camera sees planar tissue only");
  const auto entry = scene::entry_m(scene);
  // The corner of least x and y: the entry is the middle of the side y_min.
  origin_ = {entry[0] - 0.5 * (grid.columns - 1) * grid.spacing_m, entry[1]};
  const contact::Geometry& geometry = phantom.insertion().working_set().geometry();
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      const optics::PlanePoint p = grid.at_rest(row, column);
      const contact::Vector2 x{origin_[0] + p.x_m, origin_[1] + p.y_m};
      // A marker on the border may lie outside by a rounding.
      std::int32_t cell = geometry.locate(x, -1);
      constexpr double hair = 1e-9;
      for (const double dx : {-hair, hair})
        for (const double dy : {-hair, hair})
          if (cell < 0) cell = geometry.locate({x[0] + dx, x[1] + dy}, -1);
      if (cell < 0) refuse(fmt::format("marker ({}, {}) lies outside of the tissue that the needle can reach", row, column));
      at_.push_back(geometry.point(cell, x));
    }
  }
  force_.assign(tissue.unknowns(), 0.0);
  seen_.assign(tissue.node_m.size(), false);
}

void Surface::take(const Phantom& phantom, std::int64_t time_ns, const std::array<double, 3>& base_pose, SurfaceState& state) {
  state.time_ns = time_ns;
  state.base_pose = base_pose;
  state.marker.resize(at_.size());
  const contact::WorkingSet& set = phantom.insertion().working_set();
  for (const std::uint32_t node : loaded_) {
    force_[2 * node] = force_[2 * node + 1] = 0.0;
    seen_[node] = false;
  }
  loaded_.clear();
  for (std::size_t i = 0; i < set.size(); ++i) {
    const contact::Embedding& at = set.point(i).at;
    const contact::Vector2& f = set.solver().contact(i).force_n;
    for (std::uint32_t k = 0; k < at.count; ++k) {
      const std::uint32_t node = at.node[k];
      if (!seen_[node]) loaded_.push_back(node);
      seen_[node] = true;
      force_[2 * node] += at.weight[k] * f[0];
      force_[2 * node + 1] += at.weight[k] * f[1];
    }
  }
  const model::Tissue& tissue = phantom.tissue();
  const std::size_t n = tissue.unknowns();
  const auto row_times_force = [&](std::size_t row) {
    double u = 0.0;
    for (const std::uint32_t node : loaded_)
      for (std::size_t c = 2 * node; c < 2 * std::size_t{node} + 2; ++c)
        u += (tissue.compliance64.empty() ? static_cast<double>(tissue.compliance32[row * n + c]) : tissue.compliance64[row * n + c]) *
             force_[c];
    return u;
  };
  for (int row = 0; row < grid_.rows; ++row) {
    for (int column = 0; column < grid_.columns; ++column) {
      const std::size_t m = grid_.index(row, column);
      optics::PlanePoint p = grid_.at_rest(row, column);
      for (std::uint32_t k = 0; k < at_[m].count; ++k) {
        const std::size_t node = at_[m].node[k];
        if (at_[m].weight[k] == 0.0) continue;  // on a node of the mesh
        p.x_m += at_[m].weight[k] * row_times_force(2 * node);
        p.y_m += at_[m].weight[k] * row_times_force(2 * node + 1);
      }
      state.marker[m] = p;
    }
  }
}

namespace {

optics::Renderer make_renderer(const optics::SimulatedCamera& config, std::uint64_t seed) {
  const auto file = config::find_share("cameras", config.name);
  const optics::Camera camera = optics::read_camera(file);
  try {
    return {camera, optics::looking_down(camera, config.grid, config.m_per_px), config.grid, config.appearance, seed};
  } catch (const std::invalid_argument& e) {
    throw config::UserError(fmt::format("{}: {}; take another camera, or another m_per_px", file.string(), e.what()));
  }
}

}  // namespace

Camera::Camera(const optics::SimulatedCamera& config, const std::array<double, 2>& origin_m, double needle_length_m, std::uint64_t seed)
    : grid_(config.grid), origin_(origin_m), length_m_(needle_length_m), renderer_(make_renderer(config, seed)) {}

void Camera::render(const SurfaceState& state, std::uint64_t number, optics::Frame& frame) {
  const double dt_s = before_.empty() ? 0.0 : 1e-9 * static_cast<double>(state.time_ns - before_ns_);
  states_.resize(state.marker.size());
  for (std::size_t k = 0; k < states_.size(); ++k) {
    states_[k] = {state.marker[k], 0.0, 0.0};
    if (!(dt_s > 0.0)) continue;
    states_[k].vx_m_s = (state.marker[k].x_m - before_[k].x_m) / dt_s;
    states_[k].vy_m_s = (state.marker[k].y_m - before_[k].y_m) / dt_s;
  }
  before_ = state.marker;
  before_ns_ = state.time_ns;
  const double theta = state.base_pose[2];
  const optics::PlanePoint base{state.base_pose[0] - origin_[0], state.base_pose[1] - origin_[1]};
  const std::array<optics::PlanePoint, 2> needle{base, {base.x_m + length_m_ * std::cos(theta), base.y_m + length_m_ * std::sin(theta)}};
  const bool known = std::isfinite(base.x_m) && std::isfinite(base.y_m) && std::isfinite(theta);
  renderer_.render(states_, known ? std::span<const optics::PlanePoint>(needle) : std::span<const optics::PlanePoint>(), number,
                   state.time_ns, frame);
}

}  // namespace trocar::sim_plant
