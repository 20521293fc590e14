#include "sim_plant/phantom/phantom.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "common/fem/statics.hpp"

namespace trocar::sim_plant {
namespace {

constexpr double speed_filter_s = 0.020;
// A with 5000 unknowns takes 200 MB; finer tissue needs columns for a corridor only.
constexpr int most_unknowns = 5000;

void require(bool holds, const std::string& message) {
  if (!holds) throw fem::Error(message);
}

MonotoneCubic law(const ContactConfig& contact, const std::vector<double> VelocityLaw::*column, double constant) {
  if (!contact.velocity_law) return {"contact", {0.0}, {constant}};
  return {contact.velocity_law->name.c_str(), contact.velocity_law->speed_m_s, (*contact.velocity_law).*column};
}

const PhantomConfig& checked(const PhantomConfig& config) {
  const ContactConfig& c = config.contact;
  require(config.needle.length_m > 0.0 && std::isfinite(config.needle.length_m), "needle: length_m must be positive, such as 0.1");
  require(c.tip_zone_m >= 0.0 && std::isfinite(c.tip_zone_m), "contact: tip_zone_m must not be negative");
  require(c.shaft_n_per_m >= 0.0 && std::isfinite(c.shaft_n_per_m), "contact: shaft_n_per_m must not be negative");
  require(c.tip_n_per_m >= c.shaft_n_per_m && std::isfinite(c.tip_n_per_m), "contact: tip_n_per_m must be at least shaft_n_per_m");
  if (c.velocity_law) {
    const VelocityLaw& v = *c.velocity_law;
    require(v.speed_m_s.size() == v.shaft_n_per_m.size() && v.speed_m_s.size() == v.tip_n_per_m.size(),
            "velocity law " + v.name + ": speed_m_s, shaft_n_per_m and tip_n_per_m must have the same length");
    for (std::size_t i = 0; i < v.speed_m_s.size(); ++i)
      require(v.shaft_n_per_m[i] >= 0.0 && v.tip_n_per_m[i] >= v.shaft_n_per_m[i],
              "velocity law " + v.name + ": densities must not be negative, and the tip's at least the shaft's (row " +
                  std::to_string(i + 1) + ")");
  }
  const PlaneGrid grid = plane_grid(config.tissue);
  const int unknowns = 2 * grid.nodes[0] * grid.nodes[1];
  require(unknowns <= most_unknowns, "tissue: " + std::to_string(unknowns) +
                                         " unknowns; this phantom stores the whole compliance, so at most " +
                                         std::to_string(most_unknowns) + " (50 x 50 nodes)");
  return config;
}

// Contacts closer than the mesh is fine would make their compliance nearly singular.
double edge_length(const PlaneGrid& grid) { return std::max(grid.size_m[0] / (grid.nodes[0] - 1), grid.size_m[1] / (grid.nodes[1] - 1)); }

std::size_t contact_capacity(const PhantomConfig& config) {
  const PlaneGrid grid = plane_grid(config.tissue);
  const double longest = std::min(2.0 * config.needle.length_m, std::hypot(grid.size_m[0], grid.size_m[1]));
  return static_cast<std::size_t>(longest / edge_length(grid)) + 3;
}

double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1]; }
Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1]}; }
Point along(const Point& from, const Point& direction, double distance) {
  return {from[0] + distance * direction[0], from[1] + distance * direction[1]};
}
Point interpolate(const Embedding& at, const std::array<Point, 4>& nodes) {
  Point u{};
  for (std::size_t p = 0; p < static_cast<std::size_t>(at.count); ++p) u = along(u, nodes[p], at.weight[p]);
  return u;
}
double overlap(double a0, double a1, double b0, double b1) { return std::max(0.0, std::min(a1, b1) - std::max(a0, b0)); }

}  // namespace

