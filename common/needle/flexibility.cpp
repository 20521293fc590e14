// The flexibility of common/needle/beam.hpp: K^-1 P for all points at once, a column a force component, so that the inner loops run along
// columns. Then B by integrating the rotations along the shaft once more: row i of B is what the columns have turned it by.
#include <algorithm>
#include <cmath>

#include "common/needle/beam.hpp"
#include "common/needle/plane.hpp"

namespace trocar::needle {

// P by rank. A node turns everything beyond it: columns of loads beyond an element take the whole of its levers, those of loads inside a
// part, those of loads before it nothing.
void Beam::fill_levers() noexcept {
  const std::size_t stride = 2 * block_columns_;
  std::fill_n(column_.begin(), nodes_ * stride, 0.0);
  std::size_t v = 0;
  std::size_t first = 0;  // load by rank that lies beyond the intervals passed
  for (std::size_t e = 0; e < properties_.elements; ++e) {
    double* const row = &column_[2 * e * stride];
    std::array<Vector2, 3> sum{};
    const auto put = [&](std::size_t from, std::size_t to) {
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t axis = 0; axis < 2; ++axis) {
          double* const x = row + a * stride + axis * block_columns_;
          const double value = sum[a][axis];
          for (std::size_t j = from; j < to; ++j) x[j] += value;
        }
    };
    while (first < count_ && ranked_[first].after <= v) ++first;
    for (; v < intervals_ && interval_[v].element == e; ++v) {
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t axis = 0; axis < 2; ++axis) sum[a][axis] += interval_[v].lever[a][axis];
      std::size_t past = first;
      while (past < count_ && ranked_[past].after == v + 1) ++past;
      put(first, past);
      first = past;
    }
    put(first, count_);
  }
  // Loads at the tip lie beyond nothing more, but may overhang it.
  double* const tip = &column_[(nodes_ - 1) * stride];
  for (std::size_t j = count_; j > 0 && ranked_[j - 1].overhang_m > 0.0; --j) {
    tip[j - 1] -= ranked_[j - 1].overhang_m * tip_tangent_[1];
    tip[block_columns_ + j - 1] += ranked_[j - 1].overhang_m * tip_tangent_[0];
  }
  for (std::size_t i = 1; i < nodes_; ++i) column_[i * stride + count_] = -r_[i];
  column_[stride + block_columns_ + count_] -= clamped_[0];
  column_[2 * stride + block_columns_ + count_] -= clamped_[1];
}

void Beam::solve_columns() noexcept {
  const std::size_t stride = 2 * block_columns_;
  for (std::size_t i = 2; i < nodes_; ++i) {
    double* __restrict const row = &column_[i * stride];
    const double* __restrict const one = row - stride;
    const double* __restrict const two = row - 2 * stride;
    const double l1 = first_[i];
    const double l2 = i > 2 ? second_[i] : 0.0;
    for (std::size_t k = 0; k < stride; ++k) row[k] -= l1 * one[k] + l2 * two[k];
  }
  for (std::size_t i = nodes_ - 1; i > 0; --i) {
    double* __restrict const row = &column_[i * stride];
    const bool has_one = i + 1 < nodes_;
    const bool has_two = i + 2 < nodes_;
    const double* __restrict const one = has_one ? row + stride : row;
    const double* __restrict const two = has_two ? row + 2 * stride : row;
    const double inverse = 1.0 / diagonal_[i];
    const double l1 = has_one ? first_[i + 1] : 0.0;
    const double l2 = has_two ? second_[i + 2] : 0.0;
    if (has_two)
      for (std::size_t k = 0; k < stride; ++k) row[k] = inverse * row[k] - l1 * one[k] - l2 * two[k];
    else if (has_one)
      for (std::size_t k = 0; k < stride; ++k) row[k] = inverse * row[k] - l1 * one[k];
    else
      for (std::size_t k = 0; k < stride; ++k) row[k] *= inverse;
  }
  std::fill_n(column_.begin(), stride, 0.0);
  column_[block_columns_ + count_] = 1.0;  // the clamp turns with the base
}

