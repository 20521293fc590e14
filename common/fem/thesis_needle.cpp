#include "common/fem/thesis_needle.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <type_traits>
#include <utility>

#include "common/fem/tissue.hpp"

namespace trocar::fem {

using Eigen::VectorXd;

namespace {

void require(bool valid, const char* name, double value, const char* remedy) {
  char number[32];
  std::snprintf(number, sizeof number, "%.6g", value);
  if (!valid) throw Error(std::string("thesis needle: ") + name + " = " + number + ": " + remedy);
}

// Of every fourth number in a column or a vector. Eigen's own vectors are aligned to what the target's instructions want, at most.
constexpr int aligned = std::min<int>(Eigen::AlignedMax, Eigen::Aligned32);

// NaN when an entry is.
double largest(const Eigen::Ref<const VectorXd>& v) { return v.cwiseAbs().maxCoeff<Eigen::PropagateNaN>(); }

}  // namespace

// Of u in a triangle, over x and y; and what follows from them.
struct ThesisNeedle::Slopes {
  double ux{}, vx{}, uy{}, vy{};

  [[nodiscard]] double xx() const { return ux + 0.5 * (ux * ux + vx * vx); }
  [[nodiscard]] double yy() const { return vy + 0.5 * (uy * uy + vy * vy); }
  [[nodiscard]] double xy() const { return uy + vx + ux * uy + vx * vy; }
};

ThesisNeedle::ThesisNeedle(const ThesisNeedleProperties& properties) : properties_(properties) {
  const auto& p = properties_;
  const auto positive = [](double value) { return value > 0.0 && std::isfinite(value); };
  require(positive(p.length_m), "length_m", p.length_m, "must be positive");
  require(positive(p.depth_m), "depth_m", p.depth_m, "must be positive");
  require(positive(p.thickness_m), "thickness_m", p.thickness_m, "must be positive");
  require(positive(p.young_pa), "young_pa", p.young_pa, "must be positive");
  require(p.poisson >= 0.0 && p.poisson < 0.5, "poisson", p.poisson, "must be from 0 to below 0.5");
  require(p.elements >= 1 && p.elements <= 100000, "elements", p.elements, "must be from 1 to 100000");

  moduli_.normal = p.young_pa / (1 - p.poisson * p.poisson);
  moduli_.coupled = p.poisson * moduli_.normal;
  moduli_.shear = p.young_pa / (2 * (1 + p.poisson));
  along_m_ = p.length_m / p.elements;
  across_m_ = p.depth_m / (across - 1);
  per_along_ = 1.0 / along_m_;
  per_across_ = 1.0 / across_m_;
  volume_m3_ = 0.5 * along_m_ * across_m_ * p.thickness_m;

  const Eigen::Index size = Eigen::Index{2} * across * stations();
  for (VectorXd* v : {&load_, &u_, &kept_, &residual_}) v->setZero(size);
  step_.setZero(size + window);
  linear_.column.resize(static_cast<std::size_t>(size + window), Column{});
  linear_.inverse_pivot.resize(static_cast<std::size_t>(size), 0.0);
  tangent_ = linear_;
  stress_.resize(std::size_t{2} * (across - 1) * static_cast<std::size_t>(p.elements));
  assemble(u_, nullptr, linear_, residual_);
  factor(linear_);
}

void ThesisNeedle::set_forces(std::span<const Force> forces) {
  load_.setZero();
  for (const Force& f : forces) {
    require(f.arclength_m >= 0.0 && f.arclength_m <= properties_.length_m, "arclength_m", f.arclength_m, "must be on the needle");
    for (const double component : f.force_n) require(std::isfinite(component), "force_n", component, "must be finite");
    const double at = f.arclength_m / along_m_;
    const int before = std::min(static_cast<int>(at), properties_.elements - 1);
    const double after_part = std::min(at - before, 1.0);
    for (const int j : {across / 2 - 1, across / 2})
      for (int a = 0; a < 2; ++a) {
        const double half = 0.5 * f.force_n[static_cast<std::size_t>(a)];
        load_(2 * (before * across + j) + a) += (1.0 - after_part) * half;
        load_(2 * ((before + 1) * across + j) + a) += after_part * half;
      }
  }
}

// A right triangle's slopes are differences along its two legs. Its nodes in the order in which the legs meet: first, corner, last.
template <ThesisNeedle::Direction direction>
ThesisNeedle::Slopes ThesisNeedle::slopes(const VectorXd& u, int node) const {
  constexpr bool along_first = direction == Direction::AlongThenAcross;
  const double* first = u.data() + 2 * node;
  const double* corner = first + (along_first ? 2 * across : 2);
  const double* last = first + 2 * across + 2;
  const double* x0 = along_first ? first : corner;
  const double* x1 = along_first ? corner : last;
  const double* y0 = along_first ? corner : first;
  const double* y1 = along_first ? last : corner;
  const double x = per_along_, y = per_across_;
  return {x * (x1[0] - x0[0]), x * (x1[1] - x0[1]), y * (y1[0] - y0[0]), y * (y1[1] - y0[1])};
}

// visit.operator()<direction>(triangle, its first node)
template <class Visit>
void ThesisNeedle::each_triangle(const Visit& visit) const {
  std::size_t triangle = 0;
  for (int i = 0; i < properties_.elements; ++i)
    for (int j = 0; j + 1 < across; ++j) {
      visit.template operator()<Direction::AlongThenAcross>(triangle++, i * across + j);
      visit.template operator()<Direction::AcrossThenAlong>(triangle++, i * across + j);
    }
}

ThesisNeedle::Stress ThesisNeedle::stress_of(double xx, double yy, double xy) const {
  return {moduli_.normal * xx + moduli_.coupled * yy, moduli_.coupled * xx + moduli_.normal * yy, moduli_.shear * xy};
}

// Of a triangle with the second Piola-Kirchhoff stress s: F S is what its legs pull with. f: of the first node.
template <ThesisNeedle::Direction direction>
void ThesisNeedle::subtract_force(const Slopes& h, const Stress& s, double* f) const {
  constexpr bool along_first = direction == Direction::AlongThenAcross;
  constexpr int corner = along_first ? 2 * across : 2, last = 2 * across + 2;
  const double ax = volume_m3_ * per_along_, ay = volume_m3_ * per_across_;
  const double along[2] = {ax * ((1 + h.ux) * s[0] + h.uy * s[2]), ax * (h.vx * s[0] + (1 + h.vy) * s[2])};
  const double over[2] = {ay * ((1 + h.ux) * s[2] + h.uy * s[1]), ay * (h.vx * s[2] + (1 + h.vy) * s[1])};
  for (int a = 0; a < 2; ++a) {
    const double one = along_first ? along[a] : over[a], two = along_first ? over[a] : along[a];
    f[a] += one;
    f[corner + a] += two - one;
    f[last + a] -= two;
  }
}

// residual -= f_int(u), and K(u) in k. `stress`, when given, stands in for C E(u) in the geometric part of K.
void ThesisNeedle::assemble(const VectorXd& u, const Stress* stress, Matrix& k, VectorXd& residual) const {
  for (Column& column : k.column) column.row.fill(0.0);
  const double axx = volume_m3_ * per_along_ * per_along_, axy = volume_m3_ * per_along_ * per_across_,
               ayy = volume_m3_ * per_across_ * per_across_;
  const auto [normal, coupled, shear] = moduli_;
  double* const r = residual.data();
  each_triangle([&]<Direction direction>(std::size_t triangle, int node) {
    constexpr bool along_first = direction == Direction::AlongThenAcross;
    constexpr int corner = along_first ? 2 * across : 2, last = 2 * across + 2;
    const Slopes h = slopes<direction>(u, node);
    const double fxx = 1.0 + h.ux, fxy = h.uy, fyx = h.vx, fyy = 1.0 + h.vy;
    Stress s = stress_of(h.xx(), h.yy(), h.xy());
    subtract_force<direction>(h, s, r + 2 * node);
    if (stress != nullptr) s = stress[triangle];

    // Second derivatives of the energy by the legs' differences: x x, y y, x y.
    const double x00 = axx * (normal * fxx * fxx + shear * fxy * fxy + s[0]);
    const double x01 = axx * (normal * fxx * fyx + shear * fxy * fyy);
    const double x11 = axx * (normal * fyx * fyx + shear * fyy * fyy + s[0]);
    const double y00 = ayy * (normal * fxy * fxy + shear * fxx * fxx + s[1]);
    const double y01 = ayy * (normal * fxy * fyy + shear * fxx * fyx);
    const double y11 = ayy * (normal * fyy * fyy + shear * fyx * fyx + s[1]);
    const double m00 = axy * ((coupled + shear) * fxx * fxy + s[2]);
    const double m01 = axy * (coupled * fxx * fyy + shear * fxy * fyx);
    const double m10 = axy * (coupled * fyx * fxy + shear * fyy * fxx);
    const double m11 = axy * ((coupled + shear) * fyx * fyy + s[2]);

    // Of the first leg (p) and the second (q): first node -p, corner p - q, last q.
    const double p00 = along_first ? x00 : y00, p01 = along_first ? x01 : y01, p11 = along_first ? x11 : y11;
    const double q00 = along_first ? y00 : x00, q01 = along_first ? y01 : x01, q11 = along_first ? y11 : x11;
    const double b01 = along_first ? m01 : m10, b10 = along_first ? m10 : m01;  // row p, column q
    const auto at = [&](int column) {
      const int c = 2 * node + column;
      return k.column[static_cast<std::size_t>(c)].row.data() + c % 4;
    };
    double* const first0 = at(0);
    double* const first1 = at(1);
    first0[0] += p00;
    first0[1] += p01;
    first1[0] += p11;
    first0[corner] += m00 - p00;
    first0[corner + 1] += b01 - p01;
    first1[corner - 1] += b10 - p01;
    first1[corner] += m11 - p11;
    first0[last] -= m00;
    first0[last + 1] -= b01;
    first1[last - 1] -= b10;
    first1[last] -= m11;
    double* const corner0 = at(corner);
    double* const corner1 = at(corner + 1);
    corner0[0] += p00 - 2 * m00 + q00;
    corner0[1] += p01 - b01 - b10 + q01;
    corner1[0] += p11 - 2 * m11 + q11;
    constexpr int leg = last - corner;
    corner0[leg] += m00 - q00;
    corner0[leg + 1] += b01 - q01;
    corner1[leg - 1] += b10 - q01;
    corner1[leg] += m11 - q11;
    double* const last0 = at(last);
    last0[0] += q00;
    last0[1] += q01;
    at(last + 1)[0] += q11;
  });
}

void ThesisNeedle::subtract_internal_force(const VectorXd& u, VectorXd& residual) const {
  each_triangle([&]<Direction direction>(std::size_t, int node) {
    const Slopes h = slopes<direction>(u, node);
    subtract_force<direction>(h, stress_of(h.xx(), h.yy(), h.xy()), residual.data() + 2 * node);
  });
}

// C (E(u) + E'(u) step) of every triangle.
void ThesisNeedle::predict_stress() {
  each_triangle([&]<Direction direction>(std::size_t triangle, int node) {
    const Slopes h = slopes<direction>(u_, node), d = slopes<direction>(step_, node);
    stress_[triangle] = stress_of(h.xx() + (1 + h.ux) * d.ux + h.vx * d.vx, h.yy() + (1 + h.vy) * d.vy + h.uy * d.uy,
                                  h.xy() + (1 + h.ux) * d.uy + h.uy * d.ux + h.vx * d.vy + (1 + h.vy) * d.vx);
  });
}

bool ThesisNeedle::inverted() const {
  bool any = false;
  each_triangle([&]<Direction direction>(std::size_t, int node) {
    const Slopes h = slopes<direction>(u_, node);
    any = any || !((1 + h.ux) * (1 + h.vy) - h.uy * h.vx > 0.0);
  });
  return any;
}

// Subtracts column k[0] from the ones that it reaches. phase: its number modulo 4.
template <int phase>
bool ThesisNeedle::eliminate(Column* k, double& inverse_pivot) {
  constexpr int end = (phase + band - 1) / 4 * 4 + 4;  // the rows behind are zero
  using Rows = Eigen::Array<double, end, 1>;
  Eigen::Map<Rows, aligned> l(k[0].row.data());
  const Rows from = l;
  inverse_pivot = 1.0 / from(phase);
  Rows part = inverse_pivot * from;
  part.template head<phase + 1>().setZero();
  l = part;
  [&]<int... index>(std::integer_sequence<int, index...>) {
    const auto subtract = [&]<int row>(std::integral_constant<int, row>) {
      constexpr int first = row / 4 * 4;
      Eigen::Map<Eigen::Array<double, end - first, 1>, aligned>(k[row - phase].row.data()) -= part(row) * from.template tail<end - first>();
    };
    (subtract(std::integral_constant<int, phase + 1 + index>{}), ...);
  }
  (std::make_integer_sequence<int, band - 1>{});
  return from(phase) > 0.0;
}

int ThesisNeedle::factor(Matrix& k) const {
  int not_positive = 0;
  const auto size = static_cast<std::size_t>(u_.size());
  for (std::size_t c = clamped; c < size; c += 4) {
    Column* const column = &k.column[c];
    double* const inverse = &k.inverse_pivot[c];
    not_positive += eliminate<0>(column, inverse[0]) ? 0 : 1;
    not_positive += eliminate<1>(column + 1, inverse[1]) ? 0 : 1;
    not_positive += eliminate<2>(column + 2, inverse[2]) ? 0 : 1;
    not_positive += eliminate<3>(column + 3, inverse[3]) ? 0 : 1;
  }
  return not_positive;
}

void ThesisNeedle::solve(const Matrix& factored, const VectorXd& right, VectorXd& x) const {
  using Rows = Eigen::Matrix<double, window, 1>;
  using Later = Eigen::Matrix<double, window - 4, 1>;
  const Eigen::Index size = right.size();
  x.head<clamped>().setZero();
  x.segment(clamped, size - clamped) = right.tail(size - clamped);
  x.tail<window>().setZero();
  const auto l = [&](Eigen::Index column) { return factored.column[static_cast<std::size_t>(column)].row.data(); };
  for (Eigen::Index four = clamped; four < size; four += 4) {
    Eigen::Map<Rows, aligned> rows(x.data() + four);
    for (int i = 0; i < 4; ++i) rows -= rows(i) * Eigen::Map<const Rows, aligned>(l(four + i));
  }
  for (Eigen::Index four = size - 4; four >= clamped; four -= 4) {
    const Eigen::Map<const Later, aligned> later(x.data() + four + 4);
    double now[4];
    for (int i = 3; i >= 0; --i) {
      now[i] = factored.inverse_pivot[static_cast<std::size_t>(four + i)] * x(four + i) -
               Eigen::Map<const Later, aligned>(l(four + i) + 4).dot(later);
      for (int j = i + 1; j < 4; ++j) now[i] -= l(four + i)[j] * now[j];
    }
    for (int i = 0; i < 4; ++i) x(four + i) = now[i];
  }
}

ThesisNeedle::Result ThesisNeedle::fixed_point(const FixedPointOptions& options) {
  u_.setZero();
  Result result{Status::NotConverged, 0, 0.0, 0.0, 1, 1.0};
  while (result.iterations < options.max_iterations) {
    residual_ = load_;
    subtract_internal_force(u_, residual_);
    solve(linear_, residual_, step_);
    ++result.iterations;
    result.step_m = largest(step_);
    u_ += step_.head(u_.size());
    // The first step is the linear answer, which may be as long as it likes.
    if (!std::isfinite(result.step_m) || (result.iterations > 1 && result.step_m > 10.0 * properties_.length_m)) {
      result.status = Status::Diverged;
      break;
    }
    if (result.step_m <= options.tolerance * largest(u_)) {
      result.status = Status::Converged;
      break;
    }
  }
  residual_ = load_;
  subtract_internal_force(u_, residual_);
  result.residual_n = largest(residual_.tail(residual_.size() - clamped));
  return result;
}

// Newton from u_, whichever load that balances, to `fraction` of the load.
ThesisNeedle::Status ThesisNeedle::advance(double fraction, const NewtonOptions& options, Result& result) {
  for (int iteration = 0; iteration < options.max_iterations; ++iteration) {
    residual_ = fraction * load_;
    assemble(u_, options.predicted_stress && iteration > 0 ? stress_.data() : nullptr, tangent_, residual_);
    const int not_positive = factor(tangent_);
    solve(tangent_, residual_, step_);
    ++result.iterations;
    result.step_m = largest(step_);
    // An infinite stiffness makes a step of zero.
    if (!std::isfinite(result.step_m) || !residual_.allFinite()) return Status::NotConverged;
    if (options.predicted_stress) predict_stress();
    u_ += step_.head(u_.size());
    if (result.step_m > options.tolerance * properties_.length_m) continue;
    if (not_positive > 0) return Status::Unstable;
    return inverted() ? Status::Inverted : Status::Converged;
  }
  return Status::NotConverged;
}

ThesisNeedle::Result ThesisNeedle::newton(const NewtonOptions& options) {
  u_.setZero();
  Result result;
  double part = 1.0;
  const double shortest = std::ldexp(1.0 - 1e-9, -options.max_halvings);
  while (result.load_fraction < 1.0) {
    kept_ = u_;
    const double target = std::min(1.0, result.load_fraction + part);
    result.status = advance(target, options, result);
    if (result.status == Status::Converged) {
      result.load_fraction = target;
      ++result.load_steps;
      continue;
    }
    u_ = kept_;
    part *= 0.5;
    if (part < shortest) break;
  }
  residual_ = result.load_fraction * load_;
  subtract_internal_force(u_, residual_);
  result.residual_n = largest(residual_.tail(residual_.size() - clamped));
  return result;
}

ThesisNeedle::Station ThesisNeedle::station(int index) const {
  const Eigen::Index low = Eigen::Index{2} * (index * across + across / 2 - 1), high = low + 2;
  const Eigen::Index bottom = Eigen::Index{2} * index * across, top = bottom + 2 * (across - 1);
  const double s = index == properties_.elements ? properties_.length_m : index * along_m_;
  const double across_x = u_(top) - u_(bottom), across_y = properties_.depth_m + u_(top + 1) - u_(bottom + 1);
  return {s, {s + 0.5 * (u_(low) + u_(high)), 0.5 * (u_(low + 1) + u_(high + 1))}, std::atan2(-across_x, across_y)};
}

ThesisNeedle::Reaction ThesisNeedle::reaction() const {
  const VectorXd f = internal_force_n(u_);
  Reaction sum;
  for (int j = 0; j < across; ++j) {
    sum.fx_n += f(2 * j) - load_(2 * j);
    sum.fy_n += f(2 * j + 1) - load_(2 * j + 1);
    sum.tau_nm -= (j * across_m_ - 0.5 * properties_.depth_m) * (f(2 * j) - load_(2 * j));
  }
  return sum;
}

VectorXd ThesisNeedle::internal_force_n(const VectorXd& displacement_m) const {
  VectorXd f = VectorXd::Zero(u_.size());
  subtract_internal_force(displacement_m, f);
  return -f;
}

Eigen::MatrixXd ThesisNeedle::tangent_n_per_m(const VectorXd& displacement_m) const {
  Matrix k = tangent_;
  VectorXd unused = VectorXd::Zero(u_.size());
  assemble(displacement_m, nullptr, k, unused);
  const Eigen::Index size = u_.size() - clamped;
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index column = 0; column < size; ++column)
    for (Eigen::Index row = column; row < std::min<Eigen::Index>(size, column + band); ++row)
      all(row, column) = all(column, row) =
          k.column[static_cast<std::size_t>(column + clamped)].row[static_cast<std::size_t>(row - column / 4 * 4)];
  return all;
}