Phantom::Phantom(const PhantomConfig& config)
    : config_(checked(config)),
      shaft_law_(law(config.contact, &VelocityLaw::shaft_n_per_m, config.contact.shaft_n_per_m)),
      tip_law_(law(config.contact, &VelocityLaw::tip_n_per_m, config.contact.tip_n_per_m)),
      grid_(plane_grid(config_.tissue)),
      spacing_m_(edge_length(grid_)),
      problem_(contact_capacity(config)),
      place_(problem_.capacity()),
      input_(problem_.capacity()),
      row_(problem_.capacity()),
      tip_coupling_(problem_.capacity()) {
  const fem::Mesh mesh = fem::make_mesh(config_.tissue);
  const fem::Statics statics(mesh, config_.tissue);
  const Eigen::Index rows = statics.degrees_of_freedom();
  rows_ = static_cast<std::size_t>(rows);
  compliance_.resize(rows_ * rows_);
  Eigen::SparseMatrix<double> unit_loads(rows, rows);
  unit_loads.setIdentity();
  statics.solve_columns(unit_loads, 64, [&](Eigen::Index first, const Eigen::Ref<const Eigen::MatrixXd>& u) {
    for (Eigen::Index c = 0; c < u.cols(); ++c)
      std::copy(u.col(c).begin(), u.col(c).end(), compliance_.begin() + static_cast<std::ptrdiff_t>((first + c) * rows));
  });
  shaft_n_per_m_ = shaft_law_(0.0);
  tip_n_per_m_ = tip_law_(0.0);
}

double Phantom::path_m() const noexcept { return contacts() == 0 ? 0.0 : place_[contacts() - 1].path + beyond_last(); }

// Displacement at a per unit force at b.
Block Phantom::coupling(const Embedding& a, const Embedding& b) const noexcept {
  Block block{};
  for (std::size_t p = 0; p < static_cast<std::size_t>(a.count); ++p)
    for (std::size_t q = 0; q < static_cast<std::size_t>(b.count); ++q) {
      const double weight = a.weight[p] * b.weight[q];
      const std::size_t i = 2 * static_cast<std::size_t>(a.node[p]);
      const double* const first = &compliance_[2 * static_cast<std::size_t>(b.node[q]) * rows_ + i];
      const double* const second = first + rows_;
      block[0] += weight * first[0];
      block[1] += weight * second[0];
      block[2] += weight * first[1];
      block[3] += weight * second[1];
    }
  return block;
}

// Of the nodes that `at` names, by the present contact forces.
std::array<Point, 4> Phantom::node_displacements(const Embedding& at) noexcept {
  if (at.element != tip_element_) tip_coupled_ = 0;
  tip_element_ = at.element;
  tip_coupled_ = std::min(tip_coupled_, contacts());
  Embedding node;
  node.count = 1;
  node.weight[0] = 1.0;
  for (; tip_coupled_ < contacts(); ++tip_coupled_)
    for (std::size_t p = 0; p < static_cast<std::size_t>(at.count); ++p) {
      node.node[0] = at.node[p];
      tip_coupling_[tip_coupled_][p] = coupling(node, place_[tip_coupled_].embedding);
    }
  std::array<Point, 4> u{};
  for (std::size_t j = 0; j < contacts(); ++j) {
    const ContactForce& f = problem_.contact(j);
    const double fx = axis_[0] * f.axial_n - axis_[1] * f.lateral_n;
    const double fy = axis_[1] * f.axial_n + axis_[0] * f.lateral_n;
    for (std::size_t p = 0; p < 4; ++p) {
      const Block& block = tip_coupling_[j][p];
      u[p][0] += block[0] * fx + block[1] * fy;
      u[p][1] += block[2] * fx + block[3] * fy;
    }
  }
  return u;
}

