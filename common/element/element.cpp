#include "common/element/element.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace trocar::element {
namespace {

// Corners of [-1, 1]^3 in the order of Hex8's nodes; Quad4's are the first four without the last component.
constexpr std::array<double, 8> corner_xi{-1, 1, 1, -1, -1, 1, 1, -1};
constexpr std::array<double, 8> corner_eta{-1, -1, 1, 1, -1, -1, 1, 1};
constexpr std::array<double, 8> corner_zeta{-1, -1, -1, -1, 1, 1, 1, 1};

struct Local {
  std::array<double, 8> value{};
  std::array<double, 24> gradient{};  // 3 x 8, column by column
};

constexpr Local local(Type type, double xi, double eta, double zeta) noexcept {
  switch (type) {
    case Type::Tri3:
      return {{1 - xi - eta, xi, eta}, {-1, -1, 0, 1, 0, 0, 0, 1, 0}};
    case Type::Tet4:
      return {{1 - xi - eta - zeta, xi, eta, zeta}, {-1, -1, -1, 1, 0, 0, 0, 1, 0, 0, 0, 1}};
    case Type::Quad4:
    case Type::Hex8:
      break;
  }
  const bool solid = type == Type::Hex8;
  Local at;
  for (std::size_t k = 0; k < (solid ? 8u : 4u); ++k) {
    const double a = 0.5 * (1 + corner_xi[k] * xi);
    const double b = 0.5 * (1 + corner_eta[k] * eta);
    const double c = solid ? 0.5 * (1 + corner_zeta[k] * zeta) : 1.0;
    at.value[k] = a * b * c;
    at.gradient[3 * k] = 0.5 * corner_xi[k] * b * c;
    at.gradient[3 * k + 1] = 0.5 * corner_eta[k] * a * c;
    at.gradient[3 * k + 2] = solid ? 0.5 * corner_zeta[k] * a * b : 0.0;
  }
  return at;
}

struct Point {
  Local at{};
  double weight{};
};

template <Type type>
constexpr auto rule() noexcept {
  constexpr double g = 0.57735026918962576451;  // 1 / sqrt(3)
  if constexpr (type == Type::Tri3) {
    return std::array{Point{local(type, 1.0 / 3, 1.0 / 3, 0), 1.0 / 2}};
  } else if constexpr (type == Type::Tet4) {
    return std::array{Point{local(type, 0.25, 0.25, 0.25), 1.0 / 6}};
  } else {
    std::array<Point, std::size_t{node_count(type)}> points{};
    for (std::size_t k = 0; k < points.size(); ++k)
      points[k] = {local(type, g * corner_xi[k], g * corner_eta[k], type == Type::Hex8 ? g * corner_zeta[k] : 0.0), 1.0};
    return points;
  }
}

template <Type type>
struct Kernel {
  static constexpr int nodes = node_count(type);
  static constexpr int dim = dimension(type);
  static constexpr int size = nodes * dim;
  static constexpr int zz = dim == 2 ? 3 : 2;
  static constexpr int rows = dim == 2 ? 4 : 6;  // strains; planar ones are followed by zz, which only BBar fills
  static constexpr auto points = rule<type>();
  static constexpr std::size_t count = points.size();
  using Tensor = Eigen::Matrix<double, dim, dim>;
  using Gradient = Eigen::Matrix<double, dim, nodes>;
  using Moduli = Eigen::Matrix<double, rows, rows>;
  using Strain = Eigen::Matrix<double, rows, 1>;
  using StrainMatrix = Eigen::Matrix<double, rows, size>;

  std::array<Gradient, count> gradient;  // with respect to x
  std::array<double, count> volume;      // m^3 that each point stands for

  [[nodiscard]] Status place(const Corners& corner, double thickness_m) noexcept {
    for (std::size_t p = 0; p < count; ++p) {
      const Gradient natural = Eigen::Map<const ShapeGradient>(points[p].at.gradient.data()).template topLeftCorner<dim, nodes>();
      const Tensor jacobian = natural * corner.template topLeftCorner<dim, nodes>().transpose();
      const double determinant = jacobian.determinant();
      if (!(determinant > 0.0) || !std::isfinite(determinant)) return Status::Inverted;
      gradient[p].noalias() = jacobian.inverse() * natural;
      volume[p] = determinant * points[p].weight * (dim == 2 ? thickness_m : 1.0);
    }
    return Status::Ok;
  }

  // Strain per displacement where the deformation gradient is f; the linear strain is the case f = 1.
  [[nodiscard]] static StrainMatrix strain_matrix(const Gradient& g, const Tensor& f) noexcept {
    StrainMatrix b;
    for (int k = 0; k < nodes; ++k) {
      const int column = k * dim;
      for (int i = 0; i < dim; ++i) {
        for (int axis = 0; axis < dim; ++axis) b(axis, column + i) = f(i, axis) * g(axis, k);
        if constexpr (dim == 2) {
          b(2, column + i) = f(i, 0) * g(1, k) + f(i, 1) * g(0, k);
          b(3, column + i) = 0.0;
        } else {
          b(3, column + i) = f(i, 0) * g(1, k) + f(i, 1) * g(0, k);
          b(4, column + i) = f(i, 1) * g(2, k) + f(i, 2) * g(1, k);
          b(5, column + i) = f(i, 2) * g(0, k) + f(i, 0) * g(2, k);
        }
      }
    }
    return b;
  }