// Rank i's row of B from the displacements x, y that all columns give it. Only columns of loads that lie no nearer to the base are used,
// and mirrored: B is symmetric to the bit.
void Beam::emit(std::size_t i, std::span<const double> x, std::span<const double> y, const std::array<double, 3>& axial) noexcept {
  const std::size_t owner = owner_[i];
  const auto put = [&](std::size_t at, std::size_t by, double xx, double xy, double yx, double yy) {
    double* const column = &flexibility_[4 * most_loads * by];
    column[at] = xx;
    column[most_loads + at] = yx;
    column[2 * most_loads + at] = xy;
    column[3 * most_loads + at] = yy;
  };
  for (std::size_t j = i; j < count_; ++j) {
    const double xx = x[j] + axial[0], xy = x[block_columns_ + j] + axial[1], yy = y[block_columns_ + j] + axial[2];
    const double yx = j == i ? xy : y[j] + axial[1];
    put(owner, owner_[j], xx, xy, yx, yy);
    put(owner_[j], owner, xx, yx, xy, yy);
  }
  correction_[owner] = {x[count_], y[count_]};
  by_base_[owner] = {x[block_columns_ + count_], y[block_columns_ + count_]};
}

void Beam::integrate_columns() noexcept {
  const std::size_t stride = 2 * block_columns_;
  alignas(64) std::array<double, most_columns> x_all{};
  alignas(64) std::array<double, most_columns> y_all{};
  std::array<double, 3> axial{};
  std::size_t i = 0;
  // Loads on or before the base: the base alone moves them.
  for (; i < count_ && ranked_[i].after == 0; ++i) {
    emit(i, x_all, y_all, axial);
    const double o = ranked_[i].overhang_m;
    by_base_[owner_[i]] = {-o * base_tangent_[1], o * base_tangent_[0]};
  }
  for (std::size_t v = 0; v < intervals_ && i < count_; ++v) {
    const Interval& interval = interval_[v];
    const double* const rows = &column_[2 * interval.element * stride];
    const Vector2 p0 = interval.lever[0];
    const Vector2 p1 = interval.lever[1];
    const Vector2 p2 = interval.lever[2];
    const std::size_t from = i / lanes * lanes;
    for (std::size_t half = 0; half < 2; ++half) {
      const std::size_t begin = half * block_columns_ + from;
      const std::size_t width = block_columns_ - from;
      const double* __restrict const z0 = rows + begin;
      const double* __restrict const z1 = z0 + stride;
      const double* __restrict const z2 = z1 + stride;
      double* __restrict const x = &x_all[begin];
      double* __restrict const y = &y_all[begin];
      for (std::size_t k = 0; k < width; ++k) {
        x[k] += p0[0] * z0[k] + p1[0] * z1[k] + p2[0] * z2[k];
        y[k] += p0[1] * z0[k] + p1[1] * z1[k] + p2[1] * z2[k];
      }
    }
    for (std::size_t k = 0; k < 3; ++k) axial[k] += interval.axial[k];
    for (; i < count_ && ranked_[i].after == v + 1; ++i) {
      const double o = ranked_[i].overhang_m;
      if (o == 0.0) {
        emit(i, x_all, y_all, axial);
        continue;
      }
      // The rigid continuation turns with the tip.
      const double* const tip = &column_[(nodes_ - 1) * stride];
      std::array<double, most_columns> x{};
      std::array<double, most_columns> y{};
      for (std::size_t k = 0; k < stride; ++k) {
        x[k] = x_all[k] - o * tip_tangent_[1] * tip[k];
        y[k] = y_all[k] + o * tip_tangent_[0] * tip[k];
      }
      emit(i, x, y, axial);
    }
  }
}

Factor Beam::linearise(Tangent tangent) noexcept {
  if (!open_) return {Status::NotOpen};
  const Factor factor = factorise(tangent);
  if (factor.status != Status::Ok) return factor;
  block_columns_ = (count_ + lanes) / lanes * lanes;
  column_of_ = rank_;
  fill_levers();
  solve_columns();
  integrate_columns();
  linear_ = true;
  return factor;
}

