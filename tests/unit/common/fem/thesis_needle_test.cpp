#include "common/fem/thesis_needle.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/fem/nonlinear.hpp"
#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using testing::message_of;
using Status = ThesisNeedle::Status;

constexpr double bending_20g = 5.3753571419360002e-3;  // of the steel tube
// The stiffness of a slender needle is conditioned like (L / depth)^4: two correct solutions share that many digits fewer than 16.
constexpr double digits = 1e-8;
constexpr ThesisNeedleProperties printed{.length_m = 0.15, .depth_m = 0.908e-3, .thickness_m = 0.908e-3};

ThesisNeedleProperties fitted() {
  ThesisNeedleProperties p = printed;
  p.young_pa = fitted_young_pa(printed, bending_20g);
  return p;
}

ThesisNeedle bent(const ThesisNeedleProperties& p, double fx, double fy) {
  ThesisNeedle needle(p);
  const ThesisNeedle::Force tip[] = {{p.length_m, {fx, fy}}};
  needle.set_forces(tip);
  return needle;
}

// The same needle as any other tissue: the grid of common/fem, which numbers along x first.
struct AsTissue {
  explicit AsTissue(const ThesisNeedleProperties& p) : along(p.elements + 1) {
    tissue.model = Model::PlaneStress;
    tissue.thickness_m = p.thickness_m;
    tissue.grid = uniform_grid(Type::Tri3, {0, 0, 0}, {p.length_m, p.depth_m, 0}, {along, ThesisNeedle::across, 1});
    tissue.zones = {{{p.young_pa, p.poisson}, {}, {}}};
    tissue.supports = {{Side::XMin, {true, true, false}}};
    mesh = structured_grid(*tissue.grid);
  }
  [[nodiscard]] Index row(int i, int j) const { return Index{2} * (j * along + i); }
  [[nodiscard]] VectorXd tip_load(double fx, double fy) const {
    VectorXd f = VectorXd::Zero(static_cast<Index>(2 * mesh.node.size()));
    for (const int j : {1, 2}) {
      f(row(along - 1, j)) = 0.5 * fx;
      f(row(along - 1, j) + 1) = 0.5 * fy;
    }
    return f;
  }
  [[nodiscard]] VectorXd in_needle_order(const VectorXd& u) const {
    VectorXd ordered(u.size());
    for (int i = 0; i < along; ++i)
      for (int j = 0; j < ThesisNeedle::across; ++j)
        ordered.segment<2>(Index{2} * (ThesisNeedle::across * i + j)) = u.segment<2>(row(i, j));
    return ordered;
  }

  int along;
  Tissue tissue{};
  Mesh mesh{};
};

// Of a needle that is short and thick enough for its triangles to be seen, bent and stretched by some tenths.
VectorXd motion(const ThesisNeedle& needle, double size) {
  VectorXd u = VectorXd::Zero(needle.displacement_m().size());
  for (Index i = 2 * ThesisNeedle::across; i < u.size(); ++i) u(i) = size * std::sin(3.0 * static_cast<double>(i) + 0.3);
  return u;
}
constexpr ThesisNeedleProperties thick{.length_m = 0.03, .depth_m = 0.01, .thickness_m = 0.002, .young_pa = 1e6, .elements = 5};

TEST(ThesisNeedle, SmallLoadComplianceIsThatOfLinearStatics) {
  ThesisNeedleProperties shortest = thick;
  shortest.elements = 1;
  for (const ThesisNeedleProperties& p : {printed, thick, shortest}) {
    const AsTissue other(p);
    const VectorXd u = Statics(other.mesh, other.tissue).solve(other.tip_load(0.0, 1.0));
    const double tip = 0.5 * (u(other.row(p.elements, 1) + 1) + u(other.row(p.elements, 2) + 1));
    EXPECT_NEAR(ThesisNeedle(p).small_load_compliance_m_per_n() / tip, 1.0, digits);
  }
}