  // k += B^T C B dV, upper triangle of blocks.
  static void add_material(const StrainMatrix& b, const Moduli& c, double dv, Stiffness& k) noexcept {
    const StrainMatrix cb = (dv * c).lazyProduct(b);
    for (int column = 0; column < nodes; ++column)
      for (int row = 0; row <= column; ++row)
        k.template block<dim, dim>(row * dim, column * dim) +=
            b.template middleCols<dim>(row * dim).transpose().lazyProduct(cb.template middleCols<dim>(column * dim));
  }

  static void mirror(Stiffness& k) noexcept {
    for (int column = 0; column < size; ++column)
      for (int row = column + 1; row < size; ++row) k(row, column) = k(column, row);
  }

  // In plane stress nothing constrains the volume, in simplices the strain is its own mean.
  [[nodiscard]] static bool relaxes(Integration integration, const Moduli& c) noexcept {
    return count > 1 && integration == Integration::BBar && c(zz, zz) > 0.0;
  }

  // The volumetric strain of each point, and of each column, becomes its mean over the element.
  template <class Strains>
  void average_volumetric(std::array<Strains, count>& at) const noexcept {
    using Row = Eigen::Matrix<double, 1, Strains::ColsAtCompileTime>;
    Row mean = Row::Zero();
    double total = 0.0;
    for (std::size_t p = 0; p < count; ++p) {
      mean += volume[p] * (at[p].row(0) + at[p].row(1) + at[p].row(zz));
      total += volume[p];
    }
    mean /= total;
    for (auto& strains : at) {
      const Row third = (mean - (strains.row(0) + strains.row(1) + strains.row(zz))) / 3;
      strains.row(0) += third;
      strains.row(1) += third;
      strains.row(zz) += third;
    }
  }

  void add_linear(Integration integration, const Moduli& c, Stiffness& k) const noexcept {
    std::array<StrainMatrix, count> b;
    for (std::size_t p = 0; p < count; ++p) b[p] = strain_matrix(gradient[p], Tensor::Identity());
    if (relaxes(integration, c)) average_volumetric(b);
    for (std::size_t p = 0; p < count; ++p) add_material(b[p], c, volume[p], k);
    mirror(k);
  }

  void add_response(Integration integration, const Moduli& c, const Values& u, Values& force, Stiffness& tangent) const noexcept {
    const Gradient motion = Eigen::Map<const Gradient>(u.data());
    std::array<StrainMatrix, count> b;
    std::array<Strain, count> strain;
    for (std::size_t p = 0; p < count; ++p) {
      const Tensor slope = motion * gradient[p].transpose();  // du_i / dx_j
      b[p] = strain_matrix(gradient[p], Tensor::Identity() + slope);
      // (F^T F - 1) / 2 without forming F^T F - 1, whose digits cancel when strains are small.
      const Tensor e = 0.5 * (slope + slope.transpose() + slope.transpose() * slope);
      if constexpr (dim == 2)
        strain[p] << e(0, 0), e(1, 1), 2 * e(0, 1), 0;
      else
        strain[p] << e(0, 0), e(1, 1), e(2, 2), 2 * e(0, 1), 2 * e(1, 2), 2 * e(2, 0);
    }
    if (relaxes(integration, c)) {
      average_volumetric(b);
      average_volumetric(strain);
    }
    for (std::size_t p = 0; p < count; ++p) {
      const Strain s = volume[p] * (c * strain[p]);
      Tensor stress;
      if constexpr (dim == 2)
        stress << s(0), s(2), s(2), s(1);
      else
        stress << s(0), s(3), s(5), s(3), s(1), s(4), s(5), s(4), s(2);
      force.template head<size>().noalias() += b[p].transpose() * s;
      add_material(b[p], c, volume[p], tangent);
      // The second derivative of the averaged strain adds nothing of its own: the mean stress is the same at all points.
      const Eigen::Matrix<double, nodes, nodes> geometric = gradient[p].transpose() * (stress * gradient[p]);
      for (int column = 0; column < nodes; ++column)
        for (int row = 0; row <= column; ++row)
          for (int i = 0; i < dim; ++i) tangent(row * dim + i, column * dim + i) += geometric(row, column);
    }
    mirror(tangent);
  }
};

// Planar kernels read the moduli of xx, yy, xy and zz, which the header keeps in the leading 4 x 4.
template <Type type>
[[nodiscard]] typename Kernel<type>::Moduli moduli(const Elasticity& c) noexcept {
  return c.template topLeftCorner<Kernel<type>::rows, Kernel<type>::rows>();
}

template <class Call>
auto dispatch(Type type, Call&& call) noexcept {
  switch (type) {
    case Type::Tri3:
      return call.template operator()<Type::Tri3>();
    case Type::Quad4:
      return call.template operator()<Type::Quad4>();
    case Type::Tet4:
      return call.template operator()<Type::Tet4>();
    case Type::Hex8:
      break;
  }
  return call.template operator()<Type::Hex8>();
}

template <int dim, int nodes>
[[nodiscard]] bool invert_map(Type type, const Corners& corner, const Eigen::Vector3d& x_m, Eigen::Vector3d& natural) noexcept {
  using Vector = Eigen::Matrix<double, dim, 1>;
  // Relative to the first corner, so that an element far from the origin keeps its digits.
  const Vector origin = corner.template topLeftCorner<dim, 1>();
  const Eigen::Matrix<double, dim, nodes> edge = corner.template topLeftCorner<dim, nodes>().colwise() - origin;
  const Vector target = x_m.head<dim>() - origin;
  constexpr bool simplex = nodes == dim + 1;
  natural.setZero();
  if constexpr (simplex) natural.head<dim>().setConstant(1.0 / nodes);
  // Undamped Newton from the centre found every one of 160,000 points in quads and bricks with corners moved by up to 0.9 of half an edge.
  constexpr int max_iterations = 40;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const Local at = local(type, natural(0), natural(1), natural(2));
    const Eigen::Map<const Eigen::Matrix<double, nodes, 1>> value(at.value.data());
    const auto gradient = Eigen::Map<const ShapeGradient>(at.gradient.data()).topLeftCorner<dim, nodes>();
    const Eigen::Matrix<double, dim, dim> jacobian = edge * gradient.transpose();  // dx_i / dxi_j
    const double determinant = jacobian.determinant();
    if (determinant == 0.0 || !std::isfinite(determinant)) return false;
    const Vector step = jacobian.inverse() * (target - edge * value);
    const double length = step.template lpNorm<Eigen::Infinity>();
    if (!std::isfinite(length)) return false;
    natural.head<dim>() += step;
    if (length <= 1e-12 * (1.0 + natural.lpNorm<Eigen::Infinity>())) return true;
  }
  return false;
}

}  // namespace

