#include "common/contact/working_set.hpp"

#include <algorithm>
#include <cmath>

#include "common/contact/unresolved.hpp"
#include "common/core/precision.hpp"

namespace trocar::contact {
namespace {

constexpr double segment_regularisation = 1e-6;
constexpr double point_regularisation = 1e-12;
constexpr double resize_step = 1.0 / 128.0;  // of the spacing: how finely the last segment's weights follow the tip
constexpr double soften_step = 1.0 / 512.0;  // and the softness of its tie
constexpr double softness_of_short = 0.1;    // of its own compliance: about what a whole segment's is once its neighbours stick too
// Of what the tissue's own compliance would give for the lateral force that is missing: a tip that a bevel carries aside approaches that
// force, and a long step does not carry it beyond.
constexpr double largest_aside = 0.2;
constexpr int most_cells = 512;  // that one walk crosses

double overlap(double a0, double a1, double b0, double b1) noexcept { return std::max(0.0, std::min(a1, b1) - std::max(a0, b0)); }

}  // namespace

void WorkingSet::open(const model::Tissue& tissue, const Law& law, double face_rad, double tip_lateral) noexcept {
  face_rad_ = face_rad;
  tip_lateral_ = tip_lateral;
  tissue_ = &tissue;
  law_ = &law;
  geometry_.open(tissue);
  compliance_.open(tissue);
  regularisation_ = segments() ? segment_regularisation : point_regularisation;
  // A contact tied to supported nodes alone has no compliance of its own; 1 / (E t) is the tissue's scale.
  const double depth = tissue.model == element::Model::Solid ? tissue.edge_length_m : tissue.thickness_m;
  least_compliance_ = 1e-9 / (tissue.material.front().young_pa * depth);
  named_ = {};
  clear();
}

void WorkingSet::clear() noexcept {
  solver_.clear();
  geometry_.restore();
  compliance_.restore();
  coupling_count_ = 0;
  clock_ = 0;
  tip_cell_ = -1;
  tip_inside_ = false;
  path_m_ = deepest_m_ = 0.0;
  cutting_n_per_m_ = 0.0;
  softened_ = capacity::contacts;
}

const WorkingSet::NodeCoupling& WorkingSet::coupling_of(std::uint32_t node) noexcept {
  NodeCoupling* entry = nullptr;
  for (std::size_t k = 0; k < coupling_count_ && entry == nullptr; ++k)
    if (coupling_[k].node == node) entry = &coupling_[k];
  if (entry == nullptr) {
    if (coupling_count_ < nodes_in_use)
      entry = &coupling_[coupling_count_++];
    else
      entry = std::min_element(coupling_.begin(), coupling_.end(), [](const auto& a, const auto& b) { return a.used < b.used; });
    entry->node = node;
    entry->known = 0;
  }
  entry->used = ++clock_;
  const Embedding at = single_node(node);
  for (; entry->known < size(); ++entry->known) entry->block[entry->known] = compliance_.coupling(at, point_[entry->known].at);
  return *entry;
}

void WorkingSet::forget_couplings(std::size_t from_contact) noexcept {
  for (std::size_t k = 0; k < coupling_count_; ++k) coupling_[k].known = std::min(coupling_[k].known, from_contact);
}

Vector2 WorkingSet::node_displacement(std::uint32_t node) noexcept {
  const NodeCoupling& entry = coupling_of(node);
  Vector2 u{};
  for (std::size_t j = 0; j < size(); ++j) {
    const Block& g = entry.block[j];
    const Vector2& f = solver_.contact(j).force_n;
    u[0] += g[0] * f[0] + g[1] * f[1];
    u[1] += g[2] * f[0] + g[3] * f[1];
  }
  return u;
}

Vector2 WorkingSet::displacement_m(const Embedding& at) noexcept {
  Vector2 u{};
  for (std::uint32_t k = 0; k < at.count; ++k) u = plus(u, scaled(node_displacement(at.node[k]), at.weight[k]));
  return u;
}

Vector2 WorkingSet::tied_displacement_m(std::size_t contact) noexcept {
  Vector2 u{};
  for (std::size_t j = 0; j < size(); ++j) {
    const Block g = solver_.compliance(contact, j);
    const Vector2& f = solver_.contact(j).force_n;
    u = {u[0] + g[0] * f[0] + g[1] * f[1], u[1] + g[2] * f[0] + g[3] * f[1]};
  }
  return u;
}

// row_[0 … before]: the couplings of `at` with the contacts before it, and its own block.
std::size_t WorkingSet::make_row(const Embedding& at, std::size_t before) noexcept {
  std::fill_n(row_.begin(), before, Block{});
  for (std::uint32_t k = 0; k < at.count; ++k) {
    const NodeCoupling& entry = coupling_of(at.node[k]);
    const double w = at.weight[k];
    for (std::size_t j = 0; j < before; ++j)
      for (std::size_t c = 0; c < 4; ++c) row_[j][c] += w * entry.block[j][c];
  }
  Block own = compliance_.coupling(at, at);
  own[1] = own[2] = 0.5 * (own[1] + own[2]);
  const double mean = 0.5 * (own[0] + own[3]);
  const double added = std::max(regularisation_ * mean, mean < least_compliance_ ? least_compliance_ : 0.0);
  own[0] += added;
  own[3] += added;
  row_[before] = own_[before] = own;
  return before + 1;
}

// row_[i], of the segment between two points, is there without it; ends up in own_[i] but for the end of the line.
void WorkingSet::add_unresolved(const Embedding& at, const Vector2& from_m, const Vector2& to_m, std::size_t i) noexcept {
  end_[i] = {};
  if (tissue_->model == element::Model::Solid) return;
  const std::int32_t middle = geometry_.locate(plus(from_m, scaled(minus(to_m, from_m), 0.5)), tip_cell_);
  const model::Cell& cell = tissue_->cell[static_cast<std::size_t>(middle < 0 ? tip_cell_ : middle)];
  ends_inside_ = tip_inside_;  // a line that leaves the tissue does not end
  const double spacing = law_->spacing_m, length_m = length(minus(to_m, from_m));
  const Unresolved unresolved = contact::add_unresolved(row_[i], geometry_, *tissue_, cell, at, from_m, to_m, spacing, tip_inside_);
  end_[i] = unresolved.end;
  if (i > 0) {
    // f_i - (l_i / l_(i-1)) f_(i-1): a segment that is still short neither holds its predecessor nor is held by it, which ends the line
    // as far as the short one does not yet.
    const double share = length_m / (spacing * length(point_[i - 1].heading));
    add(row_[i], unresolved.jump);
    add(row_[i - 1], unresolved.jump, -share);
    Block before = own_[i - 1];
    add(before, unresolved.jump, share * share);
    add(before, before_end(end_[i - 1], std::min(1.0, length_m / spacing)));
    solver_.replace_own(i - 1, before);
    add(row_[i], unresolved.softer);
  }
  own_[i] = row_[i];
  add(row_[i], at_end(end_[i]));
}

void WorkingSet::push(const Point& point) noexcept {
  const std::size_t i = size();
  if (adapts() && i > 0) solver_.replace_own(i - 1, own_[i - 1]);
  yields_known_ = false;
  const std::size_t count = make_row(point.at, i);
  if (segments()) add_unresolved(point.at, point.begin_m, plus(point.begin_m, scaled(point.heading, point.length_m)), i);
  point_[i] = point;
  point_[i].material_m = geometry_.mean_m(point.at);
  solver_.push({row_.data(), count});
}

void WorkingSet::pop() noexcept {
  solver_.pop();
  yields_known_ = false;
  forget_couplings(size());
  // What is the last one now was a whole segment: its tie is not softened.
  if (size() > 0 && segments()) solver_.replace_own(size() - 1, own_at_end(0.0, {1.0, 0.0}));
}

// Of the last segment, as the end of the line.
Block WorkingSet::own_at_end(double softness, const Vector2& tangent) const noexcept {
  const std::size_t i = size() - 1;
  Block own = own_[i];
  add(own, at_end(end_[i]));
  add(own, in_axes(tangent, 0.0, softness));
  return own;
}

// What the last contact yields along a unit vector and across it, while its other direction and the few contacts before it are held.
Vector2 WorkingSet::yields_held(const Vector2& t) const noexcept {
  constexpr std::size_t few = 5;
  const std::size_t first = size() - std::min(size(), few), count = 2 * (size() - first);
  const std::array<Vector2, 2> axes{t, normal(t)};
  std::array<std::array<double, 2 * few>, 2 * few> lower{};  // Cholesky's
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const Block g = i / 2 == j / 2 ? own_[first + i / 2] : solver_.compliance(first + i / 2, first + j / 2);
      const Vector2 &a = axes[i % 2], &b = axes[j % 2];
      double rest = a[0] * (g[0] * b[0] + g[1] * b[1]) + a[1] * (g[2] * b[0] + g[3] * b[1]);
      for (std::size_t k = 0; k < j; ++k) rest -= lower[i][k] * lower[j][k];
      if (i == j && !(rest > 0.0)) return {};
      lower[i][j] = i == j ? std::sqrt(rest) : rest / lower[j][j];
    }
  const double along = lower[count - 2][count - 2], between = lower[count - 1][count - 2], across = lower[count - 1][count - 1];
  return {along * along * across * across / (across * across + between * between), across * across};
}

