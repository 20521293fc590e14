#include "common/fem/nonlinear.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/fem/assembly.hpp"
#include "common/fem/factor.hpp"
#include "common/fem/statics.hpp"

namespace trocar::fem {
namespace {

using Eigen::VectorXd;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

void require_valid(const NonlinearOptions& options) {
  if (options.load_steps < 1) throw Error("load_steps = " + std::to_string(options.load_steps) + ": must be at least 1");
  if (options.max_iterations < 1) throw Error("max_iterations = " + std::to_string(options.max_iterations) + ": must be at least 1");
  if (options.max_halvings < 0 || options.max_halvings > 30)
    throw Error("max_halvings = " + std::to_string(options.max_halvings) + ": must be within 0 and 30");
  if (!(options.tolerance > 0.0 && options.tolerance < 1.0))
    throw Error("tolerance = " + std::to_string(options.tolerance) + ": must be within 0 and 1, such as 1e-10");
}

// The first minimum of the potential along a Newton direction: the least root in (0, 1] of g(s) / g(0) = 1 - s + c2 s^2 + c3 s^3, given its
// values at 1/2 and 1; 1 when there is none.
double first_minimum(double at_half, double at_one) {
  const double a = at_half - 0.5;  // c2/4 + c3/8
  const double c2 = 8 * a - at_one;
  const double c3 = 2 * at_one - 8 * a;
  const auto g = [&](double s) { return 1 - s + s * s * (c2 + c3 * s); };
  constexpr int samples = 64;
  for (int k = 1; k <= samples; ++k) {
    double high = static_cast<double>(k) / samples;
    if (g(high) > 0.0) continue;
    double low = static_cast<double>(k - 1) / samples;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (g(middle) > 0.0 ? low : high) = middle;
    }
    return high;
  }
  return 1.0;
}

class Problem {
 public:
  Problem(const Mesh& mesh, const Tissue& tissue, const VectorXd& loads_n, const VectorXd& prescribed_m)
      : mesh_(mesh),
        tissue_(tissue),
        load_(loads_n),
        prescribed_(prescribed_m),
        equations_(supported_degrees_of_freedom(mesh, tissue.supports)),
        elasticity_(elasticities(mesh, tissue)),
        zone_(zones_of(mesh, tissue.zones)),
        tangent_(mesh) {
    const auto size = static_cast<Eigen::Index>(mesh.node.size()) * mesh.dimension();
    if (loads_n.size() != size || prescribed_m.size() != size)
      throw Error("loads and prescribed displacements must have " + std::to_string(size) + " entries, one for each degree of freedom");
    for (Eigen::Index i = 0; i < size; ++i) {
      if (!supported(i)) prescribed_(i) = 0.0;
      if (supported(i)) load_(i) = 0.0;
      if (!std::isfinite(load_(i)) || !std::isfinite(prescribed_(i)))
        throw Error("the load or the prescribed displacement of " + node_in_words(mesh, i) + " is not a number");
    }
    moves_supports_ = !prescribed_.isZero(0.0);
    force_.resize(size);
  }

  NonlinearResult solve(const NonlinearOptions& options) {
    NonlinearResult result;
    result.displacement_m = VectorXd::Zero(load_.size());
    const double first = 1.0 / options.load_steps;
    const double shortest = first * std::ldexp(1.0 - 1e-9, -options.max_halvings);
    double step = first;
    while (result.load_fraction < 1.0) {
      const double target = result.load_fraction + step > 1.0 - 1e-12 ? 1.0 : result.load_fraction + step;
      const std::string failure = advance(target, options, result);
      if (!failure.empty() && 0.5 * step < shortest) {
        result.failure = "Green-Lagrange statics stopped at " + number(100 * result.load_fraction) + " % of the load; the next " +
                         number(100 * step) + " % failed: " + failure;
        return result;
      }
      if (!failure.empty()) {
        step *= 0.5;
        ++result.halvings;
        continue;
      }
      result.load_fraction = target;
      ++result.steps;
    }
    result.converged = true;
    return result;
  }

 private:
  [[nodiscard]] bool supported(Eigen::Index i) const { return equations_.supported(i); }

  // Internal force at u, and with it the tangent.
  void evaluate(const VectorXd& u) {
    const int d = mesh_.dimension();
    const int corners = mesh_.nodes_per_element();
    force_.setZero();
    tangent_.clear();
    element::Values u_e = element::Values::Zero();
    element::Values f_e;
    element::Stiffness k_e;
    for (std::size_t e = 0; e < mesh_.element.size(); ++e) {
      const auto& nodes = mesh_.element[e];
      for (int k = 0; k < corners; ++k)
        for (int a = 0; a < d; ++a) u_e(k * d + a) = u(nodes[static_cast<std::size_t>(k)] * d + a);
      const auto& c = elasticity_[static_cast<std::size_t>(zone_[e])];
      if (element::response(mesh_.type, tissue_.integration, mesh_.corners(e), c, tissue_.thickness_m, u_e, f_e, k_e) !=
          element::Status::Ok)
        throw Error(inverted_element(mesh_, e));
      for (int k = 0; k < corners; ++k)
        for (int a = 0; a < d; ++a) force_(nodes[static_cast<std::size_t>(k)] * d + a) += f_e(k * d + a);
      tangent_.add(e, k_e);
    }
  }

