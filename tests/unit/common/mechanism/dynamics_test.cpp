// Inertia and Coriolis terms against what they were not derived from: body velocities by finite differences of positions,
// Christoffel symbols by finite differences of the mass matrix, conservation of energy along simulated motion.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <functional>
#include <vector>

#include "common/mechanism/twin.hpp"
#include "models.hpp"

namespace trocar::mechanism {
namespace {

using testing::pi;
using testing::RandomPoses;
using testing::uneven_twin;

Vec2 along(double angle) { return {std::cos(angle), std::sin(angle)}; }

double spin_energy(double inertia, double ahead, double behind, double dt) {
  const double speed = std::remainder(ahead - behind, 2.0 * pi) / dt;
  return 0.5 * inertia * speed * speed;
}

// Kinetic energy from two snapshots, dt apart, of where every body of a linkage is.
double kinetic_energy(const FiveBarModel& model, const Vec2& theta0, const Vec2& theta1, double dt) {
  FiveBarPose pose0, pose1;
  EXPECT_EQ(forward(model, theta0, pose0), Status::Ok);
  EXPECT_EQ(forward(model, theta1, pose1), Status::Ok);
  double energy = 0.5 * model.end_point_mass_kg * ((pose1.end - pose0.end) / dt).squaredNorm();
  for (std::size_t i = 0; i < 2; ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    const Link& proximal = model.proximal[i];
    const Link& distal = model.distal[i];
    const Vec2 com_p = proximal.com_m * (along(theta1(row)) - along(theta0(row)));
    const Vec2 com_d = pose1.elbow[i] + distal.com_m * along(pose1.distal_angle_rad[i]) -
                       (pose0.elbow[i] + distal.com_m * along(pose0.distal_angle_rad[i]));
    energy += 0.5 * proximal.mass_kg * (com_p / dt).squaredNorm() + 0.5 * distal.mass_kg * (com_d / dt).squaredNorm();
    energy += spin_energy(proximal.inertia_kg_m2 + model.reflected_inertia_kg_m2[i], theta1(row), theta0(row), dt);
    energy += spin_energy(distal.inertia_kg_m2, pose1.distal_angle_rad[i], pose0.distal_angle_rad[i], dt);
  }
  return energy;
}

double kinetic_energy(const TwinModel& model, const Vec3& x0, const Vec3& x1, const Vec4& q_near, double dt) {
  Vec4 q0, q1;
  EXPECT_EQ(inverse(model, x0, q_near, q0), Status::Ok);
  EXPECT_EQ(inverse(model, x1, q_near, q1), Status::Ok);
  const Vec2 com = x1.head<2>() - x0.head<2>() + (model.handle_com_m - model.handle_m) * (along(x1(2)) - along(x0(2)));
  return kinetic_energy(model.linkage[0], q0.head<2>(), q1.head<2>(), dt) +
         kinetic_energy(model.linkage[1], q0.tail<2>(), q1.tail<2>(), dt) + 0.5 * model.handle_mass_kg * (com / dt).squaredNorm() +
         spin_energy(model.handle_inertia_kg_m2, x1(2), x0(2), dt);
}

struct Inertia {
  Eigen::MatrixXd M, C;
};
using InertiaAt = std::function<Inertia(const Eigen::VectorXd& z, const Eigen::VectorXd& z_dot)>;

// C_ij = sum_k 1/2 (dM_ij/dz_k + dM_ik/dz_j - dM_jk/dz_i) z'_k, every derivative by differences.
void expect_christoffel(const InertiaAt& at, const Eigen::VectorXd& z, const Eigen::VectorXd& z_dot) {
  const Eigen::Index n = z.size();
  constexpr double h = 4e-6;
  std::vector<Eigen::MatrixXd> dM;
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto slope = [&](double step) -> Eigen::MatrixXd {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, k) * step;
      return (at(z + unit, z_dot).M - at(z - unit, z_dot).M) / (2.0 * step);
    };
    dM.emplace_back((4.0 * slope(h) - slope(2.0 * h)) / 3.0);  // fourth order
  }
  const Inertia here = at(z, z_dot);
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(n, n), M_dot = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const auto K = static_cast<std::size_t>(k);
    M_dot += dM[K] * z_dot(k);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        const auto I = static_cast<std::size_t>(i), J = static_cast<std::size_t>(j);
        expected(i, j) += 0.5 * (dM[K](i, j) + dM[J](i, k) - dM[I](j, k)) * z_dot(k);
      }
    }
  }
  EXPECT_LT((here.C - expected).norm(), 1e-6 * (expected.norm() + 1e-9));
  EXPECT_LT((M_dot - here.C - here.C.transpose()).norm(), 1e-6 * (M_dot.norm() + 1e-9));  // M' - 2 C is skew
  EXPECT_LT((here.M - here.M.transpose()).norm(), 1e-15);
  EXPECT_EQ(here.M.llt().info(), Eigen::Success);  // positive definite
}