// From a point in the tissue to its boundary; 0 from outside.
double Phantom::exit_distance(const Point& from, const Point& direction) const noexcept {
  const PlaneGrid& grid = grid_;
  double distance = std::numeric_limits<double>::max();
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (direction[axis] == 0.0) continue;
    const double wall = direction[axis] > 0.0 ? grid.origin_m[axis] + grid.size_m[axis] : grid.origin_m[axis];
    distance = std::min(distance, (wall - from[axis]) / direction[axis]);
  }
  return std::max(0.0, distance);
}

double Phantom::beyond_last() const noexcept {
  const Place& last = place_[contacts() - 1];
  return std::clamp(tip_beyond_m_, 0.0, exit_distance(last.material, last.direction));
}

void Phantom::add_contact(const Point& material, const Point& direction, double path) noexcept {
  const std::size_t i = contacts();
  const Embedding embedding = locate(grid_, material);
  const Point u = interpolate(embedding, node_displacements(embedding));
  place_[i] = {material, direction, path, dot(axis_, minus({material[0] + u[0], material[1] + u[1]}, base_)), embedding};
  for (std::size_t j = 0; j <= i; ++j) row_[j] = coupling(embedding, place_[j].embedding);
  problem_.push({row_.data(), i + 1});
}

// The tip is in the tissue and nothing holds it yet: the path begins where the shaft crosses the boundary.
void Phantom::enter() noexcept {
  const Point tip = along(base_, axis_, config_.needle.length_m);
  const double depth = std::min(exit_distance(tip, {-axis_[0], -axis_[1]}), config_.needle.length_m);
  tip_material_ = tip;
  tip_beyond_m_ = depth;
  deepest_m_ = 0.0;
  add_contact(along(tip, axis_, -depth), axis_, 0.0);
}

void Phantom::solve_contacts() noexcept {
  const std::size_t n = contacts();
  const double tip_path = path_m();
  const double excess = std::max(0.0, tip_n_per_m_ - shaft_n_per_m_);
  const double zone_begins = deepest_m_ - config_.contact.tip_zone_m;
  for (std::size_t i = 0; i < n; ++i) {
    const Place& p = place_[i];
    const double ends = i + 1 < n ? place_[i + 1].path : tip_path;
    const double threshold = shaft_n_per_m_ * (ends - p.path);
    const Point from_base = minus(p.material, base_);
    input_[i] = {p.arclength - dot(axis_, from_base), axis_[1] * from_base[0] - axis_[0] * from_base[1], 0.0, -threshold,
                 threshold + excess * overlap(p.path, ends, zone_begins, tip_path)};
  }
  const double length = std::clamp((tip_path - place_[n - 1].path) / spacing_m_, 1e-4, 1.0);
  input_[n - 1].softness = problem_.self_compliance(n - 1) * (1.0 / length - 1.0);

  const ContactSolution solution = problem_.solve(axis_[0], axis_[1], {input_.data(), n});
  counters_.pivots += static_cast<std::uint64_t>(solution.pivots);
  counters_.factorisations += static_cast<std::uint64_t>(solution.factorisations);
  counters_.unconverged += solution.converged ? 0u : 1u;
  residual_n_ = solution.residual_n;
  for (std::size_t i = 0; i < n; ++i) place_[i].arclength -= problem_.contact(i).slip_m;
}