// Of the last node that was moved onto the shaft, with the piece of the line from it to the tip.
Block WorkingSet::own_at_tip() const noexcept {
  const std::size_t i = size() - 1;
  Block own = own_[i];
  if (i == 0 || !tip_inside_ || tissue_->model == element::Model::Solid) return own;
  const Point &last = point_[i], &before = point_[i - 1];
  const Vector2 gives = gives_at_tip(*tissue_, tissue_->cell[static_cast<std::size_t>(tip_cell_)], last.direction, path_m_ - last.path_m,
                                     last.path_m - before.path_m);
  add(own, in_axes(last.direction, yields_[0] * gives[0], yields_[1] * gives[1]));
  return own;
}

void WorkingSet::soften_last(const Vector2& tangent) noexcept {
  if (adapts()) {
    if (!yields_known_) yields_ = yields_held(point_[size() - 1].direction);
    yields_known_ = true;
    solver_.replace_own(size() - 1, own_at_tip());
  }
  if (!segments()) return;
  const std::size_t i = size() - 1;
  const double spacing = law_->spacing_m;
  const double covered = path_m_ - point_[i].path_m;
  if (softened_ != i || std::abs(covered - softened_length_m_) >= soften_step * spacing || covered >= spacing)
    softened_length_m_ = std::clamp(covered, soften_step * spacing, spacing);
  softened_ = i;
  solver_.replace_own(i, own_at_end(softness_of_short * 0.5 * (own_[i][0] + own_[i][3]) * (spacing / softened_length_m_ - 1.0), tangent));
}

