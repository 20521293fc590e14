#include "common/insertion/flexible.hpp"

#include <algorithm>
#include <cmath>

namespace trocar::insertion {

using contact::Block;
using contact::Vector2;

void Flexible::open(const model::Needle& needle) noexcept {
  static_cast<void>(beam_.open({.length_m = needle.length_m,
                                .bending_nm2 = needle.bending_nm2,
                                .axial_n = needle.axial_n,
                                .curvature_per_m = needle.curvature_per_m,
                                .elements = static_cast<std::size_t>(needle.elements)}));
}

bool Flexible::free(const needle::Pose& base) noexcept { return beam_.solve(base, {}).status == needle::Status::Ok; }

double Flexible::arclength_m(const Vector2& x_m, double near_m) const noexcept {
  constexpr int most_steps = 8;
  double s = near_m;
  for (int k = 0; k < most_steps; ++k) {
    const needle::Station at = beam_.at(s);
    const double step = (at.tangent[0] * (x_m[0] - at.position_m[0]) + at.tangent[1] * (x_m[1] - at.position_m[1])) / at.stretch;
    s += step;
    if (std::abs(step) < 1e-13) break;
  }
  return s;
}

void Flexible::place(const needle::Pose& base, const contact::WorkingSet& set) noexcept {
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vector2& f = set.solver().contact(i).force_n;
    load_[i].force_n = {-f[0], -f[1]};
  }
  static_cast<void>(beam_.place(base, {load_.data(), set.size()}));
}

// What is left between tissue and shaft.
double Flexible::gap_n(const contact::WorkingSet& set) const noexcept {
  double worst_n = 0.0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vector2 r = beam_.position_m(i);
    const Vector2 u = set.solver().displacement_m(i);
    const Vector2& x = set.point(i).material_m;
    const Block own = joined_.compliance(i, i);
    worst_n = std::max(worst_n, std::hypot(r[0] - x[0] - u[0], r[1] - x[1] - u[1]) / std::min(own[0], own[3]));
  }
  return worst_n;
}

Flexible::Outcome Flexible::solve(const needle::Pose& base, contact::WorkingSet& set, std::span<contact::Target> target) noexcept {
  const std::size_t n = set.size();
  contact::Solver& tissue = set.solver();
  Outcome outcome;
  beam_.keep();
  for (std::size_t i = 0; i < n; ++i) {
    before_[i] = tissue.contact(i);
    anchor_m_[i] = set.point(i).arclength_m;
    load_[i] = {.arclength_m = anchor_m_[i] - (before_[i].state == contact::State::Stuck ? 0.0 : before_[i].slip_m)};
  }
  place(base, set);
  while (outcome.iterations < max_iterations) {
    ++outcome.iterations;
    needle::Factor factor = beam_.linearise();
    if (factor.status == needle::Status::Ok && (factor.negative_pivots > 0 || factor.singular))
      factor = beam_.linearise(needle::Tangent::Convex);
    if (factor.status != needle::Status::Ok) break;
    joined_.clear();
    for (std::size_t i = 0; i < n; ++i) {
      const Vector2 p = beam_.position_m(i);
      const Vector2 c = beam_.correction_m(i);
      const double theta = beam_.theta_rad(i);
      const Vector2 t{std::cos(theta), std::sin(theta)};
      const double moved_m = anchor_m_[i] - load_[i].arclength_m;
      const Vector2& x = set.point(i).material_m;
      Vector2 gap{p[0] + c[0] + moved_m * t[0] - x[0], p[1] + c[1] + moved_m * t[1] - x[1]};
      for (std::size_t j = 0; j < n; ++j) {
        const Block& b = beam_.compliance(i, j);
        const Vector2& f = tissue.contact(j).force_n;
        gap[0] += b[0] * f[0] + b[1] * f[1];
        gap[1] += b[2] * f[0] + b[3] * f[1];
        if (j > i) continue;
        const Block g = tissue.compliance(i, j);
        for (std::size_t k = 0; k < 4; ++k) row_[j][k] = g[k] + b[k];
      }
      target[i].tangent = t;
      target[i].gap_m = gap;
      joined_.push({row_.data(), i + 1}, tissue.contact(i));
    }
    const contact::Solution solution = joined_.solve(target.first(n));
    outcome.pivots += solution.pivots;
    outcome.solves += solution.iterations;
    outcome.contacts = solution.status;
    if (solution.status == contact::SolverStatus::NotFinite) break;
    std::array<Vector2, capacity::contacts> on_needle;
    for (std::size_t i = 0; i < n; ++i) {
      contact_[i] = joined_.contact(i);
      on_needle[i] = {-contact_[i].force_n[0], -contact_[i].force_n[1]};
    }
    if (beam_.apply({on_needle.data(), n}).status != needle::Status::Ok) break;
    tissue.assume({contact_.data(), n});
    bool moved = false;
    for (std::size_t i = 0; i < n; ++i) {
      const double now = anchor_m_[i] - (contact_[i].state == contact::State::Stuck ? 0.0 : contact_[i].slip_m);
      moved = moved || now != load_[i].arclength_m;
      load_[i].arclength_m = now;
    }
    if (moved) place(base, set);
    outcome.residual_n = std::max(gap_n(set), solution.residual_n);
    if (outcome.residual_n <= tolerance_n && beam_.residual_nm() <= beam_tolerance_nm) {
      outcome.converged = true;
      for (std::size_t i = 0; i < n; ++i) set.point(i).arclength_m = load_[i].arclength_m;
      return outcome;
    }
  }
  // The last converged tick, carried on: same bend on the new base, same forces.
  tissue.assume({before_.data(), n});
  for (std::size_t i = 0; i < n; ++i) load_[i].arclength_m = anchor_m_[i];
  beam_.restore();
  place(base, set);
  return outcome;
}

}  // namespace trocar::insertion