TEST(Dynamics, FiveBarMassMatrixIsTheKineticEnergyOfItsLinks) {
  const TwinModel twin = uneven_twin();
  RandomPoses poses(twin);
  for (int i = 0; i < 200; ++i) {
    const TwinState state = poses.next();
    const FiveBarModel& model = twin.linkage[0];
    const Vec2 theta = state.q.head<2>(), theta_dot = poses.vector<Vec2>(5.0);
    Mat2 D, C;
    ASSERT_EQ(dynamics(model, theta, theta_dot, D, C), Status::Ok);
    constexpr double h = 1e-6;
    const double expected = kinetic_energy(model, theta - h * theta_dot, theta + h * theta_dot, 2.0 * h);
    EXPECT_NEAR(0.5 * theta_dot.dot(D * theta_dot), expected, 1e-7 * expected);
  }
}

TEST(Dynamics, TwinMassMatrixIsTheKineticEnergyOfItsLinksAndHandle) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  for (int i = 0; i < 200; ++i) {
    const TwinState state = poses.next();
    const Vec3 x_dot = poses.vector<Vec3>(0.5).cwiseProduct(Vec3(1.0, 1.0, 20.0));
    Mat3 M, C;
    ASSERT_EQ(dynamics(model, state, x_dot, M, C), Status::Ok);
    constexpr double h = 1e-6;
    const double expected = kinetic_energy(model, state.x - h * x_dot, state.x + h * x_dot, state.q, 2.0 * h);
    EXPECT_NEAR(0.5 * x_dot.dot(M * x_dot), expected, 1e-7 * expected);
  }
}

TEST(Dynamics, FiveBarCoriolisMatrixHoldsTheChristoffelSymbols) {
  const TwinModel twin = uneven_twin();
  RandomPoses poses(twin);
  const FiveBarModel& model = twin.linkage[1];
  const InertiaAt at = [&](const Eigen::VectorXd& z, const Eigen::VectorXd& z_dot) {
    Mat2 D, C;
    EXPECT_EQ(dynamics(model, z, z_dot, D, C), Status::Ok);
    return Inertia{D, C};
  };
  for (int i = 0; i < 100; ++i) expect_christoffel(at, poses.next().q.tail<2>(), poses.vector<Vec2>(5.0));
}

TEST(Dynamics, TwinCoriolisMatrixHoldsTheChristoffelSymbols) {
  const TwinModel model = uneven_twin();
  RandomPoses poses(model);
  for (int i = 0; i < 100; ++i) {
    const TwinState start = poses.next();
    const InertiaAt at = [&](const Eigen::VectorXd& z, const Eigen::VectorXd& z_dot) {
      TwinState state;
      Mat3 M, C;
      EXPECT_EQ(at_pose(model, z, start.q, state), Status::Ok);
      EXPECT_EQ(dynamics(model, state, z_dot, M, C), Status::Ok);
      return Inertia{M, C};
    };
    expect_christoffel(at, start.x, poses.vector<Vec3>(1.0).cwiseProduct(Vec3(1.0, 1.0, 20.0)));
  }
}

TEST(Dynamics, WorkspaceAndJointFormsOfOneLinkageAgree) {
  // A twin whose second linkage and handle weigh nothing moves as its first linkage: D = J^T M J at the end point.
  TwinModel model = uneven_twin();
  model.handle_m = 0.0;
  model.handle_mass_kg = model.handle_inertia_kg_m2 = 0.0;
  FiveBarModel& light = model.linkage[1];
  for (std::size_t i = 0; i < 2; ++i) {
    light.proximal[i].mass_kg = light.proximal[i].inertia_kg_m2 = 0.0;
    light.distal[i].mass_kg = light.distal[i].inertia_kg_m2 = 0.0;
  }
  light.end_point_mass_kg = 0.0;
  light.reflected_inertia_kg_m2 = {};
  RandomPoses poses(model);
  for (int i = 0; i < 100; ++i) {
    const TwinState state = poses.next();
    Mat2 D, C_joint, J;
    Mat3 M, C;
    ASSERT_EQ(dynamics(model, state, Vec3::Zero(), M, C), Status::Ok);
    ASSERT_EQ(dynamics(model.linkage[0], state.q.head<2>(), Vec2::Zero(), D, C_joint), Status::Ok);
    ASSERT_EQ(jacobian(model.linkage[0], state.q.head<2>(), state.linkage[0], J), Status::Ok);
    EXPECT_LT((D - J.transpose() * M.topLeftCorner<2, 2>() * J).norm(), 1e-12 * D.norm());
    EXPECT_LT(M.row(2).norm(), 1e-15);
  }
}

struct Drift {
  double energy{};          // largest |E(t) - E(0)| / E(0)
  double kinetic_least{1};  // least share of kinetic energy on the way
  double distance{1};       // least singularity distance
};

constexpr double stiffness = 200.0;  // N/m, of the spring that keeps the handle in the middle of the workspace