// Newton on X + u(X) = tip from the last X, with the gradient of the element in which X lies.
void Phantom::find_tip() noexcept {
  constexpr int most_iterations = 30;
  constexpr double tolerance_m = 1e-12;
  const Point tip = along(base_, axis_, config_.needle.length_m);
  std::array<Point, 4> nodes{};
  int element = -1;
  for (int k = 0; k < most_iterations; ++k) {
    const Embedding at = locate(grid_, tip_material_);
    if (at.element != element) nodes = node_displacements(at);
    element = at.element;
    const Point rest = minus(minus(tip, tip_material_), interpolate(at, nodes));
    if (std::abs(rest[0]) + std::abs(rest[1]) < tolerance_m) return;
    Block j{1.0, 0.0, 0.0, 1.0};
    for (std::size_t p = 0; p < static_cast<std::size_t>(at.count); ++p)
      for (std::size_t a = 0; a < 2; ++a)
        for (std::size_t b = 0; b < 2; ++b) j[2 * a + b] += nodes[p][a] * at.gradient[p][b];
    const double determinant = j[0] * j[3] - j[1] * j[2];
    // Tissue that linear elasticity has turned inside out has no meaningful gradient.
    const bool usable = determinant > 0.05;
    const Point step =
        usable ? Point{(j[3] * rest[0] - j[1] * rest[1]) / determinant, (j[0] * rest[1] - j[2] * rest[0]) / determinant} : rest;
    const double length = std::hypot(step[0], step[1]);
    tip_material_ = along(tip_material_, step, length > spacing_m_ ? spacing_m_ / length : 1.0);
  }
  // Tissue torn out of all proportion by a jump of the base: the tip counts as where it is in space, and what it left is dropped.
  tip_material_ = tip;
  ++counters_.unconverged;
}

void Phantom::follow_tip() noexcept {
  const auto measure = [this] {
    const Place& last = place_[contacts() - 1];
    tip_beyond_m_ = dot(last.direction, minus(tip_material_, last.material));
  };
  measure();
  while (tip_beyond_m_ >= spacing_m_) {
    if (contacts() == problem_.capacity()) {
      ++counters_.full;
      break;
    }
    const Place& last = place_[contacts() - 1];
    const Point next = along(last.material, minus(tip_material_, last.material), spacing_m_ / tip_beyond_m_);
    if (!inside(grid_, next)) break;
    const Point step = minus(next, last.material);
    const double length = std::hypot(step[0], step[1]);
    add_contact(next, {step[0] / length, step[1] / length}, last.path + spacing_m_);
    measure();
  }
  while (contacts() > 0 && tip_beyond_m_ <= 0.0) {
    problem_.pop();
    if (contacts() > 0) measure();
  }
  if (contacts() == 0)
    deepest_m_ = 0.0;
  else
    deepest_m_ = std::max(deepest_m_, path_m());
}

Phantom::Vector3 Phantom::advance(const Vector3& base_pose, double dt_s) noexcept {
  ++counters_.steps;
  if (!std::isfinite(base_pose[0]) || !std::isfinite(base_pose[1]) || !std::isfinite(base_pose[2]) || !(dt_s > 0.0) ||
      !std::isfinite(dt_s)) {
    ++counters_.refused;
    return wrench_;
  }
  const Point base{base_pose[0], base_pose[1]};
  axis_ = {std::cos(base_pose[2]), std::sin(base_pose[2])};
  if (started_) {
    const double speed = dot(axis_, minus(base, base_)) / dt_s;
    speed_m_s_ += (speed - speed_m_s_) * dt_s / (speed_filter_s + dt_s);
    shaft_n_per_m_ = shaft_law_(std::abs(speed_m_s_));
    tip_n_per_m_ = tip_law_(std::abs(speed_m_s_));
  }
  started_ = true;
  base_ = base;

  if (contacts() == 0) {
    const Point tip = along(base_, axis_, config_.needle.length_m);
    tip_material_ = tip;
    wrench_ = {};
    residual_n_ = 0.0;
    if (!inside(grid_, tip)) return wrench_;
    enter();
  }
  solve_contacts();
  find_tip();
  follow_tip();

  wrench_ = {};
  for (std::size_t i = 0; i < contacts(); ++i) {
    const ContactForce& f = problem_.contact(i);
    wrench_[0] += axis_[0] * f.axial_n - axis_[1] * f.lateral_n;
    wrench_[1] += axis_[1] * f.axial_n + axis_[0] * f.lateral_n;
    wrench_[2] += place_[i].arclength * f.lateral_n + f.lateral_gap_m * f.axial_n;
  }
  return wrench_;
}

}  // namespace trocar::sim_plant
