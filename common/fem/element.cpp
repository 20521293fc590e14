#include "common/fem/element.hpp"

#include <Eigen/LU>
#include <cmath>
#include <string>

namespace trocar::fem {
namespace {

using StrainMatrix = Eigen::Matrix<double, 3, 8>;

StrainMatrix strain_matrix(const Eigen::Matrix<double, 2, 4>& gradient) {
  StrainMatrix b = StrainMatrix::Zero();
  for (int k = 0; k < 4; ++k) {
    b(0, 2 * k) = gradient(0, k);
    b(1, 2 * k + 1) = gradient(1, k);
    b(2, 2 * k) = gradient(1, k);
    b(2, 2 * k + 1) = gradient(0, k);
  }
  return b;
}

// Adds weight * B^T C B at one integration point; `local` holds the shape functions' derivatives in natural coordinates.
void add_point(const Eigen::Matrix<double, 2, 4>& local, const Eigen::Matrix<double, 2, 4>& corner, const Eigen::Matrix3d& c, double weight,
               ElementStiffness& k) {
  const Eigen::Matrix2d jacobian = local * corner.transpose();
  const double determinant = jacobian.determinant();
  if (!(determinant > 0.0))
    throw Error("element at (" + std::to_string(corner(0, 0)) + ", " + std::to_string(corner(1, 0)) +
                ") m is inverted or has no area; list its nodes counter-clockwise and keep its angles below 180 degrees");
  const StrainMatrix b = strain_matrix(jacobian.inverse() * local);
  k += (weight * determinant) * b.transpose() * c * b;
}

}  // namespace

Eigen::Matrix3d elasticity(Model model, const Material& material) {
  const double e = material.young_pa;
  const double nu = material.poisson;
  if (!(e > 0.0) || !std::isfinite(e)) throw Error("young_pa = " + std::to_string(e) + ": must be positive, for soft tissue 1e3 to 1e6 Pa");
  if (!(nu >= 0.0 && nu < 0.5)) throw Error("poisson = " + std::to_string(nu) + ": must be at least 0 and below 0.5, such as 0.48");
  Eigen::Matrix3d c = Eigen::Matrix3d::Zero();
  if (model == Model::PlaneStress) {
    c << 1, nu, 0, nu, 1, 0, 0, 0, (1 - nu) / 2;
    return e / (1 - nu * nu) * c;
  }
  c << 1 - nu, nu, 0, nu, 1 - nu, 0, 0, 0, (1 - 2 * nu) / 2;
  return e / ((1 + nu) * (1 - 2 * nu)) * c;
}

ElementStiffness stiffness(Element type, std::span<const Point> corners, const Eigen::Matrix3d& elasticity_pa, double thickness_m) {
  Eigen::Matrix<double, 2, 4> corner = Eigen::Matrix<double, 2, 4>::Zero();
  Eigen::Index column = 0;
  for (const Point& p : corners) {
    corner.col(column) << p[0], p[1];
    ++column;
  }
  ElementStiffness k = ElementStiffness::Zero();
  Eigen::Matrix<double, 2, 4> local;
  if (type == Element::Tri3) {
    local << -1, 1, 0, 0, -1, 0, 1, 0;
    add_point(local, corner, elasticity_pa, 0.5 * thickness_m, k);
    return k;
  }
  const double gauss = 1.0 / std::sqrt(3.0);
  for (const double xi : {-gauss, gauss}) {
    for (const double eta : {-gauss, gauss}) {
      local << -(1 - eta), 1 - eta, 1 + eta, -(1 + eta), -(1 - xi), -(1 + xi), 1 + xi, 1 - xi;
      local *= 0.25;
      add_point(local, corner, elasticity_pa, thickness_m, k);
    }
  }
  return k;
}

}  // namespace trocar::fem