// Classical Runge–Kutta on z'' = acceleration(z, z').
template <class Vector, class Acceleration, class Observe>
void integrate(Vector z, Vector z_dot, double seconds, double dt, const Acceleration& acceleration, const Observe& observe) {
  const int steps = static_cast<int>(std::lround(seconds / dt));
  for (int i = 0; i <= steps; ++i) {
    observe(z, z_dot);
    const Vector v1 = z_dot, a1 = acceleration(z, v1);
    const Vector v2 = z_dot + 0.5 * dt * a1, a2 = acceleration(z + 0.5 * dt * v1, v2);
    const Vector v3 = z_dot + 0.5 * dt * a2, a3 = acceleration(z + 0.5 * dt * v2, v3);
    const Vector v4 = z_dot + dt * a3, a4 = acceleration(z + dt * v3, v4);
    z += dt / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4);
    z_dot += dt / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
  }
}

Drift simulate_twin(double seconds, double coriolis_share = 1.0) {
  const TwinModel model = uneven_twin();
  const Vec2 centre(0.005, 0.15);
  TwinState state;
  EXPECT_EQ(at_pose(model, {0.0, 0.15, 0.4}, Vec4::Constant(0.5 * pi), state), Status::Ok);
  Vec4 q = state.q;
  Drift drift;
  double first = 0.0;
  const auto terms = [&](const Vec3& x, const Vec3& v, Mat3& M, Mat3& C) {
    ASSERT_EQ(at_pose(model, x, q, state), Status::Ok);
    ASSERT_EQ(dynamics(model, state, v, M, C), Status::Ok);
    q = state.q;
  };
  integrate<Vec3>(
      state.x, Vec3(0.6, -0.4, 12.0), seconds, 1e-3,
      [&](const Vec3& x, const Vec3& v) -> Vec3 {
        Mat3 M, C;
        terms(x, v, M, C);
        Vec3 force = -coriolis_share * C * v;
        force.head<2>() -= stiffness * (x.head<2>() - centre);
        return M.ldlt().solve(force);
      },
      [&](const Vec3& x, const Vec3& v) {
        Mat3 M, C;
        terms(x, v, M, C);
        const double kinetic = 0.5 * v.dot(M * v), energy = kinetic + 0.5 * stiffness * (x.head<2>() - centre).squaredNorm();
        if (first == 0.0) first = energy;
        drift.energy = std::max(drift.energy, std::abs(energy - first) / first);
        drift.kinetic_least = std::min(drift.kinetic_least, kinetic / energy);
        drift.distance = std::min(drift.distance, singularity_distance(model, state));
      });
  return drift;
}

Drift simulate_five_bar(double seconds, double coriolis_share = 1.0) {
  const FiveBarModel model = uneven_twin().linkage[0];
  const Vec2 centre(0.005, 0.15);
  Vec2 start;
  EXPECT_EQ(inverse(model, {-0.02, 0.13}, {2.5, 0.6}, start), Status::Ok);
  FiveBarPose pose;
  Drift drift;
  double first = 0.0;
  integrate<Vec2>(
      start, Vec2(4.0, 6.0), seconds, 5e-4,
      [&](const Vec2& theta, const Vec2& v) -> Vec2 {
        Mat2 D, C, J;
        EXPECT_EQ(forward(model, theta, pose), Status::Ok);
        EXPECT_EQ(jacobian(model, theta, pose, J), Status::Ok);
        EXPECT_EQ(dynamics(model, theta, v, D, C), Status::Ok);
        return D.ldlt().solve(-coriolis_share * C * v - stiffness * J.transpose() * (pose.end - centre));
      },
      [&](const Vec2& theta, const Vec2& v) {
        Mat2 D, C;
        EXPECT_EQ(forward(model, theta, pose), Status::Ok);
        EXPECT_EQ(dynamics(model, theta, v, D, C), Status::Ok);
        const double kinetic = 0.5 * v.dot(D * v), energy = kinetic + 0.5 * stiffness * (pose.end - centre).squaredNorm();
        if (first == 0.0) first = energy;
        drift.energy = std::max(drift.energy, std::abs(energy - first) / first);
        drift.kinetic_least = std::min(drift.kinetic_least, kinetic / energy);
        drift.distance = std::min(drift.distance, singularity_distance(model, theta, pose));
      });
  return drift;
}

TEST(Dynamics, TwinOnASpringConservesEnergy) {
  const Drift drift = simulate_twin(10.0);
  EXPECT_LT(drift.energy, 1e-6);
  EXPECT_LT(drift.kinetic_least, 0.7);  // energy does go back and forth
  EXPECT_GT(drift.distance, 0.15);
}

TEST(Dynamics, FiveBarOnASpringConservesEnergy) {
  const Drift drift = simulate_five_bar(10.0);
  EXPECT_LT(drift.energy, 1e-6);
  EXPECT_LT(drift.kinetic_least, 0.2);
  EXPECT_GT(drift.distance, 0.15);
}

TEST(Dynamics, TheSpringMotionsWouldShowAnErrorOfOnePartInAThousandInTheCoriolisTerms) {
  EXPECT_GT(simulate_twin(2.0, 0.999).energy, 1e-6);
  EXPECT_GT(simulate_five_bar(2.0, 0.999).energy, 1e-6);
}

}  // namespace
}  // namespace trocar::mechanism