// K z = -R, and r_i along z by integrating the levers up to each load.
void Beam::correct() noexcept {
  const std::size_t stride = 2 * block_columns_;
  std::array<double, most_nodes> z{};
  newton_step({z.data(), nodes_});
  for (std::size_t k = 1; k < nodes_; ++k) column_[k * stride + count_] = z[k];
  Vector2 moved{};
  std::size_t i = 0;
  for (; i < count_ && ranked_[i].after == 0; ++i) correction_[owner_[i]] = {};
  for (std::size_t v = 0; v < intervals_ && i < count_; ++v) {
    const Interval& interval = interval_[v];
    for (std::size_t a = 0; a < 3; ++a) {
      const double turned = z[2 * interval.element + a];
      moved = {moved[0] + turned * interval.lever[a][0], moved[1] + turned * interval.lever[a][1]};
    }
    for (; i < count_ && ranked_[i].after == v + 1; ++i) {
      const double swing = ranked_[i].overhang_m * z[nodes_ - 1];
      correction_[owner_[i]] = {moved[0] - swing * tip_tangent_[1], moved[1] + swing * tip_tangent_[0]};
    }
  }
  linear_ = true;
}

void Beam::nudge(double tip_rad) noexcept {
  for (std::size_t k = 1; k < nodes_; ++k) {
    const double part = static_cast<double>(k) / static_cast<double>(nodes_ - 1);
    bend_[k] += tip_rad * part * (2.0 - part);
  }
  linear_ = false;
  (void)assemble();
}

Result Beam::apply(std::span<const Load> loads, std::span<const double> moment_nm) noexcept {
  if (!open_) return {Status::NotOpen};
  if (loads.size() != count_ || !known(loads)) return {Status::NotFinite, 0, residual_nm_};
  if (!linear_) {
    if (const Factor factor = linearise(); factor.status != Status::Ok) return {factor.status, 0, residual_nm_};
  }
  linear_ = false;
  const std::size_t stride = 2 * block_columns_;
  alignas(64) std::array<double, most_columns> change{};
  for (std::size_t j = 0; j < count_; ++j) {
    const Vector2& placed = ranked_[rank_[j]].load.force_n;
    change[column_of_[j]] = loads[j].force_n[0] - placed[0];
    change[block_columns_ + column_of_[j]] = loads[j].force_n[1] - placed[1];
  }
  change[count_] = 1.0;
  std::array<double, most_nodes> step{};
  std::array<double, most_nodes> turned{};
  for (std::size_t j = 0; j < moment_nm.size(); ++j) {
    const Ranked& at = ranked_[rank_[j]];
    for (std::size_t a = 0; a < 3; ++a) turned[2 * at.element + a] += at.shape[a] * moment_nm[j];
  }
  if (!moment_nm.empty()) back_substitute({turned.data(), nodes_});
  double largest = 0.0;
  double sum = 0.0;
  for (std::size_t k = 1; k < nodes_; ++k) {
    const double* const row = &column_[k * stride];
    std::array<double, lanes> part{};
    for (std::size_t c = 0; c < stride; c += lanes)
      for (std::size_t lane = 0; lane < lanes; ++lane) part[lane] += row[c + lane] * change[c + lane];
    step[k] = (part[0] + part[1]) + (part[2] + part[3]) + turned[k];
    largest = std::max(largest, std::abs(step[k]));
    sum += step[k];
  }
  if (!std::isfinite(sum)) return {Status::NotFinite, 0, residual_nm_};
  const std::array<double, most_nodes> before = bend_;
  std::array<Load, most_loads> placed{};
  for (std::size_t j = 0; j < count_; ++j) placed[j] = ranked_[rank_[j]].load;
  const double part = largest > longest_step_rad ? longest_step_rad / largest : 1.0;
  for (std::size_t k = 1; k < nodes_; ++k) bend_[k] += part * step[k];
  if (lay_out(loads)) return {Status::Ok, 1, residual_nm_};
  bend_ = before;
  (void)lay_out({placed.data(), count_});
  return {Status::NotFinite, 0, residual_nm_};
}