TEST(ThesisNeedle, FittedModulusGivesTheTubesCompliance) {
  const ThesisNeedleProperties p = fitted();
  EXPECT_NEAR(p.young_pa, 674e6, 1e6);  // MODELS, section 7
  const AsTissue other(p);
  const VectorXd u = Statics(other.mesh, other.tissue).solve(other.tip_load(0.0, 1.0));
  const double tip = 0.5 * (u(other.row(p.elements, 1) + 1) + u(other.row(p.elements, 2) + 1));
  EXPECT_NEAR(tip / (std::pow(0.15, 3) / (3 * bending_20g)), 1.0, digits);
  ThesisNeedleProperties from_elsewhere = printed;
  from_elsewhere.young_pa = 5.0;
  EXPECT_NEAR(fitted_young_pa(from_elsewhere, bending_20g) / p.young_pa, 1.0, 1e-11);
}

TEST(ThesisNeedle, TangentIsTheDerivativeOfTheInternalForce) {
  const ThesisNeedle needle(thick);
  const VectorXd u = motion(needle, 4e-4);
  const MatrixXd k = needle.tangent_n_per_m(u);
  const double h = 1e-8;
  const Index clamped = 2 * ThesisNeedle::across;
  for (Index i = 0; i < k.cols(); ++i) {
    VectorXd ahead = u, behind = u;
    ahead(clamped + i) += h;
    behind(clamped + i) -= h;
    const VectorXd slope = (needle.internal_force_n(ahead) - needle.internal_force_n(behind)).tail(k.rows()) / (2 * h);
    EXPECT_LT((slope - k.col(i)).cwiseAbs().maxCoeff(), 1e-7 * k.cwiseAbs().maxCoeff()) << i;
  }
}

TEST(ThesisNeedle, InternalForceIsThatOfTheElementKernels) {
  const ThesisNeedle needle(thick);
  const AsTissue other(thick);
  const VectorXd u = motion(needle, 4e-4);
  const element::Elasticity c = element::elasticity(Model::PlaneStress, {thick.young_pa, thick.poisson});
  const auto number = [&](int node) { return Index{2} * (node % other.along * ThesisNeedle::across + node / other.along); };
  VectorXd expected = VectorXd::Zero(u.size());
  for (std::size_t e = 0; e < other.mesh.element.size(); ++e) {
    element::Values u_e = element::Values::Zero(), f_e;
    element::Stiffness unused;
    for (int k = 0; k < 3; ++k) u_e.segment<2>(2 * k) = u.segment<2>(number(other.mesh.element[e][static_cast<std::size_t>(k)]));
    ASSERT_EQ(element::response(Type::Tri3, Integration::Full, other.mesh.corners(e), c, thick.thickness_m, u_e, f_e, unused),
              element::Status::Ok);
    for (int k = 0; k < 3; ++k) expected.segment<2>(number(other.mesh.element[e][static_cast<std::size_t>(k)])) += f_e.segment<2>(2 * k);
  }
  EXPECT_LT((needle.internal_force_n(u) - expected).cwiseAbs().maxCoeff(), 1e-13 * expected.cwiseAbs().maxCoeff());
}

TEST(ThesisNeedle, NewtonIsGenericNonlinearStatics) {
  const ThesisNeedleProperties p = fitted();
  const AsTissue other(p);
  for (const auto& [fx, fy] : {std::pair{0.0, 0.05}, {0.0, 0.5}, {0.1, -0.3}, {-0.05, 0.2}}) {
    NonlinearOptions options;
    options.tolerance = 1e-11;
    options.max_iterations = 60;
    const NonlinearResult generic = solve_green_lagrange(other.mesh, other.tissue, other.tip_load(fx, fy), options);
    ASSERT_TRUE(generic.converged) << generic.failure;
    const VectorXd expected = other.in_needle_order(generic.displacement_m);
    for (const bool predicted : {true, false}) {
      ThesisNeedle needle = bent(p, fx, fy);
      ThesisNeedle::NewtonOptions newton;
      newton.predicted_stress = predicted;
      const ThesisNeedle::Result result = needle.newton(newton);
      ASSERT_EQ(result.status, Status::Converged);
      EXPECT_LT(result.residual_n, 1e-7);
      EXPECT_LT((needle.displacement_m() - expected).cwiseAbs().maxCoeff(), 1e-9 * expected.cwiseAbs().maxCoeff()) << fx << " " << fy;
    }
  }
}

