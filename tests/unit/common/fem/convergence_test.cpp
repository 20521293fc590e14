// Orders of convergence against exact solutions that the mesh cannot represent: a manufactured field for every element, Kelvin's point
// force in space. Displacements of the whole boundary are prescribed from the exact solution.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <tuple>

#include "cases.hpp"
#include "common/fem/statics.hpp"
#include "models.hpp"

namespace trocar::fem {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using testing::block;
using testing::Kind;
using testing::name_of;

// u_i = amplitude sin(wave_i . x + phase_i), in the unit square or cube.
struct Waves {
  std::array<Vector3d, 3> wave;
  std::array<double, 3> phase{0.3, 1.1, 2.0};
  int dimension{};

  [[nodiscard]] double argument(int i, const Vector3d& x) const {
    return wave[static_cast<std::size_t>(i)].dot(x) + phase[static_cast<std::size_t>(i)];
  }
  [[nodiscard]] Vector3d displacement(const Vector3d& x) const {
    Vector3d u = Vector3d::Zero();
    for (int i = 0; i < dimension; ++i) u(i) = 0.01 * std::sin(argument(i, x));
    return u;
  }
  [[nodiscard]] Eigen::Matrix3d slope(const Vector3d& x) const {
    Eigen::Matrix3d g = Eigen::Matrix3d::Zero();
    for (int i = 0; i < dimension; ++i) g.row(i) = 0.01 * std::cos(argument(i, x)) * wave[static_cast<std::size_t>(i)].transpose();
    return g;
  }
  // -div sigma = -(lambda + mu) grad div u - mu laplace u
  [[nodiscard]] Vector3d body_force(const element::Lame& lame, const Vector3d& x) const {
    const Vector3d u = displacement(x);
    Vector3d f = Vector3d::Zero();
    for (int i = 0; i < dimension; ++i) {
      const Vector3d& k = wave[static_cast<std::size_t>(i)];
      f += (lame.lambda + lame.mu) * k(i) * u(i) * k;
      f(i) += lame.mu * k.squaredNorm() * u(i);
    }
    if (dimension == 2) f(2) = 0.0;
    return f;
  }
};

Waves general(int dimension) {
  if (dimension == 2) return {{Vector3d(2, 1, 0), Vector3d(-1, 2.5, 0), Vector3d::Zero()}, {0.3, 1.1, 2.0}, 2};
  return {{Vector3d(2, 1, -1), Vector3d(-1, 2.5, 1), Vector3d(1, 1, 2)}, {0.3, 1.1, 2.0}, 3};
}

// No component varies along its own axis: div u = 0.
Waves volume_preserving(int dimension) {
  if (dimension == 2) return {{Vector3d(0, 3, 0), Vector3d(3, 0, 0), Vector3d::Zero()}, {0.3, 1.1, 2.0}, 2};
  return {{Vector3d(0, 2, 2), Vector3d(2, 0, -2), Vector3d(2, 2, 0)}, {0.3, 1.1, 2.0}, 3};
}

struct Errors {
  double displacement;  // L2, relative
  double strain;        // L2 of the gradient, relative
};

Errors errors(const Kind& kind, double nu, const Waves& exact, int cells) {
  const int d = element::dimension(kind.type);
  Tissue tissue = block(uniform_grid(kind.type, {0, 0, 0}, {1, 1, 1}, {cells + 1, cells + 1, cells + 1}));
  tissue.model = kind.model;
  tissue.integration = kind.integration;
  tissue.thickness_m = 0.7;
  tissue.zones = {{{1.0, nu}, {}, {}}};
  tissue.supports.clear();
  for (const Side side : {Side::XMin, Side::XMax, Side::YMin, Side::YMax, Side::ZMin, Side::ZMax})
    if (d == 3 || side < Side::ZMin) tissue.supports.push_back({side, {true, true, d == 3}});
  Mesh mesh = structured_grid(*tissue.grid);
  // A smooth map that keeps the boundary: no element keeps its right angles.
  for (Point& x : mesh.node) {
    double bubble = 0.08;
    for (std::size_t a = 0; a < static_cast<std::size_t>(d); ++a) bubble *= std::sin(std::numbers::pi * x[a]);
    x[0] += bubble;
    x[1] -= 1.5 * bubble;
    if (d == 3) x[2] += bubble;
  }

  const element::Lame lame(kind.model, {1.0, nu});
  VectorXd load = VectorXd::Zero(static_cast<Eigen::Index>(mesh.node.size()) * d);
  VectorXd boundary = load;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const Vector3d u = exact.displacement({mesh.node[n][0], mesh.node[n][1], mesh.node[n][2]});
    for (int a = 0; a < d; ++a) boundary(static_cast<Eigen::Index>(n) * d + a) = u(a);
  }
  // Calls f(element, shape functions, their gradients, volume, place) at points that integrate far better than the elements do.
  const auto points = element::gauss(kind.type, 4);
  const auto integrate = [&](const auto& f) {
    for (std::size_t e = 0; e < mesh.element.size(); ++e) {
      const element::Corners corner = mesh.corners(e);
      for (const auto& p : points) {
        element::Shape value;
        element::ShapeGradient natural;
        element::shape(kind.type, p.natural, value, natural);
        double determinant = 0.0;
        const Eigen::MatrixXd g = element::gradients(kind.type, corner, p.natural, determinant);
        const Vector3d x = corner * value;
        f(mesh.element[e], value, g, p.weight * determinant * (d == 2 ? tissue.thickness_m : 1.0), x);
      }
    }
  };
  const int corners = mesh.nodes_per_element();
  integrate([&](const auto& nodes, const auto& value, const auto&, double dv, const Vector3d& x) {
    const Vector3d f = exact.body_force(lame, x);
    for (int k = 0; k < corners; ++k)
      for (int a = 0; a < d; ++a) load(nodes[static_cast<std::size_t>(k)] * d + a) += value(k) * f(a) * dv;
  });
  const VectorXd u = Statics(mesh, tissue).solve(load, boundary);

