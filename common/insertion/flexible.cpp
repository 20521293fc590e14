#include "common/insertion/flexible.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace trocar::insertion {

using contact::Block;
using contact::Vector2;

namespace {
Vector2 tangent_at(double theta_rad) noexcept { return {std::cos(theta_rad), std::sin(theta_rad)}; }
}  // namespace

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
    if (std::abs(step) < tolerance(1e-13, 1e-8)) break;
  }
  return s;
}

// Forces and arclengths of the loads from the contacts' forces and slips.
void Flexible::take(const contact::WorkingSet& set) noexcept {
  for (std::size_t i = 0; i < set.size(); ++i) {
    const contact::Contact& c = set.solver().contact(i);
    load_[i].arclength_m = anchor_m_[i] - (c.state == contact::State::Stuck ? 0.0 : c.slip_m);
    load_[i].force_n = {-c.force_n[0], -c.force_n[1]};
  }
}

// The last tick's bend, forces and slips on the new base.
void Flexible::start(const needle::Pose& base, contact::WorkingSet& set) noexcept {
  beam_.restore();
  set.solver().assume({before_.data(), set.size()});
  take(set);
  static_cast<void>(beam_.place(base, {load_.data(), set.size()}));
}

bool Flexible::linearise(needle::Tangent tangent, const contact::WorkingSet& set) noexcept {
  const needle::Factor factor = beam_.linearise(tangent);
  if (factor.status != needle::Status::Ok) return false;
  beam_negative_ = factor.negative_pivots;
  convex_ = tangent == needle::Tangent::Convex;
  joined_.join(set.solver(), beam_.flexibility(), needle::Beam::most_loads);
  return true;
}

Vector2 Flexible::stands_m(const contact::WorkingSet& set, std::size_t i) noexcept {
  const Vector2& x = set.point(i).material_m;
  const Vector2 u = set.solver().displacement_m(i);
  return {x[0] + u[0], x[1] + u[1]};
}

// What is left between tissue and shaft, and between the forces and the law of friction in the frame of the shaft as it stands.
double Flexible::residual_n(const contact::WorkingSet& set, std::span<const contact::Target> target) const noexcept {
  double worst_n = 0.0;
  for (std::size_t i = 0; i < set.size(); ++i) {
    const Vector2 r = beam_.position_m(i);
    const Vector2 x = stands_m(set, i);
    const Block own = set.solver().compliance(i, i);
    const double least = std::min(own[0], own[3]);
    const contact::Contact& c = set.solver().contact(i);
    const contact::Target& at = target[i];
    const Vector2 t = tangent_at(beam_.theta_rad(i));
    const double axial_n = t[0] * c.force_n[0] + t[1] * c.force_n[1];
    double law_n = std::max({0.0, axial_n - at.upper_n, at.lower_n - axial_n});
    if (c.state != contact::State::Stuck) {
      const bool forward = c.state == contact::State::SlipForward;
      const double against_m = at.lower_n == at.upper_n ? 0.0 : forward ? -c.slip_m : c.slip_m;
      law_n = std::max(std::abs(axial_n - (forward ? at.upper_n : at.lower_n)), against_m / least);
    }
    worst_n = std::max({worst_n, std::hypot(r[0] - x[0], r[1] - x[1]) / least, law_n});
  }
  return worst_n;
}

