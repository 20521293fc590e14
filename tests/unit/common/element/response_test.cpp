#include "cases.hpp"

namespace trocar::element {
namespace {

class EachResponse : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Element, EachResponse, testing::ValuesIn(all_cases()), case_name);

struct Answer {
  Eigen::VectorXd force{};
  Eigen::MatrixXd tangent{};
};

Answer answer(const Case& c, const Corners& corner, const Eigen::VectorXd& u) {
  Values values = Values::Zero(), force;
  values.head(u.size()) = u;
  Stiffness tangent;
  EXPECT_EQ(response(c.type, c.integration, corner, elasticity(c.model, tissue), thickness, values, force, tangent), Status::Ok);
  EXPECT_EQ(tangent, tangent.transpose());
  return {force.head(u.size()), used(c, tangent)};
}

// mu dev(E):dev(E) + bulk/2 tr(E)^2 with tensors, at the kernels' own points (where the strain is constant any exact rule will do). B-bar:
// the mean of tr(E) instead. Plane stress has its own lambda and no B-bar.
double energy(const Case& c, const Corners& corner, const Eigen::VectorXd& u) {
  const int d = dimension(c.type);
  const Lame lame(c.model, tissue);
  double sum = 0.0;
  double volume = 0.0;
  double change = 0.0;  // integral of tr(E)
  double change_squared = 0.0;
  for (const GaussPoint& p : gauss(c.type, 2)) {
    double determinant = 0.0;
    const Eigen::MatrixXd g = gradients(c.type, corner, p.natural, determinant);
    Eigen::MatrixXd f = Eigen::MatrixXd::Identity(d, d);
    for (int k = 0; k < node_count(c.type); ++k) f += u.segment(k * d, d) * g.col(k).transpose();
    const Eigen::MatrixXd e = 0.5 * (f.transpose() * f - Eigen::MatrixXd::Identity(d, d));
    const double dv = p.weight * determinant * (d == 2 ? thickness : 1.0);
    sum += lame.mu * (e.squaredNorm() - e.trace() * e.trace() / 3) * dv;
    volume += dv;
    change += e.trace() * dv;
    change_squared += e.trace() * e.trace() * dv;
  }
  const bool mean = c.integration == Integration::BBar && c.model != Model::PlaneStress;
  return sum + 0.5 * (lame.lambda + 2 * lame.mu / 3) * (mean ? change * change / volume : change_squared);
}

// Large: some 20 % of the element's size.
Eigen::VectorXd motion(const Case& c, Random& random, double amount = 0.002) {
  Eigen::VectorXd u(node_count(c.type) * dimension(c.type));
  for (double& x : u) x = random(-amount, amount);
  return u;
}

TEST_P(EachResponse, ForceIsTheDerivativeOfTheEnergy) {
  Random random(1);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::VectorXd u = motion(c, random);
  const Answer at = answer(c, corner, u);
  const double step = 1e-6;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    Eigen::VectorXd plus = u, minus = u;
    plus(i) += step;
    minus(i) -= step;
    EXPECT_NEAR(at.force(i), (energy(c, corner, plus) - energy(c, corner, minus)) / (2 * step), 1e-6 * at.force.cwiseAbs().maxCoeff());
  }
}

TEST_P(EachResponse, TangentIsTheDerivativeOfTheForce) {
  Random random(2);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::VectorXd u = motion(c, random);
  const Answer at = answer(c, corner, u);
  // The force is cubic in u: a four-point difference leaves rounding alone.
  const double step = 1e-4;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const auto shifted = [&](double by) {
      Eigen::VectorXd moved = u;
      moved(i) += by;
      return answer(c, corner, moved).force;
    };
    const Eigen::VectorXd difference = (8 * (shifted(step) - shifted(-step)) - (shifted(2 * step) - shifted(-2 * step))) / (12 * step);
    EXPECT_LT((difference - at.tangent.col(i)).cwiseAbs().maxCoeff(), 1e-10 * at.tangent.cwiseAbs().maxCoeff());
  }
}

TEST_P(EachResponse, StartsFromTheLinearStiffness) {
  Random random(3);
  const Case c = GetParam();
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::MatrixXd k = kernel_stiffness(c, corner, tissue, thickness);
  const Answer rest = answer(c, corner, Eigen::VectorXd::Zero(k.rows()));
  EXPECT_TRUE(rest.force.isZero(0.0));
  EXPECT_LT(relative(rest.tangent, k), 1e-14);
  // What is left over is quadratic in u.
  const Eigen::VectorXd u = motion(c, random);
  const double scale = (k * u).norm();
  for (const double small : {1e-3, 1e-5})
    EXPECT_LT((answer(c, corner, small * u).force - k * (small * u)).norm(), 3 * small * small * scale);
}