  double off = 0.0, size = 0.0, slope_off = 0.0, slope_size = 0.0;
  integrate([&](const auto& nodes, const auto& value, const auto& g, double dv, const Vector3d& x) {
    Vector3d here = Vector3d::Zero();
    Eigen::Matrix3d slope = Eigen::Matrix3d::Zero();
    for (int k = 0; k < corners; ++k)
      for (int a = 0; a < d; ++a) {
        const double nodal = u(nodes[static_cast<std::size_t>(k)] * d + a);
        here(a) += value(k) * nodal;
        for (int b = 0; b < d; ++b) slope(a, b) += g(b, k) * nodal;
      }
    off += (here - exact.displacement(x)).squaredNorm() * dv;
    size += exact.displacement(x).squaredNorm() * dv;
    slope_off += (slope - exact.slope(x)).squaredNorm() * dv;
    slope_size += exact.slope(x).squaredNorm() * dv;
  });
  return {std::sqrt(off / size), std::sqrt(slope_off / slope_size)};
}

class Manufactured : public ::testing::TestWithParam<Kind> {};
INSTANTIATE_TEST_SUITE_P(
    Convergence, Manufactured,
    ::testing::Values(Kind{Type::Tri3, Model::PlaneStress, Integration::Full}, Kind{Type::Tri3, Model::PlaneStrain, Integration::Full},
                      Kind{Type::Quad4, Model::PlaneStress, Integration::Full}, Kind{Type::Quad4, Model::PlaneStrain, Integration::Full},
                      Kind{Type::Quad4, Model::PlaneStrain, Integration::BBar}, Kind{Type::Tet4, Model::Solid, Integration::Full},
                      Kind{Type::Hex8, Model::Solid, Integration::Full}, Kind{Type::Hex8, Model::Solid, Integration::BBar}),
    [](const auto& parameter) { return name_of(parameter.param); });

TEST_P(Manufactured, DisplacementConvergesWithOrderTwoAndStrainWithOrderOne) {
  const Kind kind = GetParam();
  const bool solid = kind.model == Model::Solid;
  const Waves exact = general(element::dimension(kind.type));
  const Errors coarse = errors(kind, 0.3, exact, solid ? 6 : 16);
  const Errors fine = errors(kind, 0.3, exact, solid ? 12 : 32);
  const double order = std::log2(coarse.displacement / fine.displacement);
  EXPECT_NEAR(order, 2.0, 0.12);
  EXPECT_NEAR(std::log2(coarse.strain / fine.strain), 1.0, 0.1);
  EXPECT_LT(fine.displacement, solid ? 0.01 : 0.001);
}