// One Newton step of the whole, with the present K and B.
bool Flexible::iterate(contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept {
  const std::size_t n = set.size();
  contact::Solver& tissue = set.solver();
  if (!aim(set, target, outcome)) return false;
  if (!convex_ && joined_.negative_pivots() != beam_negative_) {
    // No least energy lies this way.
    if (!linearise(needle::Tangent::Convex, set) || !aim(set, target, outcome)) return false;
  }
  for (std::size_t i = 0; i < n; ++i) contact_[i] = joined_.contact(i);
  tissue.assume({contact_.data(), n});
  take(set);
  if (beam_.apply({load_.data(), n}).status != needle::Status::Ok) return false;
  outcome.residual_n = std::max(residual_n(set, target), outcome.solved_n);
  return true;
}

// Solves the contacts of the linearised whole.
bool Flexible::aim(const contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept {
  const std::size_t n = set.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2 p = beam_.position_m(i);
    const Vector2 c = beam_.correction_m(i);
    const Vector2 t = tangent_at(beam_.theta_rad(i));
    const double moved_m = anchor_m_[i] - load_[i].arclength_m;
    const Vector2 x = stands_m(set, i);
    const Vector2 both = joined_.displacement_m(i);  // (G + B) f
    target[i].tangent = t;
    for (std::size_t k = 0; k < 2; ++k) target[i].gap_m[k] = p[k] + c[k] + moved_m * t[k] - x[k] + both[k];
  }
  const contact::Solution solution = joined_.solve(target.first(n));
  outcome.pivots += solution.pivots;
  outcome.solves += solution.iterations;
  outcome.solved_n = solution.residual_n;
  return solution.status != contact::SolverStatus::NotFinite;
}

// Whether the equilibrium is one to stay in: as many negative eigenvalues in G + B as in K.
bool Flexible::stable() noexcept { return !convex_ && joined_.negative_pivots() == beam_negative_; }

Flexible::Outcome Flexible::solve(const needle::Pose& base, contact::WorkingSet& set, std::span<contact::Target> target) noexcept {
  const std::size_t n = set.size();
  Outcome outcome;
  beam_.keep();
  for (std::size_t i = 0; i < n; ++i) {
    before_[i] = set.solver().contact(i);
    anchor_m_[i] = set.point(i).arclength_m;
  }
  const auto arrives = [&](const needle::Pose& at) {
    start(at, set);
    if (!converge(set, target, outcome)) return false;
    for (std::size_t i = 0; i < n; ++i) set.point(i).arclength_m = load_[i].arclength_m;
    solved_base_ = at;
    return true;
  };
  outcome.converged = arrives(base);
  if (outcome.converged) return outcome;
  // A part of the way, so that a base that waits is caught up with in the next ticks. What it is told is the whole way, on which bend and
  // forces are carried rigidly.
  const auto between = [](double from, double to) { return from + part_way * (to - from); };
  const needle::Pose part{between(solved_base_.x_m, base.x_m), between(solved_base_.y_m, base.y_m),
                          between(solved_base_.theta_rad, base.theta_rad)};
  if (arrives(part)) {
    beam_.keep();
    for (std::size_t i = 0; i < n; ++i) {
      before_[i] = set.solver().contact(i);
      anchor_m_[i] = set.point(i).arclength_m;
    }
  }
  for (std::size_t i = 0; i < n; ++i) before_[i].slip_m = 0.0;
  start(base, set);
  outcome.residual_n = residual_n(set, target);
  return outcome;
}

bool Flexible::converge(contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept {
  if (!linearise(needle::Tangent::Exact, set)) return false;
  double last_n = std::numeric_limits<double>::infinity();
  double nudge_rad = least_nudge_rad;
  int full_steps = 0;
  for (int k = 0; k < max_iterations; ++k) {
    ++outcome.iterations;
    const int pivots = outcome.pivots;
    if (!iterate(set, target, outcome)) return false;
    bool solved = outcome.residual_n <= tolerance_n && beam_.residual_nm() <= beam_tolerance_nm;
    const bool slowly = !solved && k > 0 && pivots == outcome.pivots && outcome.residual_n * slow > last_n;
    // Newton's full step as long as it gains by its square or so.
    while (slowly && !solved && k + 1 < max_iterations && full_steps < most_full_steps) {
      const double before_n = outcome.residual_n;
      ++k;
      ++outcome.iterations;
      ++full_steps;
      if (!full_step(set, target)) return false;
      outcome.residual_n = residual_n(set, target);
      solved = outcome.residual_n <= tolerance_n && beam_.residual_nm() <= beam_tolerance_nm;
      if (!(outcome.residual_n * gain <= before_n)) break;
    }
    if (solved && stable()) return true;
    if (solved || slowly || convex_ || outcome.residual_n * gain > last_n) {
      if (solved) {
        // Asked once more where it now stands; if it is none to stay in, out of it.
        if (!linearise(needle::Tangent::Exact, set)) return false;
        if (stable()) return true;
        beam_.nudge(nudge_rad);
        nudge_rad *= -10.0;
      }
      if (!linearise(needle::Tangent::Exact, set)) return false;
    } else {
      beam_.correct();
    }
    last_n = outcome.residual_n;
  }
  return false;
}

}  // namespace trocar::insertion
