// The equations of a step, differentiated whole: for Newton's full step and for the needle manipulation Jacobian (DiMaio and Salcudean,
// IEEE Trans. Robotics and Automation 19, 2003, doi.org/10.1109/TRA.2003.817044).
//   Unknowns of a contact that sticks: its force, x and y; where it stands on the shaft is fixed. Of one that slips: its force across the
//   shaft, where it stands, and by how much the shaft turns there, because that turns its axial force, which is on a bound.
//   Equations: tissue and shaft meet, and what the turn is. The loads on the needle are -f. Not symmetric.
#include <algorithm>
#include <cmath>

#include "common/insertion/flexible.hpp"

namespace trocar::insertion {

using contact::Block;
using contact::State;
using contact::Vector2;

namespace {

Vector2 tangent_at(double theta_rad) noexcept { return {std::cos(theta_rad), std::sin(theta_rad)}; }

// Gauss with partial pivoting on the first `n` rows and columns; right-hand sides in the `sides` columns behind, solutions in their place.
template <class Rows>
bool eliminate(Rows& a, std::size_t n, std::size_t sides) noexcept {
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    for (std::size_t r = k + 1; r < n; ++r)
      if (std::abs(a[r][k]) > std::abs(a[pivot][k])) pivot = r;
    if (!(std::abs(a[pivot][k]) > 0.0)) return false;
    if (pivot != k) std::swap(a[pivot], a[k]);
    for (std::size_t r = k + 1; r < n; ++r) {
      const double factor = a[r][k] / a[k][k];
      if (factor == 0.0) continue;
      for (std::size_t c = k + 1; c < n + sides; ++c) a[r][c] -= factor * a[k][c];
    }
  }
  for (std::size_t k = n; k-- > 0;)
    for (std::size_t c = n; c < n + sides; ++c) {
      double sum = a[k][c];
      for (std::size_t l = k + 1; l < n; ++l) sum -= a[k][l] * a[l][c];
      a[k][c] = sum / a[k][k];
    }
  return true;
}

}  // namespace

// The left sides, at the present place and states, with K of this place.
void Flexible::differentiate(const contact::WorkingSet& set) noexcept {
  const std::size_t n = set.size();
  Whole& w = whole_;
  for (std::size_t j = 0; j < n; ++j) {
    const contact::Contact& c = set.solver().contact(j);
    w.slips[j] = c.state != State::Stuck;
    w.first[j + 1] = w.first[j] + (w.slips[j] ? 3 : 2);
    w.force[j] = {{{1.0, 0.0}, {0.0, 1.0}, {}}};
    if (!w.slips[j]) continue;
    const Vector2 t = tangent_at(beam_.theta_rad(j));
    const double axial_n = t[0] * c.force_n[0] + t[1] * c.force_n[1];
    const double lateral_n = t[0] * c.force_n[1] - t[1] * c.force_n[0];
    w.force[j] = {{{-t[1], t[0]}, {}, {-axial_n * t[1] - lateral_n * t[0], axial_n * t[0] - lateral_n * t[1]}}};
    w.slide[j] = beam_.slide(j);
    beam_.rotations_by_moment(j, w.turned_by[j]);
  }
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t rows = w.first[i + 1] - w.first[i];
    for (std::size_t j = 0; j < n; ++j) {
      const Block g = set.solver().compliance(i, j);
      for (std::size_t k = 0; k < w.first[j + 1] - w.first[j]; ++k) {
        const std::array<double, 3> shaft = shaft_by(i, j, k);
        const Vector2& f = w.force[j][k];
        const std::array<double, 3> rest{g[0] * f[0] + g[1] * f[1], g[2] * f[0] + g[3] * f[1], i == j && k == 2 ? 1.0 : 0.0};
        for (std::size_t r = 0; r < rows; ++r) w.equation[w.first[i] + r][w.first[j] + k] = shaft[r] - rest[r];
      }
    }
  }
}

// x, y and angle of the shaft at point i by a force of the needle on the tissue at contact j.
std::array<double, 3> Flexible::shaft_under(std::size_t i, std::size_t j, const Vector2& f) const noexcept {
  const Block b = beam_.compliance(i, j);
  const Vector2 turn = beam_.rotation(i, j);
  return {-(b[0] * f[0] + b[1] * f[1]), -(b[2] * f[0] + b[3] * f[1]), -(turn[0] * f[0] + turn[1] * f[1])};
}

// The same by unknown k of contact j.
std::array<double, 3> Flexible::shaft_by(std::size_t i, std::size_t j, std::size_t k) const noexcept {
  const Whole& w = whole_;
  if (k != 1 || !w.slips[j]) return shaft_under(i, j, w.force[j][k]);
  const needle::Slide& s = w.slide[j];
  const Vector2 moved = beam_.rotation(j, i);  // of i by a moment at j: Betti
  std::array<double, 3> by{s.moment_nm * moved[0], s.moment_nm * moved[1], s.moment_nm * w.turned_by[j][i]};
  if (i == j) by[2] += beam_.at(load_[j].arclength_m).curvature_per_m;
  const Vector2 carried = i == j ? s.own_m : beam_.beyond(i, j) ? s.beyond_m : Vector2{};
  by[0] += carried[0];
  by[1] += carried[1];
  return by;
}