// A field without change of volume does not know nu: B-bar's error is the same at 0.3 and at 0.4999, and so is its order. The full quad's
// is 5.5 times as large there (benchmark_test.cpp shows both where sides are free, which is where full integration locks).
TEST(Locking, BBarKeepsErrorAndOrderUpToNearlyIncompressible) {
  for (const Type type : {Type::Quad4, Type::Hex8}) {
    const bool solid = type == Type::Hex8;
    const Waves exact = volume_preserving(element::dimension(type));
    const int cells = solid ? 5 : 12;
    const Kind bbar{type, solid ? Model::Solid : Model::PlaneStrain, Integration::BBar};
    const double reference = errors(bbar, 0.3, exact, cells).displacement;
    for (const double nu : {0.48, 0.499, 0.4999}) {
      const double coarse = errors(bbar, nu, exact, cells).displacement;
      EXPECT_LT(coarse, 1.05 * reference);
      EXPECT_NEAR(std::log2(coarse / errors(bbar, nu, exact, 2 * cells).displacement), 2.0, 0.1);
    }
    if (!solid) {
      EXPECT_GT(errors({type, bbar.model, Integration::Full}, 0.4999, exact, cells).displacement, 4 * reference);
    }
  }
}

// Kelvin's solution: a force along y in unbounded space, u_i = F / (16 pi mu (1 - nu) r) ((3 - 4 nu) delta_iy + x_i y / r^2).
Vector3d kelvin(double force, double mu, double nu, const Vector3d& x) {
  const double r = x.norm();
  return force / (16 * std::numbers::pi * mu * (1 - nu) * r) * ((3 - 4 * nu) * Vector3d::UnitY() + x * (x(1) / (r * r)));
}

// In an eighth of the cube of edge 2 around the force.
struct PointForce {
  double error;  // relative, mean over the coarsest mesh's nodes at distances of 0.5 to 0.9
  double under;  // displacement of the loaded node
};

PointForce point_force(Type type, Integration integration, int cells) {
  const double nu = 0.3;
  Tissue tissue = block(uniform_grid(type, {0, 0, 0}, {1, 1, 1}, {cells + 1, cells + 1, cells + 1}));
  tissue.integration = integration;
  tissue.zones = {{{1.0, nu}, {}, {}}};
  // u is even in y along y and odd across; across x and z it is mirrored.
  tissue.supports = {{Side::XMin, {true, false, false}}, {Side::YMin, {true, false, true}}, {Side::ZMin, {false, false, true}}};
  for (const Side side : {Side::XMax, Side::YMax, Side::ZMax}) tissue.supports.push_back({side, {true, true, true}});
  const Mesh mesh = structured_grid(*tissue.grid);
  const double mu = 1.0 / (2 * (1 + nu));
  const auto size = static_cast<Eigen::Index>(3 * mesh.node.size());
  VectorXd boundary = VectorXd::Zero(size);
  VectorXd load = VectorXd::Zero(size);
  const Eigen::Index centre = 3 * Locator(mesh).nearest_node({0, 0, 0});
  load(centre + 1) = 1.0 / 8;
  for (std::size_t n = 0; n < mesh.node.size(); ++n)
    if (const auto row = static_cast<Eigen::Index>(3 * n); row != centre)
      boundary.segment<3>(row) = kelvin(1.0, mu, nu, {mesh.node[n][0], mesh.node[n][1], mesh.node[n][2]});
  const VectorXd u = Statics(mesh, tissue).solve(load, boundary);
  double off = 0.0;
  double scale = 0.0;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    const Vector3d x(mesh.node[n][0], mesh.node[n][1], mesh.node[n][2]);
    if (x.norm() < 0.5 || x.norm() > 0.9) continue;
    if ((8 * x - (8 * x).array().round().matrix()).cwiseAbs().maxCoeff() > 1e-9) continue;
    const Vector3d exact = kelvin(1.0, mu, nu, x);
    off += (u.segment<3>(static_cast<Eigen::Index>(3 * n)) - exact).norm();
    scale += exact.norm();
  }
  return {off / scale, u(centre + 1)};
}

// Measured orders 2.06, 2.26 and, not yet at its end, 1.59 (1.68 from 16 to 24 cells).
TEST(PointForce, AtADistanceKelvinsSolutionIsReachedWithOrderTwo) {
  for (const auto& [type, integration, least] :
       {std::tuple{Type::Hex8, Integration::Full, 1.9}, {Type::Hex8, Integration::BBar, 1.9}, {Type::Tet4, Integration::Full, 1.5}}) {
    const PointForce coarse = point_force(type, integration, 8);
    const PointForce fine = point_force(type, integration, 16);
    EXPECT_GT(std::log2(coarse.error / fine.error), least);
    EXPECT_LT(std::log2(coarse.error / fine.error), 2.4);
    EXPECT_LT(fine.error, 0.005);
    // Under the force there is nothing to converge to: the displacement grows like 1 / h.
    EXPECT_NEAR(fine.under / coarse.under, 2.0, 0.01);
  }
}

}  // namespace
}  // namespace trocar::fem