bool WorkingSet::place(const Vector2& x_m) noexcept {
  const std::int32_t cell = geometry_.locate(x_m, -1);
  if (cell < 0 || size() == Solver::capacity) return false;
  Point point;
  point.at = geometry_.point(cell, x_m);
  point.begin_m = x_m;
  push(point);
  point_[size() - 1].material_m = x_m;
  solver_.start_from(size() - 1, State::Stuck);
  return true;
}

void WorkingSet::set_bounds(double shaft_n_per_m, double tip_n_per_m, std::span<Target> target) const noexcept {
  const std::size_t n = size();
  if (law_->explicit_count > 0) {
    for (std::size_t i = 0; i < n; ++i) {
      target[i].upper_n = law_->explicit_slip_force_n[i];
      target[i].lower_n = -target[i].upper_n;
    }
    return;
  }
  const double excess = std::max(0.0, tip_n_per_m - shaft_n_per_m);
  const double zone_begins = deepest_m_ - law_->tip_zone_m;
  const bool nodes = law_->method != Method::Embedded;
  double begins = nodes ? 0.0 : point_[0].path_m;
  for (std::size_t i = 0; i < n; ++i) {
    double ends = path_m_;
    if (i + 1 < n) ends = nodes ? 0.5 * (point_[i].path_m + point_[i + 1].path_m) : point_[i + 1].path_m;
    const double threshold = shaft_n_per_m * std::max(0.0, ends - begins);
    target[i].lower_n = -threshold;
    target[i].upper_n = threshold + excess * overlap(begins, ends, zone_begins, path_m_);
    begins = ends;
  }
}