// Newton's step of everything but the states: what aim() leaves out, frames that turn with the shaft and loads that slide along it, is in.
bool Flexible::full_step(contact::WorkingSet& set, std::span<const contact::Target> target) noexcept {
  const std::size_t n = set.size();
  contact::Solver& tissue = set.solver();
  Whole& w = whole_;
  if (beam_.linearise().status != needle::Status::Ok) return false;
  differentiate(set);
  const std::size_t unknowns = w.first[n];
  // Forces back onto their bounds in the frame of the shaft as it stands.
  std::array<Vector2, capacity::contacts> back{};
  for (std::size_t i = 0; i < n; ++i) {
    if (!w.slips[i]) continue;
    const contact::Contact& c = tissue.contact(i);
    const Vector2 t = tangent_at(beam_.theta_rad(i));
    const double bound_n = c.state == State::SlipForward ? target[i].upper_n : target[i].lower_n;
    const double missing_n = bound_n - (t[0] * c.force_n[0] + t[1] * c.force_n[1]);
    back[i] = {missing_n * t[0], missing_n * t[1]};
  }
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2 p = beam_.position_m(i);
    const Vector2 c = beam_.correction_m(i);
    const Vector2 x = stands_m(set, i);
    std::array<double, 3> left{p[0] + c[0] - x[0], p[1] + c[1] - x[1], beam_.rotation_correction(i)};
    for (std::size_t j = 0; j < n; ++j) {
      if (!w.slips[j]) continue;
      const std::array<double, 3> shaft = shaft_under(i, j, back[j]);
      const Block g = tissue.compliance(i, j);
      left[0] += shaft[0] - (g[0] * back[j][0] + g[1] * back[j][1]);
      left[1] += shaft[1] - (g[2] * back[j][0] + g[3] * back[j][1]);
      left[2] += shaft[2];
    }
    for (std::size_t r = 0; r < w.first[i + 1] - w.first[i]; ++r) w.equation[w.first[i] + r][unknowns] = -left[r];
  }
  if (!eliminate(w.equation, unknowns, 1)) return false;
  std::array<double, capacity::contacts> moment_nm{};
  for (std::size_t i = 0; i < n; ++i) {
    contact_[i] = tissue.contact(i);
    Vector2& f = contact_[i].force_n;
    for (std::size_t k = 0; k < w.first[i + 1] - w.first[i]; ++k) {
      const double change = w.equation[w.first[i] + k][unknowns];
      f = {f[0] + change * w.force[i][k][0], f[1] + change * w.force[i][k][1]};
      if (!w.slips[i] || k != 1) continue;
      contact_[i].slip_m -= change;
      moment_nm[i] = w.slide[i].moment_nm * change;
    }
    f = {f[0] + back[i][0], f[1] + back[i][1]};
  }
  tissue.assume({contact_.data(), n});
  take(set);
  return beam_.apply({load_.data(), n}, {moment_nm.data(), n}).status == needle::Status::Ok;
}

bool Flexible::jacobian(const needle::Pose& base, const contact::WorkingSet& set, Jacobian& out) noexcept {
  const std::size_t n = set.size();
  Whole& w = whole_;
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2& f = set.solver().contact(i).force_n;
    load_[i] = {.arclength_m = set.point(i).arclength_m, .force_n = {-f[0], -f[1]}};
  }
  // The tip is a point like the others, without a force, and ranks last.
  const std::size_t tip = n;
  load_[tip] = {.arclength_m = beam_.properties().length_m};
  if (beam_.place(base, {load_.data(), n + 1}).status != needle::Status::Ok) return false;
  if (beam_.linearise().status != needle::Status::Ok) return false;
  differentiate(set);
  const std::size_t unknowns = w.first[n];
  // On the base's x, y and angle.
  const auto by_base = [&](std::size_t i) {
    const Vector2 swing = beam_.by_base_angle(i);
    return Jacobian{{{1.0, 0.0, swing[0]}, {0.0, 1.0, swing[1]}, {0.0, 0.0, beam_.rotation_by_base_angle(i)}}};
  };
  for (std::size_t i = 0; i < n; ++i) {
    const Jacobian moved = by_base(i);
    for (std::size_t r = 0; r < w.first[i + 1] - w.first[i]; ++r)
      for (std::size_t c = 0; c < 3; ++c) w.equation[w.first[i] + r][unknowns + c] = -moved[r][c];
  }
  if (!eliminate(w.equation, unknowns, 3)) return false;
  out = by_base(tip);
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t k = 0; k < w.first[j + 1] - w.first[j]; ++k) {
      const std::array<double, 3> shaft = shaft_by(tip, j, k);
      for (std::size_t r = 0; r < 3; ++r)
        for (std::size_t c = 0; c < 3; ++c) out[r][c] += shaft[r] * w.equation[w.first[j] + k][unknowns + c];
    }
  // What follows asks the beam for the contacts alone.
  return beam_.place(base, {load_.data(), n}).status == needle::Status::Ok;
}

}  // namespace trocar::insertion