double ThesisNeedle::small_load_compliance_m_per_n() const {
  const Eigen::Index at = u_.size() - 2 * across + across - 1;  // y of the inner nodes of the tip
  VectorXd load = VectorXd::Zero(u_.size()), x(u_.size() + window);
  load(at) = load(at + 2) = 0.5;
  solve(linear_, load, x);
  // K0 is conditioned like (L / depth)^4, and half of the digits of x are rounding. f_int, by differences in each triangle, has nearly all
  // of them: two corrections bring them back, at a load so small that f_q is below rounding.
  const double small = 1e-9 * properties_.depth_m / x(at);
  VectorXd u = small * x.head(u_.size());
  for (int k = 0; k < 2; ++k) {
    VectorXd residual = small * load;
    subtract_internal_force(u, residual);
    solve(linear_, residual, x);
    u += x.head(u_.size());
  }
  return 0.5 * (u(at) + u(at + 2)) / small;
}

const char* to_string(ThesisNeedle::Status status) noexcept {
  switch (status) {
    case ThesisNeedle::Status::Converged:
      return "converged";
    case ThesisNeedle::Status::NotConverged:
      return "not converged";
    case ThesisNeedle::Status::Diverged:
      return "diverged";
    case ThesisNeedle::Status::Unstable:
      return "unstable";
    case ThesisNeedle::Status::Inverted:
      break;
  }
  return "inverted";
}

double fitted_young_pa(const ThesisNeedleProperties& properties, double bending_nm2) {
  require(bending_nm2 > 0.0 && std::isfinite(bending_nm2), "bending_nm2", bending_nm2, "must be positive");
  const double wanted = std::pow(properties.length_m, 3) / (3.0 * bending_nm2);
  return properties.young_pa * ThesisNeedle(properties).small_load_compliance_m_per_n() / wanted;
}

}  // namespace trocar::fem