double WorkingSet::beyond_last() const noexcept {
  const Point& last = point_[size() - 1];
  return dot(last.direction, minus(tip_, last.begin_m));
}

// How far a line runs before it leaves the candidates.
double WorkingSet::reach(const Vector2& from_m, std::int32_t cell, const Vector2& direction, double most_m,
                         Trouble& trouble) const noexcept {
  double distance = 0.0;
  for (int step = 0; step < most_cells && distance < most_m; ++step) {
    const Exit exit = geometry_.exit(cell, from_m, direction);
    distance = std::max(distance, exit.distance);
    const std::int32_t next = tissue_->cell[static_cast<std::size_t>(cell)].neighbour[exit.edge];
    if (next < 0) {
      if (next == model::limit && distance < most_m) trouble.left_candidates = true;
      return std::min(distance, most_m);
    }
    cell = next;
  }
  return std::min(distance, most_m);
}

// How far beside the tip, along the shaft's normal, a bevelled tip cuts: what it has cut beside it so far, which the tie of a short segment
// has not pulled the tip onto yet, and what the face adds over the advance.
double WorkingSet::aside_m(double length_m, const Vector2& direction) const noexcept {
  const std::size_t i = size() - 1;
  const Point& last = point_[i];
  const double full_n = std::abs(tip_lateral_) * cutting_n_per_m_ * std::min(law_->tip_zone_m, path_m_);
  if (full_n == 0.0) return 0.0;
  const double side = std::copysign(1.0, face_rad_);
  const Vector2 n{-side * direction[1], side * direction[0]};
  const Block& own = own_[i];
  const double most_m = full_n * (n[0] * (own[0] * n[0] + own[1] * n[1]) + n[1] * (own[2] * n[0] + own[3] * n[1]));
  const double so_far_m = std::clamp(dot(minus(plus(last.begin_m, scaled(last.heading, length_m)), tip_), n), 0.0, largest_aside * most_m);
  // By the last segment, and by the one before as far as the last is too short for it. One that pushes the other way, because the needle
  // tilts, does not count against: the pair would grow beyond all measure.
  const double grown = std::clamp(length_m / law_->spacing_m, 0.0, 1.0);
  const auto holds = [&](std::size_t k) { return std::max(0.0, -side * solver_.contact(k).lateral_n); };
  const double held_n = holds(i) + (i > 0 ? (1.0 - grown) * holds(i - 1) : 0.0);
  const double missing = std::clamp(1.0 - held_n / full_n, 0.0, 1.0);
  const double added_m = missing * std::min((length_m - last.cut_m) * std::abs(face_rad_), largest_aside * most_m);
  return side * std::min(so_far_m + added_m, length_m * std::abs(face_rad_));
}