Elasticity elasticity(Model model, const Material& material) noexcept {
  const double e = material.young_pa;
  const double nu = material.poisson;
  const double mu = e / (2 * (1 + nu));
  Elasticity c = Elasticity::Zero();
  if (model == Model::PlaneStress) {
    c(0, 0) = c(1, 1) = e / (1 - nu * nu);
    c(0, 1) = c(1, 0) = nu * e / (1 - nu * nu);
    c(2, 2) = mu;
    return c;
  }
  const double lambda = e * nu / ((1 + nu) * (1 - 2 * nu));
  const bool planar = model == Model::PlaneStrain;
  const int zz = planar ? 3 : 2;
  for (const int row : {0, 1, zz})
    for (const int column : {0, 1, zz}) c(row, column) = lambda + (row == column ? 2 * mu : 0.0);
  if (planar)
    c(2, 2) = mu;
  else
    c(3, 3) = c(4, 4) = c(5, 5) = mu;
  return c;
}

void shape(Type type, const Eigen::Vector3d& natural, Shape& value, ShapeGradient& gradient) noexcept {
  const Local at = local(type, natural(0), natural(1), natural(2));
  value = Eigen::Map<const Shape>(at.value.data());
  gradient = Eigen::Map<const ShapeGradient>(at.gradient.data());
}

bool natural_coordinates(Type type, const Corners& corner, const Eigen::Vector3d& x_m, Eigen::Vector3d& natural) noexcept {
  return dispatch(type, [&]<Type kind>() noexcept { return invert_map<dimension(kind), node_count(kind)>(kind, corner, x_m, natural); });
}

bool inside(Type type, const Eigen::Vector3d& natural, double tolerance) noexcept {
  const auto used = natural.head(dimension(type));
  if (type == Type::Tri3 || type == Type::Tet4) return used.minCoeff() >= -tolerance && used.sum() <= 1.0 + tolerance;
  return used.cwiseAbs().maxCoeff() <= 1.0 + tolerance;
}

Status stiffness(Type type, Integration integration, const Corners& corner, const Elasticity& c, double thickness_m,
                 Stiffness& k) noexcept {
  k.setZero();
  return dispatch(type, [&]<Type kind>() noexcept {
    Kernel<kind> kernel;
    const Status status = kernel.place(corner, thickness_m);
    if (status == Status::Ok) kernel.add_linear(integration, moduli<kind>(c), k);
    return status;
  });
}

Status response(Type type, Integration integration, const Corners& corner, const Elasticity& c, double thickness_m, const Values& u,
                Values& force, Stiffness& tangent) noexcept {
  force.setZero();
  tangent.setZero();
  return dispatch(type, [&]<Type kind>() noexcept {
    Kernel<kind> kernel;
    const Status status = kernel.place(corner, thickness_m);
    if (status == Status::Ok) kernel.add_response(integration, moduli<kind>(c), u, force, tangent);
    return status;
  });
}

}  // namespace trocar::element