  // load - f_int on free degrees of freedom after evaluate().
  [[nodiscard]] VectorXd residual(double fraction) const {
    VectorXd r(equations_.count());
    for (Eigen::Index j = 0; j < r.size(); ++j) {
      const int i = equations_.unknown[static_cast<std::size_t>(j)];
      r(j) = fraction * load_(i) - force_(i);
    }
    return r;
  }

  [[nodiscard]] double scale(double fraction) const {
    double held = 0.0;
    for (Eigen::Index i = 0; i < force_.size(); ++i)
      if (supported(i)) held += force_(i) * force_(i);
    return std::max(fraction * load_.norm(), std::sqrt(held));
  }

  [[nodiscard]] VectorXd expand(const VectorXd& free) const {
    VectorXd all = VectorXd::Zero(load_.size());
    for (Eigen::Index j = 0; j < free.size(); ++j) all(equations_.unknown[static_cast<std::size_t>(j)]) = free(j);
    return all;
  }

  // Kernels judge the undeformed element; the deformed one is the undeformed one of a mesh that has moved.
  [[nodiscard]] std::string turned_inside_out(const VectorXd& u) const {
    const int d = mesh_.dimension();
    element::Stiffness unused;
    for (std::size_t e = 0; e < mesh_.element.size(); ++e) {
      element::Corners corner = mesh_.corners(e);
      for (int k = 0; k < mesh_.nodes_per_element(); ++k)
        for (int a = 0; a < d; ++a) corner(a, k) += u(mesh_.element[e][static_cast<std::size_t>(k)] * d + a);
      const auto& c = elasticity_[static_cast<std::size_t>(zone_[e])];
      if (element::stiffness(mesh_.type, Integration::Full, corner, c, tissue_.thickness_m, unused) == element::Status::Ok) continue;
      const Point x = mesh_.centroid(e);
      return "element " + std::to_string(e) + " around (" + number(x[0]) + ", " + number(x[1]) + ", " + number(x[2]) +
             ") m would be turned inside out; spread the load over more nodes";
    }
    return {};
  }

  // Newton from result's equilibrium to `target` of the load. Empty when it got there and `result` holds the new equilibrium.
  [[nodiscard]] std::string advance(double target, const NonlinearOptions& options, NonlinearResult& result) {
    VectorXd u = result.displacement_m;
    VectorXd jump = target * prescribed_;
    for (Eigen::Index i = 0; i < u.size(); ++i)
      if (supported(i)) jump(i) -= u(i);
    evaluate(u);
    VectorXd r = residual(target);
    std::vector<double> history;
    for (int iteration = 0;; ++iteration) {
      const double norm = r.norm();
      history.push_back(norm);
      if (!std::isfinite(norm)) return "the residual is not finite";
      const bool supports_moved = iteration > 0 || !moves_supports_;
      if (supports_moved && norm <= options.tolerance * scale(target)) break;
      if (iteration == options.max_iterations)
        return "no convergence in " + std::to_string(iteration) + " iterations, residual " + number(norm) + " N";

      VectorXd right = r;
      if (!supports_moved) {
        const VectorXd moved = tangent_.matrix() * jump;
        for (Eigen::Index j = 0; j < right.size(); ++j) right(j) -= moved(equations_.unknown[static_cast<std::size_t>(j)]);
      }
      VectorXd du;
      if (equations_.count() > 0) {
        try {
          ++result.iterations;
          du = Factor(equations_.reduce(tangent_.matrix())).solve(right);
        } catch (const NotPositiveDefinite&) {
          return "the tangent is not positive definite: the tissue buckles, or its material reaches the limit that St. Venant-Kirchhoff "
                 "has "
                 "in compression; lower the load, spread it over more nodes, or support more";
        }
      }
      const VectorXd direction = expand(du);
      if (!supports_moved) {
        u += direction + jump;
        evaluate(u);
        r = residual(target);
        continue;
      }
      // g(0) = -du . r = -du . K du < 0; ratios g(s) / g(0).
      const double start = du.dot(r);
      evaluate(u + direction);
      r = residual(target);
      if (const double at_one = du.dot(r) / start; std::abs(at_one) > 0.5) {
        evaluate(u + 0.5 * direction);
        const double s = first_minimum(du.dot(residual(target)) / start, at_one);
        u += s * direction;
        evaluate(u);
        r = residual(target);
      } else {
        u += direction;
      }
    }
    if (std::string inverted = turned_inside_out(u); !inverted.empty()) return inverted;
    result.displacement_m = u;
    result.residual_n = history.back();
    result.residuals_n = history;
    return {};
  }

  const Mesh& mesh_;
  const Tissue& tissue_;
  VectorXd load_;
  VectorXd prescribed_;
  bool moves_supports_{};
  Equations equations_;
  std::vector<element::Elasticity> elasticity_;
  std::vector<int> zone_;
  Assembly tangent_;
  VectorXd force_{};
};

}  // namespace

NonlinearResult solve_green_lagrange(const Mesh& mesh, const Tissue& tissue, const Eigen::VectorXd& loads_n,
                                     const NonlinearOptions& options, const Eigen::VectorXd& prescribed_m) {
  require_valid(options);
  return Problem(mesh, tissue, loads_n, prescribed_m.size() == 0 ? VectorXd(VectorXd::Zero(loads_n.size())) : prescribed_m).solve(options);
}

}  // namespace trocar::fem