TEST_P(EachResponse, FeelsNothingWhenMovedAsARigidBody) {
  Random random(4);
  const Case c = GetParam();
  const int d = dimension(c.type);
  const Corners corner = distorted(c.type, random, 0.2);
  for (const double angle : {0.1, 1.0, 3.0}) {
    const Eigen::Matrix3d r = rotation(c.type, angle);
    Eigen::VectorXd u(node_count(c.type) * d);
    for (int k = 0; k < node_count(c.type); ++k)
      u.segment(k * d, d) = leading(r * corner.col(k) - corner.col(k), d) + Eigen::VectorXd::Constant(d, 0.05);
    const double linear = (kernel_stiffness(c, corner, tissue, thickness) * u).norm();
    EXPECT_LT(answer(c, corner, u).force.norm(), 1e-12 * linear);
  }
}

// Turning a deformed element turns its force and its tangent.
TEST_P(EachResponse, IsObjective) {
  Random random(5);
  const Case c = GetParam();
  const int d = dimension(c.type);
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::VectorXd u = motion(c, random);
  const Answer at = answer(c, corner, u);
  const Eigen::Matrix3d r = rotation(c.type, 1.2);
  const Eigen::MatrixXd blocks = block_rotation(c.type, r);
  Eigen::VectorXd turned = blocks * u;
  for (int k = 0; k < node_count(c.type); ++k) turned.segment(k * d, d) += leading(r * corner.col(k) - corner.col(k), d);
  const Answer after = answer(c, corner, turned);
  EXPECT_LT(relative(after.force, blocks * at.force), 1e-12);
  EXPECT_LT(relative(after.tangent, blocks * at.tangent * blocks.transpose()), 1e-12);
}

// Forces balance: no resultant and, in the deformed position, no moment.
TEST_P(EachResponse, ForcesAreInBalance) {
  Random random(6);
  const Case c = GetParam();
  const int d = dimension(c.type);
  const Corners corner = distorted(c.type, random, 0.2);
  const Eigen::VectorXd u = motion(c, random);
  const Eigen::VectorXd force = answer(c, corner, u).force;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (int k = 0; k < node_count(c.type); ++k) {
    Eigen::Vector3d f = Eigen::Vector3d::Zero();
    Eigen::Vector3d x = corner.col(k);
    for (int axis = 0; axis < d; ++axis) {
      f(axis) = force(k * d + axis);
      x(axis) += u(k * d + axis);
    }
    sum += f;
    moment += x.cross(f);
  }
  EXPECT_LT(sum.norm(), 1e-13 * force.norm());
  EXPECT_LT(moment.norm(), 1e-13 * force.norm() * 0.1);
}

// A unit cell stretched by a factor of 0.7 to 2 with free sides: force = A stretch E (stretch^2 - 1) / 2, sides at sqrt(1 - nu (stretch^2 -
// 1)).
TEST(Response, UniaxialStretchMatchesStVenantKirchhoff) {
  for (const Case& c : {Case{Type::Quad4, Model::PlaneStress, Integration::Full}, Case{Type::Hex8, Model::Solid, Integration::Full}}) {
    const int d = dimension(c.type);
    const Corners corner = 0.005 * reference(c.type);
    for (const double stretch : {0.7, 0.95, 1.2, 1.6}) {
      const double green = 0.5 * (stretch * stretch - 1);
      const double side = std::sqrt(1 - 2 * tissue.poisson * green);
      Eigen::VectorXd u(node_count(c.type) * d);
      for (int k = 0; k < node_count(c.type); ++k) {
        u(k * d) = (stretch - 1) * corner(0, k);
        for (int i = 1; i < d; ++i) u(k * d + i) = (side - 1) * corner(i, k);
      }
      const Eigen::VectorXd force = answer(c, corner, u).force;
      double pull = 0.0;
      for (int k = 0; k < node_count(c.type); ++k) {
        if (corner(0, k) > 0) pull += force(k * d);
        for (int i = 1; i < d; ++i) EXPECT_NEAR(force(k * d + i), 0.0, 1e-12);
      }
      const double area = 0.01 * (d == 2 ? thickness : 0.01);
      EXPECT_NEAR(pull / (area * tissue.young_pa), stretch * green, 1e-13);
    }
  }
}

}  // namespace
}  // namespace trocar::element
