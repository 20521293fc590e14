#include "common/needle/beam.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "common/needle/directions.hpp"
#include "common/needle/plane.hpp"

namespace trocar::needle {
namespace {

// Gauss points and weights of [0, 1].
constexpr std::array gauss_at{0.11270166537925831, 0.5, 0.88729833462074169};
constexpr std::array gauss_weight{5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

// 3 h / EI times the bending stiffness of an element.
constexpr std::array<std::array<double, 3>, 3> element_bending{{{7.0, -8.0, 1.0}, {-8.0, 16.0, -8.0}, {1.0, -8.0, 7.0}}};

bool positive(double value) noexcept { return std::isfinite(value) && value > 0.0; }
bool finite(const Vector2& v) noexcept { return std::isfinite(v[0]) && std::isfinite(v[1]); }

}  // namespace

const char* to_string(Status status) noexcept {
  switch (status) {
    case Status::Ok:
      return "ok";
    case Status::Unstable:
      return "in unstable equilibrium: more thrust than buckles the needle, and nothing that pushes it to a side";
    case Status::NotConverged:
      return "out of iterations";
    case Status::CapacityReached:
      return "more loads than the capacity";
    case Status::NotFinite:
      return "not finite";
    case Status::NotOpen:
      break;
  }
  return "no properties that a needle can have";
}

Status Beam::open(const Properties& properties) noexcept {
  open_ = positive(properties.length_m) && positive(properties.bending_nm2) && positive(properties.axial_n) &&
          std::isfinite(properties.curvature_per_m) && properties.elements >= 1 && properties.elements <= capacity::needle_elements;
  if (!open_) return Status::NotOpen;
  properties_ = properties;
  nodes_ = 2 * properties.elements + 1;
  reset();
  // So that everything can be asked for.
  return place({}, {}).status;
}

void Beam::reset() noexcept {
  for (std::size_t k = 0; k < nodes_; ++k) bend_[k] = properties_.curvature_per_m * node_arclength_m(k);
}

double Beam::node_arclength_m(std::size_t k) const noexcept {
  return properties_.length_m * static_cast<double>(k) / static_cast<double>(2 * properties_.elements);
}

Beam::Shape Beam::shape_at(std::size_t element, double arclength_m) const noexcept {
  const double xi = (arclength_m - node_arclength_m(2 * element)) / element_m();
  return {(1.0 - xi) * (1.0 - 2.0 * xi), 4.0 * xi * (1.0 - xi), xi * (2.0 * xi - 1.0)};
}

double Beam::bend_at(std::size_t element, const Shape& shape) const noexcept {
  const double* const b = &bend_[2 * element];
  return shape[0] * b[0] + shape[1] * b[1] + shape[2] * b[2];
}

// Loads in order of arclength; equal ones keep their order.
void Beam::rank(std::span<const Load> loads) noexcept {
  count_ = loads.size();
  for (std::size_t i = 0; i < count_; ++i) {
    std::size_t at = i;
    for (; at > 0 && loads[owner_[at - 1]].arclength_m > loads[i].arclength_m; --at) owner_[at] = owner_[at - 1];
    owner_[at] = static_cast<std::uint16_t>(i);
  }
  const double length = properties_.length_m;
  for (std::size_t j = 0; j < count_; ++j) {
    Ranked& ranked = ranked_[j];
    rank_[owner_[j]] = static_cast<std::uint16_t>(j);
    ranked.load = loads[owner_[j]];
    const double s = ranked.load.arclength_m;
    ranked.overhang_m = s > length ? s - length : std::min(s, 0.0);
    const double inside = std::clamp(s, 0.0, length);
    const auto element = std::min(static_cast<std::size_t>(inside / element_m()), properties_.elements - 1);
    ranked.element = element;
    ranked.shape = s >= length ? Shape{0.0, 0.0, 1.0} : s <= 0.0 ? Shape{1.0, 0.0, 0.0} : shape_at(element, s);
  }
}

// Intervals between element ends and loads.
void Beam::cut() noexcept {
  intervals_ = 0;
  std::size_t next = 0;
  double from = 0.0;
  const auto pass = [&](double to) {  // loads that lie at or before `to`
    for (; next < count_ && ranked_[next].load.arclength_m <= to; ++next) ranked_[next].after = static_cast<std::uint16_t>(intervals_);
  };
  pass(0.0);
  for (std::size_t e = 0; e < properties_.elements; ++e) {
    const double end = node_arclength_m(2 * (e + 1));
    while (from < end) {
      const double load_at = next < count_ ? ranked_[next].load.arclength_m : end;
      Interval& interval = interval_[intervals_];
      interval.from_m = from;
      interval.to_m = std::min(load_at, end);
      interval.element = e;
      interval.next = static_cast<std::uint16_t>(next);
      for (std::size_t g = 0; g < gauss_points; ++g) {
        const double width = interval.to_m - from;
        interval.point[g].weight_m = width * gauss_weight[g];
        interval.point[g].shape = shape_at(e, from + width * gauss_at[g]);
      }
      ++intervals_;
      from = interval.to_m;
      pass(from);
    }
  }
  pass(std::numeric_limits<double>::infinity());
}

// N of each interval.
void Beam::share_out() noexcept {
  Vector2 n{};
  std::size_t j = count_;
  for (std::size_t v = intervals_; v-- > 0;) {
    for (; j > interval_[v].next; --j) n = {n[0] + ranked_[j - 1].load.force_n[0], n[1] + ranked_[j - 1].load.force_n[1]};
    interval_[v].force_n = n;
  }
  for (; j > 0; --j) n = {n[0] + ranked_[j - 1].load.force_n[0], n[1] + ranked_[j - 1].load.force_n[1]};
  clamp_n_ = n;
}

// Energy, R, positions, and what each interval gives to K, P and the axial flexibility. False when something is not finite.
bool Beam::assemble() noexcept {
  const double stiffness = properties_.bending_nm2 / (3.0 * element_m());
  const double preload_nm = properties_.bending_nm2 * properties_.curvature_per_m;
  const double inverse_axial = 1.0 / properties_.axial_n;
  std::fill_n(r_.begin(), nodes_, 0.0);
  double bending_j = 0.0;
  for (std::size_t e = 0; e < properties_.elements; ++e) {
    // Differences along the element: a rigid rotation gives exactly nothing.
    const double* const b = &bend_[2 * e];
    const double u = b[1] - b[0];
    const double v = b[2] - b[1];
    const double at[3] = {v - 7.0 * u, 8.0 * (u - v), 7.0 * v - u};
    for (std::size_t a = 0; a < 3; ++a) r_[2 * e + a] += stiffness * at[a];
    bending_j += 0.5 * stiffness * (7.0 * u * u - 2.0 * u * v + 7.0 * v * v);
  }
  r_[0] += preload_nm;
  r_[nodes_ - 1] -= preload_nm;
  const double relaxed_j = preload_nm * (bend_[nodes_ - 1] - bend_[0]);
  double work_j = 0.0;

  base_tangent_ = direction(base_.theta_rad);
  tip_tangent_ = direction(base_.theta_rad + bend_[nodes_ - 1]);
  Vector2 at_m{base_.x_m, base_.y_m};
  std::size_t g = 0;
  for (std::size_t v = 0; v < intervals_; ++v)
    for (const Point& point : interval_[v].point) angle_[g++] = base_.theta_rad + bend_at(interval_[v].element, point.shape);
  directions(angle_.data(), cosine_.data(), sine_.data(), g);
  g = 0;
  for (std::size_t v = 0; v < intervals_; ++v) {
    Interval& interval = interval_[v];
    interval.start_m = at_m;
    interval.lever = {};
    interval.axial = {};
    double* const r = &r_[2 * interval.element];
    for (Point& point : interval.point) {
      const Vector2 t{cosine_[g], sine_[g]};
      ++g;
      const double along = dot(interval.force_n, t);
      const double across = dot(interval.force_n, normal(t));
      const double stretch = 1.0 + along * inverse_axial;
      const double bent = across * inverse_axial;
      const double w = point.weight_m;
      at_m = {at_m[0] + w * stretch * t[0], at_m[1] + w * stretch * t[1]};
      work_j += w * along * (1.0 + 0.5 * along * inverse_axial);
      point.geometric_n = w * (along + (along * along - across * across) * inverse_axial);
      const Vector2 lever{w * (bent * t[0] - stretch * t[1]), w * (bent * t[1] + stretch * t[0])};
      for (std::size_t a = 0; a < 3; ++a) {
        r[a] -= w * across * stretch * point.shape[a];
        interval.lever[a] = {interval.lever[a][0] + point.shape[a] * lever[0], interval.lever[a][1] + point.shape[a] * lever[1]};
      }
      const double c = w * inverse_axial;
      interval.axial = {interval.axial[0] + c * t[0] * t[0], interval.axial[1] + c * t[0] * t[1], interval.axial[2] + c * t[1] * t[1]};
    }
  }
  tip_m_ = at_m;

  overhang_geometric_nm_ = 0.0;
  double scale_j = bending_j + std::abs(relaxed_j);
  for (std::size_t j = 0; j < count_; ++j) {
    const Ranked& ranked = ranked_[j];
    const double o = ranked.overhang_m;
    const Vector2& f = ranked.load.force_n;
    const Vector2 from = ranked.after < intervals_ ? interval_[ranked.after].start_m : tip_m_;
    const Vector2& t = o > 0.0 ? tip_tangent_ : base_tangent_;
    position_[j] = {from[0] + o * t[0], from[1] + o * t[1]};
    if (o != 0.0) {
      r_[o > 0.0 ? nodes_ - 1 : 0] -= o * dot(f, normal(t));
      work_j += o * dot(f, t);
      if (o > 0.0) overhang_geometric_nm_ += o * dot(f, t);
    }
    const double moment = ranked.load.moment_nm;
    for (std::size_t a = 0; a < 3; ++a) r_[2 * ranked.element + a] -= moment * ranked.shape[a];
    const double turned_j = moment * bend_at(ranked.element, ranked.shape);
    work_j += turned_j;
    scale_j += std::abs(turned_j) + (std::abs(f[0]) + std::abs(f[1])) * std::abs(ranked.load.arclength_m);
  }
  energy_j_ = bending_j - relaxed_j - work_j;
  energy_noise_j_ = tolerance(1e-14, 5e-6) * scale_j;
  residual_nm_ = 0.0;
  double sum = 0.0;  // NaN does not pass through max
  for (std::size_t k = 1; k < nodes_; ++k) {
    residual_nm_ = std::max(residual_nm_, std::abs(r_[k]));
    sum += r_[k];
  }
  return std::isfinite(energy_j_) && std::isfinite(scale_j) && std::isfinite(sum) && std::isfinite(r_[0]) && finite(tip_m_) &&
         finite(clamp_n_);
}

bool Beam::known(std::span<const Load> loads) noexcept {
  bool all = true;
  for (const Load& load : loads) all = all && std::isfinite(load.arclength_m) && finite(load.force_n) && std::isfinite(load.moment_nm);
  return all;
}

Result Beam::place(const Pose& base, std::span<const Load> loads) noexcept {
  if (!open_) return {Status::NotOpen};
  if (loads.size() > most_loads) return {Status::CapacityReached};
  if (!std::isfinite(base.x_m) || !std::isfinite(base.y_m) || !std::isfinite(base.theta_rad) || !known(loads)) return {Status::NotFinite};
  linear_ = false;
  base_ = base;
  if (lay_out(loads)) return {Status::Ok, 0, residual_nm_};
  // Forces so large that they overflow: without them there is always a state.
  (void)lay_out({});
  return {Status::NotFinite};
}

bool Beam::lay_out(std::span<const Load> loads) noexcept {
  rank(loads);
  cut();
  share_out();
  return assemble();
}

// K = L D L^T by rows.
Factor Beam::factorise(Tangent tangent) noexcept {
  const double bending = properties_.bending_nm2 / (3.0 * element_m());
  std::fill_n(diagonal_.begin(), nodes_, 0.0);
  std::fill_n(first_.begin(), nodes_, 0.0);
  std::fill_n(second_.begin(), nodes_, 0.0);
  for (std::size_t e = 0; e < properties_.elements; ++e) {
    double* const d = &diagonal_[2 * e];
    d[0] += bending * element_bending[0][0];
    d[1] += bending * element_bending[1][1];
    d[2] += bending * element_bending[2][2];
    first_[2 * e + 1] += bending * element_bending[1][0];
    first_[2 * e + 2] += bending * element_bending[2][1];
    second_[2 * e + 2] += bending * element_bending[2][0];
  }
  const bool convex = tangent == Tangent::Convex;
  for (std::size_t v = 0; v < intervals_; ++v) {
    const std::size_t node = 2 * interval_[v].element;
    for (const Point& point : interval_[v].point) {
      const double c = convex ? std::max(point.geometric_n, 0.0) : point.geometric_n;
      const Shape& n = point.shape;
      diagonal_[node] += c * n[0] * n[0];
      diagonal_[node + 1] += c * n[1] * n[1];
      diagonal_[node + 2] += c * n[2] * n[2];
      first_[node + 1] += c * n[1] * n[0];
      first_[node + 2] += c * n[2] * n[1];
      second_[node + 2] += c * n[2] * n[0];
    }
  }
  diagonal_[nodes_ - 1] += convex ? std::max(overhang_geometric_nm_, 0.0) : overhang_geometric_nm_;
  clamped_ = {first_[1], second_[2]};

  Factor factor;
  first_[1] = second_[2] = 0.0;
  diagonal_[0] = 0.0;
  for (std::size_t i = 1; i < nodes_; ++i) {
    const double k1 = first_[i] - (i > 1 ? second_[i] * first_[i - 1] : 0.0);
    const double l2 = i > 2 ? second_[i] / diagonal_[i - 2] : 0.0;
    const double l1 = i > 1 ? k1 / diagonal_[i - 1] : 0.0;
    const double whole = std::abs(diagonal_[i]) + bending;
    double pivot = diagonal_[i] - l1 * k1 - l2 * second_[i];
    const double least = tolerance(1e-13, 5e-5) * whole;
    if (std::abs(pivot) < least) {
      pivot = least;
      factor.singular = true;
    }
    if (pivot < 0.0) ++factor.negative_pivots;
    diagonal_[i] = pivot;
    first_[i] = l1;
    second_[i] = l2;
  }
  if (!std::isfinite(diagonal_[nodes_ - 1])) factor.status = Status::NotFinite;
  return factor;
}

// step = -K^-1 R, with 0 at the clamp.
void Beam::newton_step(std::span<double> step) const noexcept {
  for (std::size_t i = 1; i < nodes_; ++i) step[i] = -r_[i];
  back_substitute(step);
}

// K^-1 in place, with 0 at the clamp.
void Beam::back_substitute(std::span<double> step) const noexcept {
  step[0] = 0.0;
  for (std::size_t i = 1; i < nodes_; ++i) step[i] -= first_[i] * step[i - 1] + (i > 1 ? second_[i] * step[i - 2] : 0.0);
  for (std::size_t i = nodes_ - 1; i > 0; --i) {
    step[i] /= diagonal_[i];
    if (i + 1 < nodes_) step[i] -= first_[i + 1] * step[i + 1];
    if (i + 2 < nodes_) step[i] -= second_[i + 2] * step[i + 2];
  }
}

// L^-T times the unit vector of a negative pivot: K is negative along it. Turned so that the energy does not rise along it.
void Beam::negative_curvature(std::span<double> along) const noexcept {
  std::fill(along.begin(), along.end(), 0.0);
  std::size_t pivot = nodes_ - 1;
  while (pivot > 1 && diagonal_[pivot] >= 0.0) --pivot;
  along[pivot] = 1.0;
  double slope = r_[pivot];
  double largest = 1.0;
  for (std::size_t i = pivot; i-- > 1;) {
    along[i] = -first_[i + 1] * along[i + 1] - (i + 2 <= pivot ? second_[i + 2] * along[i + 2] : 0.0);
    slope += r_[i] * along[i];
    largest = std::max(largest, std::abs(along[i]));
  }
  const double scale = (slope > 0.0 ? -1.0 : 1.0) / largest;
  for (double& value : along) value *= scale;
}

Result Beam::solve(const Pose& base, std::span<const Load> loads) noexcept {
  const std::array<double, most_nodes> before = bend_;
  Result result = place(base, loads);
  if (result.status != Status::Ok) return result;
  std::array<double, most_nodes> from{};
  std::array<double, most_nodes> step{};
  std::array<double, most_nodes> down{};
  const std::span<double> s(step.data(), nodes_);
  const auto end_with = [&](Status status) {
    result.status = status;
    result.residual_nm = residual_nm_;
    return result;
  };
  const auto not_finite = [&] {
    bend_ = before;
    (void)place(base, {});
    result.status = Status::NotFinite;
    result.residual_nm = 0.0;
    return result;
  };
  while (result.iterations < max_iterations) {
    Factor factor = factorise(Tangent::Exact);
    const bool indefinite = factor.negative_pivots > 0;
    double escape = 0.0;
    if (indefinite) {
      newton_step(s);
      double largest = 0.0;
      for (const double value : s) largest = std::max(largest, std::abs(value));
      // At a saddle exactly, nothing says to which side.
      if (largest <= tolerance(1e-12, 1e-5)) return end_with(Status::Unstable);
      negative_curvature({down.data(), nodes_});
      escape = 0.5 * std::min(1.0, 1e3 * largest);
      factor = factorise(Tangent::Convex);
    }
    if (factor.status != Status::Ok) return not_finite();
    newton_step(s);
    double largest = 0.0;
    for (std::size_t k = 0; k < nodes_; ++k) {
      if (escape > 0.0) step[k] += escape * down[k];
      largest = std::max(largest, std::abs(step[k]));
    }
    if (!std::isfinite(largest)) return not_finite();
    double slope_j = 0.0;
    for (std::size_t k = 1; k < nodes_; ++k) slope_j += r_[k] * step[k];
    const double energy_j = energy_j_;
    const double noise_j = energy_noise_j_;
    from = bend_;
    const bool last = !indefinite && largest <= correction_rad;
    double part = std::min(1.0, longest_step_rad / largest);
    bool taken = false;
    while (result.iterations < max_iterations && !taken) {
      ++result.iterations;
      for (std::size_t k = 1; k < nodes_; ++k) bend_[k] = from[k] + part * step[k];
      const bool known = assemble();
      taken = last || (known && energy_j_ <= energy_j + 1e-4 * part * slope_j + noise_j);
      part *= 0.5;
    }
    if (!taken) {
      bend_ = from;
      (void)assemble();
      return end_with(Status::NotConverged);
    }
    if (last) return end_with(Status::Ok);
  }
  return end_with(Status::NotConverged);
}

double Beam::theta_rad(std::size_t i) const noexcept {
  const Ranked& ranked = ranked_[rank_[i]];
  return base_.theta_rad + bend_at(ranked.element, ranked.shape);
}

Station Beam::at(double arclength_m) const noexcept {
  Station station;
  const double length = properties_.length_m;
  if (!(arclength_m > 0.0) || arclength_m >= length) {
    const bool before = !(arclength_m >= length);
    const double beyond = before ? arclength_m : arclength_m - length;
    station.tangent = before ? base_tangent_ : tip_tangent_;
    station.theta_rad = base_.theta_rad + (before ? 0.0 : bend_[nodes_ - 1]);
    const Vector2 from = before ? Vector2{base_.x_m, base_.y_m} : tip_m_;
    station.position_m = {from[0] + beyond * station.tangent[0], from[1] + beyond * station.tangent[1]};
    return station;
  }
  const auto begin = interval_.begin();
  const auto found = std::partition_point(begin, begin + static_cast<std::ptrdiff_t>(intervals_),
                                          [&](const Interval& interval) { return interval.to_m < arclength_m; });
  const Interval& interval = *found;
  const double width = arclength_m - interval.from_m;
  station.position_m = interval.start_m;
  for (std::size_t g = 0; g < gauss_points; ++g) {
    const Shape shape = shape_at(interval.element, interval.from_m + width * gauss_at[g]);
    const Vector2 t = direction(base_.theta_rad + bend_at(interval.element, shape));
    const double w = width * gauss_weight[g] * (1.0 + dot(interval.force_n, t) / properties_.axial_n);
    station.position_m = {station.position_m[0] + w * t[0], station.position_m[1] + w * t[1]};
  }
  station.theta_rad = base_.theta_rad + bend_at(interval.element, shape_at(interval.element, arclength_m));
  station.tangent = direction(station.theta_rad);
  station.stretch = 1.0 + dot(interval.force_n, station.tangent) / properties_.axial_n;
  const double xi = (arclength_m - node_arclength_m(2 * interval.element)) / element_m();
  const double* const b = &bend_[2 * interval.element];
  station.curvature_per_m = ((4.0 * xi - 3.0) * (b[0] - b[1]) + (4.0 * xi - 1.0) * (b[2] - b[1])) / element_m();
  return station;
}

Wrench Beam::reaction() const noexcept { return {0.0 - clamp_n_[0], 0.0 - clamp_n_[1], r_[0]}; }

}  // namespace trocar::needle