TEST(ThesisNeedle, PredictedStressSavesIterations) {
  ThesisNeedle needle = bent(fitted(), 0.0, 0.5);
  const int predicted = needle.newton().iterations;
  ThesisNeedle::NewtonOptions plain;
  plain.predicted_stress = false;
  EXPECT_LT(predicted, needle.newton(plain).iterations);
  EXPECT_LE(predicted, 7);
}

TEST(ThesisNeedle, FixedPointIsNewtonWhereItConverges) {
  const ThesisNeedleProperties p = fitted();
  for (const double force : {0.001, 0.004, -0.006}) {
    ThesisNeedle needle = bent(p, 0.0, force);
    const ThesisNeedle::Result fixed = needle.fixed_point();
    ASSERT_EQ(fixed.status, Status::Converged) << force;
    EXPECT_GT(fixed.iterations, 2);
    const VectorXd u = needle.displacement_m();
    ASSERT_EQ(needle.newton().status, Status::Converged);
    EXPECT_LT((u - needle.displacement_m()).cwiseAbs().maxCoeff(), 1e-8 * u.cwiseAbs().maxCoeff());
  }
}

TEST(ThesisNeedle, FixedPointDoesNotConvergeBeyondALoadAndSaysSo) {
  for (const double force : {0.05, 0.3, 0.5}) {
    ThesisNeedle needle = bent(printed, 0.0, force);
    const ThesisNeedle::Result fixed = needle.fixed_point();
    EXPECT_EQ(fixed.status, Status::Diverged) << force;
    EXPECT_LT(fixed.iterations, 100);
    // Newton starts from rest, not from there.
    EXPECT_EQ(needle.newton().status, Status::Converged);
  }
  for (const double force : {1e9, 1e100, 1e300}) {
    ThesisNeedle hopeless = bent(printed, 0.0, force);
    EXPECT_EQ(hopeless.fixed_point().status, Status::Diverged) << force;
    EXPECT_NE(hopeless.newton().status, Status::Converged) << force;
    EXPECT_TRUE(hopeless.displacement_m().allFinite());
  }
  ThesisNeedle needle = bent(printed, 0.0, 0.01);
  ThesisNeedle::FixedPointOptions few;
  few.max_iterations = 3;
  const ThesisNeedle::Result unfinished = needle.fixed_point(few);
  EXPECT_EQ(unfinished.status, Status::NotConverged);
  EXPECT_EQ(unfinished.iterations, 3);
}

// The deflection that it bears belongs to the shape of the needle alone: modulus and thickness scale all forces alike.
TEST(ThesisNeedle, WhereTheFixedPointStopsIsADeflectionOfAboutTwoDepths) {
  const auto limit_m = [](const ThesisNeedleProperties& p) {
    double low = 0.0, high = 0.1 / ThesisNeedle(p).small_load_compliance_m_per_n();
    ThesisNeedle::FixedPointOptions options;
    options.max_iterations = 1000;
    for (int k = 0; k < 12; ++k) {
      const double middle = 0.5 * (low + high);
      (bent(p, 0.0, middle).fixed_point(options).status == Status::Converged ? low : high) = middle;
    }
    return low * ThesisNeedle(p).small_load_compliance_m_per_n();
  };
  ThesisNeedleProperties other = printed;
  other.young_pa = 200e9;
  other.thickness_m = 0.01;
  const double limit = limit_m(printed);
  EXPECT_NEAR(limit_m(other) / limit, 1.0, 1e-3);
  EXPECT_GT(limit, 1.5 * printed.depth_m);
  EXPECT_LT(limit, 2.0 * printed.depth_m);
}