// The last segment's weights and tie for the length that it has now.
void WorkingSet::resize_last(double length_m, const Vector2& direction) noexcept {
  const std::size_t i = size() - 1;
  Point& last = point_[i];
  const double spacing = law_->spacing_m;
  // New tissue is cut where the tip goes; coming back, and going again, the segment keeps the course that was cut.
  if (length_m > last.cut_m) {
    const double aside = tip_lateral_ != 0.0 ? aside_m(length_m, direction) : 0.0;
    const Vector2 chord = minus(plus(tip_, scaled({-direction[1], direction[0]}, aside)), last.begin_m);
    last.heading = scaled(chord, 1.0 / dot(last.direction, chord));
    last.cut_m = length_m;
  }
  const double now = std::clamp(length_m, resize_step * spacing / 2, spacing);
  const bool grown_up = now == spacing && last.length_m != spacing;
  if (std::abs(now - last.length_m) < resize_step * spacing && !grown_up && ends_inside_ == tip_inside_) return;
  const Vector2 end = plus(last.begin_m, scaled(last.heading, now));
  last.at = geometry_.segment(last.begin_m, end, tip_cell_);
  last.material_m = geometry_.mean_m(last.at);
  last.length_m = now;
  last.fresh = true;
  forget_couplings(i);
  const std::size_t count = make_row(last.at, i);
  add_unresolved(last.at, last.begin_m, end, i);
  solver_.replace(i, {row_.data(), count});
}

void WorkingSet::push_segment(const Vector2& begin_m, const Vector2& direction, double path_m) noexcept {
  const double spacing = law_->spacing_m;
  Point point;
  point.begin_m = begin_m;
  point.direction = point.heading = direction;
  point.path_m = path_m;
  point.length_m = resize_step * spacing / 2;
  point.at = geometry_.segment(begin_m, plus(begin_m, scaled(direction, point.length_m)), tip_cell_);
  push(point);
}

void WorkingSet::push_node(const Vector2& crossing_m, const model::Cell& cell, std::size_t edge, const Vector2& direction,
                           Trouble& trouble) noexcept {
  const std::uint32_t a = cell.node[edge];
  const std::uint32_t b = cell.node[(edge + 1) % cell.count];
  const std::uint32_t node = length(minus(crossing_m, geometry_.node_m(a))) <= length(minus(crossing_m, geometry_.node_m(b))) ? a : b;
  // Moved inwards, a node of the surface would take tissue away.
  if (law_->method == Method::Adapt && cell.neighbour[edge] != model::surface && geometry_.on_surface(node)) return;
  for (std::size_t i = 0; i < size(); ++i)
    if (point_[i].at.node[0] == node) return;
  // A supported node cannot give way.
  if ((tissue_->node_flags[node] & (model::fixed_x | model::fixed_y)) != 0) return;
  if (size() == Solver::capacity) {
    trouble.full = true;
    return;
  }
  if (law_->method == Method::Adapt && !geometry_.is_moved(node) &&
      length(minus(crossing_m, geometry_.node_m(node))) > tolerance(1e-9, 1e-5) * tissue_->edge_length_m) {
    if (compliance_.move(geometry_, node, crossing_m)) {
      forget_couplings(0);
      for (std::size_t i = 0; i < size(); ++i) {
        for (std::size_t j = 0; j <= i; ++j) {
          const Block change = compliance_.latest_change(point_[i].at.node[0], point_[j].at.node[0]);
          row_[j] = j < i ? solver_.compliance(i, j) : own_[i];
          for (std::size_t k = 0; k < 4; ++k) row_[j][k] -= change[k];
        }
        own_[i] = row_[i];
        solver_.replace(i, {row_.data(), i + 1});
      }
    } else {
      trouble.not_adapted = true;
    }
  }
  push_single(node, crossing_m, direction);
}

void WorkingSet::push_single(std::uint32_t node, const Vector2& begin_m, const Vector2& direction) noexcept {
  Point point;
  point.at = single_node(node);
  point.begin_m = begin_m;
  point.direction = direction;
  point.path_m = size() == 0 ? 0.0
                             : point_[size() - 1].path_m +
                                   std::max(0.0, dot(point_[size() - 1].direction, minus(begin_m, point_[size() - 1].begin_m)));
  push(point);
}

void WorkingSet::push_passed(const Vector2& direction, Trouble& trouble) noexcept {
  while (size() < named_.size()) {
    const Vector2 x = geometry_.node_m(named_[size()]);
    if (dot(direction, minus(tip_, x)) < 0.0) return;
    if (size() == Solver::capacity) {
      trouble.full = true;
      return;
    }
    push_single(named_[size()], x, direction);
  }
}

