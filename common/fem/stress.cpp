#include "common/fem/stress.hpp"

#include <Eigen/LU>
#include <cmath>

#include "common/fem/statics.hpp"

namespace trocar::fem {
namespace {

Eigen::Vector3d centre_of(Type type) {
  switch (type) {
    case Type::Tri3:
      return {1.0 / 3.0, 1.0 / 3.0, 0.0};
    case Type::Tet4:
      return {0.25, 0.25, 0.25};
    case Type::Quad4:
    case Type::Hex8:
      break;
  }
  return Eigen::Vector3d::Zero();
}

}  // namespace

std::vector<Stress> centre_stresses(const Mesh& mesh, const Tissue& tissue, const Eigen::VectorXd& displacement_m) {
  const auto elasticity = elasticities(mesh, tissue);
  const auto zone = zones_of(mesh, tissue.zones);
  const int d = mesh.dimension();
  const int count = mesh.nodes_per_element();
  element::Shape value;
  element::ShapeGradient natural;
  element::shape(mesh.type, centre_of(mesh.type), value, natural);

  std::vector<Stress> result(mesh.element.size());
  for (std::size_t e = 0; e < mesh.element.size(); ++e) {
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
    jacobian.topLeftCorner(d, d) = natural.topLeftCorner(d, count) * mesh.corners(e).topLeftCorner(d, count).transpose();
    const Eigen::Matrix3d to_space = jacobian.inverse();
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();  // h(i, j) = d u_i / d x_j
    for (int k = 0; k < count; ++k)
      for (int i = 0; i < d; ++i)
        for (int j = 0; j < d; ++j)
          h(i, j) +=
              displacement_m[mesh.element[e][static_cast<std::size_t>(k)] * d + i] * to_space.row(j).head(d).dot(natural.col(k).head(d));
    Eigen::Matrix3d strain = 0.5 * (h + h.transpose());
    if (tissue.strain == Strain::GreenLagrange) strain += 0.5 * h.transpose() * h;

    Eigen::Matrix<double, 6, 1> voigt = Eigen::Matrix<double, 6, 1>::Zero();
    if (d == 2)
      voigt.head<3>() << strain(0, 0), strain(1, 1), 2.0 * strain(0, 1);
    else
      voigt << strain(0, 0), strain(1, 1), strain(2, 2), 2.0 * strain(0, 1), 2.0 * strain(1, 2), 2.0 * strain(2, 0);
    const Eigen::Matrix<double, 6, 1> s = elasticity[static_cast<std::size_t>(zone[e])] * voigt;
    result[e] = d == 2 ? Stress{s[0], s[1], s[3], s[2], 0.0, 0.0} : Stress{s[0], s[1], s[2], s[3], s[4], s[5]};
  }
  return result;
}

double von_mises_pa(const Stress& s) noexcept {
  return std::sqrt(0.5 * ((s[0] - s[1]) * (s[0] - s[1]) + (s[1] - s[2]) * (s[1] - s[2]) + (s[2] - s[0]) * (s[2] - s[0])) +
                   3.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5]));
}

}  // namespace trocar::fem
