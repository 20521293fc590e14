// The needle manipulation Jacobian (DiMaio and Salcudean, IEEE Trans. Robotics and Automation 19, 2003, doi.org/10.1109/TRA.2003.817044),
// by differentiating the equations of a converged step. Unknowns of a contact that sticks: its force, x and y; where it stands on the shaft
// is fixed. Of one that slips: its force across the shaft, where it stands, and by how much the shaft turns there, because that turns its
// axial force, which is on a bound. Equations: tissue and shaft still meet, and what the turn is. The loads on the needle are -f.
#include <algorithm>
#include <cmath>

#include "common/insertion/flexible.hpp"

namespace trocar::insertion {

using contact::Block;
using contact::State;
using contact::Vector2;

namespace {

Vector2 tangent_at(double theta_rad) noexcept { return {std::cos(theta_rad), std::sin(theta_rad)}; }

// Gauss with partial pivoting on the first `n` rows and columns; right-hand sides in columns n, n + 1, n + 2, solutions in their place.
template <class Rows>
bool eliminate(Rows& a, std::size_t n) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t r = k + 1; r < n; ++r)
      if (std::abs(a[r][k]) > std::abs(a[pivot][k])) pivot = r;
    if (!(std::abs(a[pivot][k]) > 0.0)) return false;
    if (pivot != k) std::swap(a[pivot], a[k]);
    for (std::size_t r = k + 1; r < n; ++r) {
      const double factor = a[r][k] / a[k][k];
      if (factor == 0.0) continue;
      for (std::size_t c = k + 1; c < n + 3; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  for (std::size_t k = n; k-- > 0;)
    for (std::size_t c = n; c < n + 3; ++c) {
      double sum = a[k][c];
      for (std::size_t l = k + 1; l < n; ++l) sum -= a[k][l] * a[l][c];
      a[k][c] = sum / a[k][k];
    }
  return true;
}

}  // namespace

bool Flexible::jacobian(const needle::Pose& base, const contact::WorkingSet& set, Jacobian& out) noexcept {
  const std::size_t n = set.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2& f = set.solver().contact(i).force_n;
    load_[i] = {.arclength_m = set.point(i).arclength_m, .force_n = {-f[0], -f[1]}};
  }
  // The tip is a point like the others, without a force, and ranks last.
  const std::size_t tip = n;
  load_[tip] = {.arclength_m = beam_.properties().length_m};
  if (beam_.place(base, {load_.data(), n + 1}).status != needle::Status::Ok) return false;
  if (beam_.linearise().status != needle::Status::Ok) return false;

  std::array<std::size_t, capacity::contacts + 1> first{};  // unknown of a contact
  for (std::size_t i = 0; i < n; ++i) first[i + 1] = first[i] + (set.solver().contact(i).state == State::Stuck ? 2 : 3);
  const std::size_t unknowns = first[n];

  // What the unknowns of contact j are: changes of its force, and where it stands (unknown 1 of one that slips).
  std::array<std::array<Vector2, 3>, capacity::contacts> force{};
  std::array<needle::Slide, capacity::contacts> slide{};
  std::array<std::array<double, capacity::needle_loads>, capacity::contacts> turned_by{};
  const auto slips = [&](std::size_t j) { return set.solver().contact(j).state != State::Stuck; };
  for (std::size_t j = 0; j < n; ++j) {
    force[j] = {{{1.0, 0.0}, {0.0, 1.0}, {}}};
    if (!slips(j)) continue;
    const contact::Contact& c = set.solver().contact(j);
    const Vector2 t = tangent_at(beam_.theta_rad(j));
    force[j] = {{{-t[1], t[0]}, {}, {-c.axial_n * t[1] - c.lateral_n * t[0], c.axial_n * t[0] - c.lateral_n * t[1]}}};
    slide[j] = beam_.slide(j);
    beam_.rotations_by_moment(j, turned_by[j]);
  }
  // How place and angle (x, y, turn) of point i, the tip included, depend on unknown k of contact j.
  const auto depends = [&](std::size_t i, std::size_t j, std::size_t k) -> std::array<double, 3> {
    const Block b = beam_.compliance(i, j);
    const Vector2 turn = beam_.rotation(i, j);
    const Vector2& f = force[j][k];
    std::array<double, 3> by{-(b[0] * f[0] + b[1] * f[1]), -(b[2] * f[0] + b[3] * f[1]), -(turn[0] * f[0] + turn[1] * f[1])};
    if (k != 1 || !slips(j)) return by;
    const needle::Slide& s = slide[j];
    const Vector2 moved = beam_.rotation(j, i);  // of i by a moment at j: Betti
    by = {s.moment_nm * moved[0], s.moment_nm * moved[1], s.moment_nm * turned_by[j][i]};
    if (i == j) by[2] += beam_.at(load_[j].arclength_m).curvature_per_m;
    const Vector2 carried = i == j ? s.own_m : beam_.beyond(i, j) ? s.beyond_m : Vector2{};
    by[0] += carried[0];
    by[1] += carried[1];
    return by;
  };
  // On the base's x, y and angle.
  const auto by_base = [&](std::size_t i) {
    const Vector2 swing = beam_.by_base_angle(i);
    return Jacobian{{{1.0, 0.0, swing[0]}, {0.0, 1.0, swing[1]}, {0.0, 0.0, beam_.rotation_by_base_angle(i)}}};
  };

  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t rows = first[i + 1] - first[i];
    for (std::size_t j = 0; j < n; ++j) {
      const Block g = set.solver().compliance(i, j);
      for (std::size_t k = 0; k < first[j + 1] - first[j]; ++k) {
        const std::array<double, 3> shaft = depends(i, j, k);
        const Vector2& f = force[j][k];
        const std::array<double, 3> rest{g[0] * f[0] + g[1] * f[1], g[2] * f[0] + g[3] * f[1], i == j && k == 2 ? 1.0 : 0.0};
        for (std::size_t r = 0; r < rows; ++r) equation_[first[i] + r][first[j] + k] = shaft[r] - rest[r];
      }
    }
    const Jacobian moved = by_base(i);
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t c = 0; c < 3; ++c) equation_[first[i] + r][unknowns + c] = -moved[r][c];
  }
  if (!eliminate(equation_, unknowns)) return false;
  out = by_base(tip);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t k = 0; k < first[j + 1] - first[j]; ++k) {
      const std::array<double, 3> shaft = depends(tip, j, k);
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) out[r][c] += shaft[r] * equation_[first[j] + k][unknowns + c];
    }
  // What follows asks the beam for the contacts alone.
  return beam_.place(base, {load_.data(), n}).status == needle::Status::Ok;
}

}  // namespace trocar::insertion