// From one point of the path to a later one, with a contact at each edge that it crosses.
void WorkingSet::walk(Vector2 from_m, std::int32_t cell, const Vector2& to_m, const Vector2& direction, Trouble& trouble) noexcept {
  for (int step = 0; step < most_cells; ++step) {
    const Vector2 way = minus(to_m, from_m);
    const double rest = length(way);
    if (rest == 0.0) break;
    const Vector2 heading = scaled(way, 1.0 / rest);
    const Exit exit = geometry_.exit(cell, from_m, heading);
    if (!(exit.distance <= rest)) break;
    const model::Cell& crossed = tissue_->cell[static_cast<std::size_t>(cell)];
    const Vector2 crossing = plus(from_m, scaled(heading, exit.distance));
    const std::int32_t next = crossed.neighbour[exit.edge];
    push_node(crossing, crossed, exit.edge, direction, trouble);
    if (next < 0) {
      trouble.left_candidates = trouble.left_candidates || next == model::limit;
      break;
    }
    from_m = crossing;
    cell = next;
  }
}

WorkingSet::Trouble WorkingSet::enter(const Vector2& tip_m, const Vector2& direction, double most_m) noexcept {
  Trouble trouble;
  const std::int32_t cell = geometry_.locate(tip_m, -1);
  if (cell < 0) return trouble;
  const Vector2 back = scaled(direction, -1.0);
  const double depth = reach(tip_m, cell, back, most_m, trouble);
  if (trouble.left_candidates) return trouble;
  tip_ = tip_m;
  tip_cell_ = cell;
  tip_inside_ = true;
  deepest_m_ = 0.0;
  const Vector2 entry = plus(tip_m, scaled(back, depth));
  std::int32_t entry_cell = geometry_.locate(entry, -1);
  if (entry_cell < 0) entry_cell = cell;
  if (law_->method == Method::Embedded) {
    push_segment(entry, direction, 0.0);
    follow_segments(direction, trouble);
  } else {
    if (!named_.empty()) {
      push_passed(direction, trouble);
    } else {
      const Exit behind = geometry_.exit(entry_cell, entry, back);
      push_node(entry, tissue_->cell[static_cast<std::size_t>(entry_cell)], behind.edge, direction, trouble);
      if (size() > 0) walk(entry, entry_cell, tip_m, direction, trouble);
    }
    if (size() == 0) return trouble;
    path_m_ = point_[size() - 1].path_m + std::max(0.0, beyond_last());
  }
  deepest_m_ = path_m_;
  return trouble;
}

// Newton on X + u(X) = tip from the last X, with the gradient of the cell in which X lies.
void WorkingSet::find_tip(const Vector2& tip_m, Trouble& trouble) noexcept {
  constexpr int most_iterations = 30;
  const double tolerance_m = tolerance(1e-9, 3e-5) * tissue_->edge_length_m;
  std::array<Vector2, 4> nodes{};
  std::int32_t loaded = -1;
  for (int k = 0; k < most_iterations; ++k) {
    const std::int32_t found = geometry_.locate(tip_, tip_cell_);
    tip_inside_ = found >= 0;
    if (tip_inside_) tip_cell_ = found;
    const model::Cell& cell = tissue_->cell[static_cast<std::size_t>(tip_cell_)];
    if (loaded != tip_cell_)
      for (std::size_t p = 0; p < cell.count; ++p) nodes[p] = node_displacement(cell.node[p]);
    loaded = tip_cell_;
    const CellShape at = geometry_.shape(tip_cell_, tip_);
    Vector2 rest = minus(tip_m, tip_);
    Block j{1.0, 0.0, 0.0, 1.0};
    for (std::size_t p = 0; p < at.count; ++p) {
      rest = minus(rest, scaled(nodes[p], at.weight[p]));
      for (std::size_t a = 0; a < 2; ++a)
        for (std::size_t b = 0; b < 2; ++b) j[2 * a + b] += nodes[p][a] * at.gradient[p][b];
    }
    if (std::abs(rest[0]) + std::abs(rest[1]) < tolerance_m) return;
    const double determinant = j[0] * j[3] - j[1] * j[2];
    // Tissue that linear elasticity has turned inside out has no meaningful gradient.
    const Vector2 step = determinant > 0.05
                             ? Vector2{(j[3] * rest[0] - j[1] * rest[1]) / determinant, (j[0] * rest[1] - j[2] * rest[0]) / determinant}
                             : rest;
    const double size_m = length(step);
    if (!(size_m < 1e6)) break;
    tip_ = plus(tip_, scaled(step, size_m > tissue_->edge_length_m ? tissue_->edge_length_m / size_m : 1.0));
  }
  // Tissue torn out of all proportion by a jump of the base: what the tip left is dropped.
  tip_ = tip_m;
  const std::int32_t found = geometry_.locate(tip_, tip_cell_);
  tip_inside_ = found >= 0;
  if (tip_inside_) tip_cell_ = found;
  trouble.tip_lost = true;
}