Vector2 Beam::rotation(std::size_t i, std::size_t j) const noexcept {
  const Ranked& at = ranked_[rank_[i]];
  const std::size_t stride = 2 * block_columns_;
  const double* const z = &column_[2 * at.element * stride + column_of_[j]];
  Vector2 turned{};
  for (std::size_t a = 0; a < 3; ++a)
    turned = {turned[0] + at.shape[a] * z[a * stride], turned[1] + at.shape[a] * z[a * stride + block_columns_]};
  return turned;
}

Vector2 Beam::tip_rotation(std::size_t j) const noexcept {
  const double* const z = &column_[(nodes_ - 1) * 2 * block_columns_ + column_of_[j]];
  return {z[0], z[block_columns_]};
}

double Beam::rotation_correction(std::size_t i) const noexcept {
  const Ranked& at = ranked_[rank_[i]];
  const std::size_t stride = 2 * block_columns_;
  const double* const z = &column_[2 * at.element * stride + count_];
  return at.shape[0] * z[0] + at.shape[1] * z[stride] + at.shape[2] * z[2 * stride];
}

double Beam::rotation_by_base_angle(std::size_t i) const noexcept {
  const Ranked& at = ranked_[rank_[i]];
  const std::size_t stride = 2 * block_columns_;
  const double* const z = &column_[2 * at.element * stride + block_columns_ + count_];
  return at.shape[0] * z[0] + at.shape[1] * z[stride] + at.shape[2] * z[2 * stride];
}

void Beam::rotations_by_moment(std::size_t j, std::span<double> rotation) const noexcept {
  std::array<double, most_nodes> z{};
  const Ranked& turned = ranked_[rank_[j]];
  for (std::size_t a = 0; a < 3; ++a) z[2 * turned.element + a] = turned.shape[a];
  back_substitute({z.data(), nodes_});
  for (std::size_t i = 0; i < count_; ++i) {
    const Ranked& at = ranked_[rank_[i]];
    const double* const seen = &z[2 * at.element];
    rotation[i] = at.shape[0] * seen[0] + at.shape[1] * seen[1] + at.shape[2] * seen[2];
  }
}

// dR/ds_j is the difference of what N does to the bend on either side of the load; it acts where the load stands.
Slide Beam::slide(std::size_t j) const noexcept {
  const Ranked& at = ranked_[rank_[j]];
  const Vector2& f = at.load.force_n;
  if (at.overhang_m != 0.0 || at.load.arclength_m <= 0.0) {
    const Vector2& t = at.load.arclength_m > 0.0 ? tip_tangent_ : base_tangent_;
    return {dot(f, normal(t)), t, {}};
  }
  Vector2 beyond{};
  for (std::size_t k = rank_[j] + std::size_t{1}; k < count_; ++k)
    beyond = {beyond[0] + ranked_[k].load.force_n[0], beyond[1] + ranked_[k].load.force_n[1]};
  const Vector2 before{beyond[0] + f[0], beyond[1] + f[1]};
  const Vector2 t = direction(theta_rad(j));
  const Vector2 n = normal(t);
  const double inverse_axial = 1.0 / properties_.axial_n;
  const double stretch = 1.0 + dot(before, t) * inverse_axial;
  const double taken = dot(f, t) * inverse_axial;
  return {dot(before, n) * stretch - dot(beyond, n) * (1.0 + dot(beyond, t) * inverse_axial),
          {stretch * t[0], stretch * t[1]},
          {taken * t[0], taken * t[1]}};
}

double Beam::tip_rotation_by_base_angle() const noexcept { return column_[(nodes_ - 1) * 2 * block_columns_ + block_columns_ + count_]; }

}  // namespace trocar::needle
