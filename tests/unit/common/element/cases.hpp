// Elements of odd shape for the tests of this folder, and a second way to everything that the kernels compute: fourth-order tensors
// instead of Voigt matrices, shape functions written out, Gauss rules of any order.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "common/element/element.hpp"

namespace trocar::element {

struct Case {
  Type type{};
  Model model{};
  Integration integration{};
};

inline std::vector<Case> all_cases() {
  std::vector<Case> cases;
  for (const Integration integration : {Integration::Full, Integration::BBar}) {
    for (const Type type : {Type::Tri3, Type::Quad4})
      for (const Model model : {Model::PlaneStress, Model::PlaneStrain}) cases.push_back({type, model, integration});
    for (const Type type : {Type::Tet4, Type::Hex8}) cases.push_back({type, Model::Solid, integration});
  }
  return cases;
}

inline std::string type_name(Type type) {
  switch (type) {
    case Type::Tri3:
      return "Tri3";
    case Type::Quad4:
      return "Quad4";
    case Type::Tet4:
      return "Tet4";
    case Type::Hex8:
      break;
  }
  return "Hex8";
}

inline std::string case_name(const testing::TestParamInfo<Case>& info) {
  const Case& c = info.param;
  const std::string model = c.model == Model::PlaneStress ? "PlaneStress" : c.model == Model::PlaneStrain ? "PlaneStrain" : "Solid";
  return type_name(c.type) + model + (c.integration == Integration::BBar ? "BBar" : "Full");
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double operator()(double from, double to) { return from + (to - from) * static_cast<double>(engine_()) / 4294967295.0; }

 private:
  std::mt19937 engine_;
};

inline constexpr int sign_xi[8] = {-1, 1, 1, -1, -1, 1, 1, -1};
inline constexpr int sign_eta[8] = {-1, -1, 1, 1, -1, -1, 1, 1};
inline constexpr int sign_zeta[8] = {-1, -1, -1, -1, 1, 1, 1, 1};

inline bool simplex(Type type) { return type == Type::Tri3 || type == Type::Tet4; }

// The reference element: edges of 1 (simplices) or 2.
inline Corners reference(Type type) {
  Corners x = Corners::Zero();
  if (simplex(type)) {
    for (int k = 1; k < node_count(type); ++k) x(k - 1, k) = 1.0;
    return x;
  }
  for (int k = 0; k < node_count(type); ++k) {
    x(0, k) = sign_xi[k];
    x(1, k) = sign_eta[k];
    if (type == Type::Hex8) x(2, k) = sign_zeta[k];
  }
  return x;
}

// A sheared, stretched and turned copy of the reference element; `amount` moves each corner besides.
inline Corners distorted(Type type, Random& random, double amount, double size = 0.01) {
  Eigen::Matrix3d map;
  map << 1.1, 0.2, 0.1, -0.15, 0.9, 0.2, 0.1, -0.1, 1.2;
  if (dimension(type) == 2) map.row(2).setZero();
  const Corners base = reference(type);
  Corners x = Corners::Zero();
  for (int k = 0; k < node_count(type); ++k) {
    Eigen::Vector3d noise(random(-amount, amount), random(-amount, amount), random(-amount, amount));
    if (dimension(type) == 2) noise(2) = 0.0;
    x.col(k) = size * (map * base.col(k) + noise);
    x(0, k) += 0.03;
    x(1, k) -= 0.02;
  }
  return x;
}

struct GaussPoint {
  Eigen::Vector3d natural{0, 0, 0};
  double weight{};
};

// Gauss–Legendre on [-1, 1] from the eigenvalues of the Jacobi matrix (Golub and Welsch 1969).
inline std::vector<std::pair<double, double>> gauss_line(int n) {
  Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(n, n);
  for (int i = 1; i < n; ++i) jacobi(i, i - 1) = jacobi(i - 1, i) = i / std::sqrt(4.0 * i * i - 1.0);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(jacobi);
  std::vector<std::pair<double, double>> points;
  for (int i = 0; i < n; ++i) points.emplace_back(eigen.eigenvalues()(i), 2 * std::pow(eigen.eigenvectors()(0, i), 2));
  return points;
}

// n points along each direction; simplices by collapsing the cube.
inline std::vector<GaussPoint> gauss(Type type, int n) {
  const auto line = gauss_line(n);
  const std::vector<std::pair<double, double>> flat{{0.0, 1.0}};
  std::vector<GaussPoint> points;
  for (const auto& [x, wx] : line)
    for (const auto& [y, wy] : line)
      for (const auto& [z, wz] : dimension(type) == 3 ? line : flat) {
        if (!simplex(type)) {
          points.push_back({{x, y, dimension(type) == 3 ? z : 0.0}, wx * wy * wz});
          continue;
        }
        const double a = (1 + x) / 2;
        const double b = (1 + y) / 2;
        const double c = (1 + z) / 2;
        if (type == Type::Tri3)
          points.push_back({{a, b * (1 - a), 0.0}, wx * wy / 4 * (1 - a)});
        else
          points.push_back({{a, b * (1 - a), c * (1 - a) * (1 - b)}, wx * wy * wz / 8 * (1 - a) * (1 - a) * (1 - b)});
      }
  return points;
}

// Derivatives of the shape functions with respect to x (dimension x nodes), and the Jacobian's determinant.
inline Eigen::MatrixXd gradients(Type type, const Corners& corner, const Eigen::Vector3d& natural, double& determinant) {
  const int d = dimension(type);
  const int n = node_count(type);
  Eigen::MatrixXd local(d, n);
  if (simplex(type)) {
    local.col(0).setConstant(-1.0);
    local.rightCols(d).setIdentity();
  } else {
    for (int k = 0; k < n; ++k) {
      const double a = 1 + sign_xi[k] * natural(0);
      const double b = 1 + sign_eta[k] * natural(1);
      if (d == 2) {
        local.col(k) << sign_xi[k] * b / 4, sign_eta[k] * a / 4;
      } else {
        const double c = 1 + sign_zeta[k] * natural(2);
        local.col(k) << sign_xi[k] * b * c / 8, sign_eta[k] * a * c / 8, sign_zeta[k] * a * b / 8;
      }
    }
  }
  const Eigen::MatrixXd jacobian = local * corner.topLeftCorner(d, n).transpose();
  determinant = jacobian.determinant();
  return jacobian.fullPivLu().solve(local);
}

// C_ijkl = lambda d_ij d_kl + mu (d_ik d_jl + d_il d_jk); plane stress with lambda' = 2 lambda mu / (lambda + 2 mu).
struct Lame {
  double lambda{};
  double mu{};
  double bulk{};  // lambda + 2/3 mu of the solid
  Lame(Model model, const Material& m) {
    mu = m.young_pa / (2 * (1 + m.poisson));
    lambda = m.young_pa * m.poisson / ((1 + m.poisson) * (1 - 2 * m.poisson));
    bulk = lambda + 2 * mu / 3;
    if (model == Model::PlaneStress) lambda = 2 * lambda * mu / (lambda + 2 * mu);
  }
  [[nodiscard]] double operator()(int i, int j, int k, int l) const {
    return lambda * (i == j) * (k == l) + mu * ((i == k) * (j == l) + (i == l) * (j == k));
  }
};

inline Eigen::MatrixXd reference_stiffness(const Case& c, const Corners& corner, const Material& material, double thickness, int points) {
  const int d = dimension(c.type);
  const int n = node_count(c.type);
  const Lame lame(c.model, material);
  Eigen::MatrixXd k = Eigen::MatrixXd::Zero(n * d, n * d);
  for (const GaussPoint& p : gauss(c.type, points)) {
    double determinant = 0.0;
    const Eigen::MatrixXd g = gradients(c.type, corner, p.natural, determinant);
    const double dv = p.weight * determinant * (d == 2 ? thickness : 1.0);
    for (int a = 0; a < n; ++a)
      for (int b = 0; b < n; ++b)
        for (int i = 0; i < d; ++i)
          for (int j = 0; j < d; ++j)
            for (int r = 0; r < d; ++r)
              for (int s = 0; s < d; ++s) k(a * d + i, b * d + j) += lame(i, r, j, s) * g(r, a) * g(s, b) * dv;
  }
  return k;
}

inline Eigen::MatrixXd used(const Case& c, const Stiffness& k) {
  const int size = node_count(c.type) * dimension(c.type);
  return k.topLeftCorner(size, size);
}

inline Eigen::MatrixXd kernel_stiffness(const Case& c, const Corners& corner, const Material& material, double thickness) {
  Stiffness k;
  EXPECT_EQ(stiffness(c.type, c.integration, corner, elasticity(c.model, material), thickness, k), Status::Ok);
  return used(c, k);
}

// About z; in solids about a skew axis.
inline Eigen::Matrix3d rotation(Type type, double angle) {
  const Eigen::Vector3d axis = dimension(type) == 2 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d(1, 2, -2).normalized();
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

inline Eigen::MatrixXd block_rotation(Type type, const Eigen::Matrix3d& r) {
  const int d = dimension(type);
  Eigen::MatrixXd blocks = Eigen::MatrixXd::Zero(node_count(type) * d, node_count(type) * d);
  for (int k = 0; k < node_count(type); ++k) blocks.block(k * d, k * d, d, d) = r.topLeftCorner(d, d);
  return blocks;
}

// The components that the element has; through the heap, since GCC 12 warns of the unused one being read otherwise.
inline Eigen::VectorXd leading(const Eigen::VectorXd& x, int d) { return x.head(d); }

inline double relative(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / std::max(b.cwiseAbs().maxCoeff(), 1e-300);
}

inline constexpr Material tissue{25300.0, 0.48};
inline constexpr double thickness = 0.011;

}  // namespace trocar::element