void WorkingSet::follow_segments(const Vector2& direction, Trouble& trouble) noexcept {
  const double spacing = law_->spacing_m;
  double beyond = beyond_last();
  // Outside of the tissue the path ends where it leaves it.
  const auto clipped = [&] {
    if (tip_inside_ || beyond <= 0.0) return beyond;
    const Point& last = point_[size() - 1];
    const std::int32_t cell = geometry_.locate(last.begin_m, tip_cell_);
    return cell < 0 ? 0.0 : std::min(beyond, reach(last.begin_m, cell, last.direction, beyond, trouble));
  };
  double covered = clipped();
  while (covered >= spacing) {
    Point& last = point_[size() - 1];
    resize_last(spacing, direction);
    if (size() == Solver::capacity) {
      trouble.full = true;
      break;
    }
    const Vector2 next = plus(last.begin_m, scaled(last.heading, spacing));
    if (geometry_.locate(next, tip_cell_) < 0) break;
    push_segment(next, direction, last.path_m + spacing);
    beyond = beyond_last();
    covered = clipped();
  }
  while (size() > 0 && beyond <= 0.0) {
    pop();
    if (size() > 0) beyond = beyond_last();
  }
  if (size() == 0) return;
  covered = std::clamp(clipped(), 0.0, spacing);
  resize_last(covered, direction);
  path_m_ = point_[size() - 1].path_m + covered;
}

void WorkingSet::follow_nodes(const Vector2& before_m, std::int32_t cell, const Vector2& direction, Trouble& trouble) noexcept {
  while (size() > 0 && beyond_last() < 0.0) pop();
  if (size() == 0) return;
  if (!named_.empty())
    push_passed(direction, trouble);
  else if (dot(minus(tip_, before_m), point_[size() - 1].direction) > 0.0)
    walk(before_m, cell, tip_, direction, trouble);
  double beyond = std::max(0.0, beyond_last());
  if (!tip_inside_) {
    const Point& last = point_[size() - 1];
    const std::int32_t from = geometry_.locate(last.begin_m, tip_cell_);
    beyond = from < 0 ? 0.0 : reach(last.begin_m, from, last.direction, beyond, trouble);
  }
  path_m_ = point_[size() - 1].path_m + beyond;
}

WorkingSet::Trouble WorkingSet::follow(const Vector2& tip_m, const Vector2& direction) noexcept {
  Trouble trouble;
  if (size() == 0) return trouble;
  const Vector2 before = tip_;
  const std::int32_t cell = tip_cell_;
  const bool was_inside = tip_inside_;
  find_tip(tip_m, trouble);
  if (law_->method == Method::Embedded)
    follow_segments(direction, trouble);
  else
    follow_nodes(was_inside ? before : tip_, cell, direction, trouble);
  if (size() == 0)
    clear();
  else
    deepest_m_ = std::max(deepest_m_, path_m_);
  return trouble;
}

}  // namespace trocar::contact