TEST(ThesisNeedle, ClampHoldsAgainstAllForces) {
  ThesisNeedle needle(fitted());
  const ThesisNeedle::Force forces[] = {{0.15, {-0.02, 0.1}}, {0.0333, {0.05, -0.2}}, {0.101, {0.0, 0.03}}, {0.0, {1.0, 2.0}}};
  needle.set_forces(forces);
  ASSERT_EQ(needle.newton().status, Status::Converged);
  double fx = 0.0, fy = 0.0, tau = 0.0;
  for (const ThesisNeedle::Force& f : forces) {
    const double at = f.arclength_m / 0.01;
    const int before = std::min(static_cast<int>(at), 14);
    const auto a = needle.station(before).position_m, b = needle.station(before + 1).position_m;
    const double x = a[0] + (at - before) * (b[0] - a[0]), y = a[1] + (at - before) * (b[1] - a[1]);
    fx -= f.force_n[0];
    fy -= f.force_n[1];
    tau -= x * f.force_n[1] - y * f.force_n[0];
  }
  // Halves of a force act beside the mid-line's mean: their moment about it is half the difference of two nodes.
  const ThesisNeedle::Reaction base = needle.reaction();
  EXPECT_NEAR(base.fx_n, fx, 1e-8);
  EXPECT_NEAR(base.fy_n, fy, 1e-8);
  EXPECT_NEAR(base.tau_nm, tau, 1e-9);
}

TEST(ThesisNeedle, RestsWithoutForces) {
  ThesisNeedle needle(printed);
  EXPECT_EQ(needle.newton().status, Status::Converged);
  EXPECT_TRUE(needle.displacement_m().isZero(0.0));
  EXPECT_EQ(needle.fixed_point().status, Status::Converged);
  EXPECT_EQ(needle.tip().position_m, (std::array{0.15, 0.0}));
  EXPECT_EQ(needle.tip().theta_rad, 0.0);
}

// The diagonals of the mesh all lean one way, so that thrust bends the needle a little before it buckles.
TEST(ThesisNeedle, PastBucklingItIsBentOrCalledUnstable) {
  const ThesisNeedleProperties p = fitted();
  const double euler = M_PI * M_PI * bending_20g / (4 * 0.15 * 0.15);
  ThesisNeedle below = bent(p, -0.9 * euler, 0.0);
  EXPECT_EQ(below.newton().status, Status::Converged);
  EXPECT_LT(std::abs(below.tip().position_m[1]), 1e-3);
  ThesisNeedle above = bent(p, -1.2 * euler, 0.0);
  EXPECT_EQ(above.newton().status, Status::Converged);
  EXPECT_GT(std::abs(above.tip().position_m[1]), 0.05);
  ThesisNeedle::NewtonOptions at_once;
  at_once.max_halvings = 0;
  const ThesisNeedle::Result straight = above.newton(at_once);
  EXPECT_EQ(straight.status, Status::Unstable);
  EXPECT_EQ(straight.load_fraction, 0.0);
}

TEST(ThesisNeedle, RefusesWhatMakesNoNeedle) {
  const auto refusal = [](auto change) {
    ThesisNeedleProperties p = printed;
    change(p);
    return message_of([&] { (void)ThesisNeedle(p); });
  };
  EXPECT_EQ(refusal([](auto&) {}), "");
  EXPECT_NE(refusal([](auto& p) { p.length_m = 0.0; }).find("length_m = 0"), std::string::npos);
  EXPECT_NE(refusal([](auto& p) { p.depth_m = std::nan(""); }).find("depth_m = nan"), std::string::npos);
  EXPECT_NE(refusal([](auto& p) { p.thickness_m = -1.0; }).find("thickness_m = -1"), std::string::npos);
  EXPECT_NE(refusal([](auto& p) { p.young_pa = std::numeric_limits<double>::infinity(); }).find("young_pa = inf"), std::string::npos);
  EXPECT_NE(refusal([](auto& p) { p.poisson = 0.5; }).find("poisson = 0.5"), std::string::npos);
  EXPECT_NE(refusal([](auto& p) { p.elements = 0; }).find("elements = 0"), std::string::npos);
  const auto force = [](double s, double fx) {
    ThesisNeedle needle(printed);
    const ThesisNeedle::Force f[] = {{s, {fx, 0.0}}};
    return message_of([&] { needle.set_forces(f); });
  };
  EXPECT_NE(force(0.16, 1.0).find("arclength_m = 0.16"), std::string::npos);
  EXPECT_NE(force(0.1, std::nan("")).find("force_n = nan"), std::string::npos);
  EXPECT_NE(message_of([] { (void)fitted_young_pa(printed, 0.0); }).find("bending_nm2 = 0"), std::string::npos);
}

}  // namespace
}  // namespace trocar::fem
