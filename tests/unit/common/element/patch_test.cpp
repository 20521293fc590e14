// The patch test (Irons): 2 x 2 (x 2) cells whose inner node is moved; a linear displacement prescribed on the boundary must come out
// inside, on every shape of element, with the stress that Hooke's law gives.
#include "cases.hpp"

namespace trocar::element {
namespace {

struct Patch {
  std::vector<Eigen::Vector3d> node{};
  std::vector<std::vector<int>> element{};
  int inner{};
};

// Triangles and tetrahedra split each cell: 2 triangles, or 6 tetrahedra along one diagonal (Kuhn).
Patch patch(Type type, Random& random) {
  const int d = dimension(type);
  Patch result;
  const auto index = [](int i, int j, int k) { return (k * 3 + j) * 3 + i; };
  for (int k = 0; k < (d == 3 ? 3 : 1); ++k)
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < 3; ++i) {
        // Boundary nodes move too: the patch is no box.
        Eigen::Vector3d x(i + random(-0.15, 0.15), j + random(-0.15, 0.15), d == 3 ? k + random(-0.15, 0.15) : 0.0);
        if (i == 1 && j == 1 && (d == 2 || k == 1))
          for (int axis = 0; axis < d; ++axis) x(axis) += 0.1;
        result.node.push_back(0.01 * x);
      }
  result.inner = d == 3 ? index(1, 1, 1) : index(1, 1, 0);
  for (int k = 0; k < (d == 3 ? 2 : 1); ++k)
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 2; ++i) {
        const std::vector<int> bottom{index(i, j, k), index(i + 1, j, k), index(i + 1, j + 1, k), index(i, j + 1, k)};
        if (type == Type::Quad4) result.element.push_back(bottom);
        if (type == Type::Tri3) {
          result.element.push_back({bottom[0], bottom[1], bottom[2]});
          result.element.push_back({bottom[0], bottom[2], bottom[3]});
        }
        if (d == 2) continue;
        const std::vector<int> top{index(i, j, k + 1), index(i + 1, j, k + 1), index(i + 1, j + 1, k + 1), index(i, j + 1, k + 1)};
        if (type == Type::Hex8) {
          result.element.push_back(bottom);
          result.element.back().insert(result.element.back().end(), top.begin(), top.end());
        } else {
          const int from = bottom[0];
          const int to = top[2];
          const int ring[7] = {bottom[1], bottom[2], bottom[3], top[3], top[0], top[1], bottom[1]};
          for (int r = 0; r < 6; ++r) result.element.push_back({from, ring[r], ring[r + 1], to});
        }
      }
  return result;
}

Corners corners(const Patch& p, const std::vector<int>& element) {
  Corners x = Corners::Zero();
  for (std::size_t k = 0; k < element.size(); ++k) x.col(static_cast<Eigen::Index>(k)) = p.node[static_cast<std::size_t>(element[k])];
  return x;
}

class EachPatch : public testing::TestWithParam<Case> {};
INSTANTIATE_TEST_SUITE_P(Element, EachPatch, testing::ValuesIn(all_cases()), case_name);

TEST_P(EachPatch, ReproducesALinearField) {
  const Case c = GetParam();
  const int d = dimension(c.type);
  Random random(1);
  for (const double poisson : {0.0, 0.48, 0.499}) {
    const Patch p = patch(c.type, random);
    const auto size = static_cast<Eigen::Index>(p.node.size()) * d;
    Eigen::Matrix3d slope;
    slope << 0.03, -0.02, 0.01, 0.01, 0.04, -0.03, 0.02, 0.015, -0.05;
    Eigen::VectorXd linear(size);
    for (std::size_t n = 0; n < p.node.size(); ++n)
      linear.segment(static_cast<Eigen::Index>(n) * d, d) = leading(slope * p.node[n], d) + Eigen::VectorXd::Constant(d, 1e-4);

    Eigen::MatrixXd k = Eigen::MatrixXd::Zero(size, size);
    double volume = 0.0;
    const Eigen::Matrix3d strain = 0.5 * (slope + slope.transpose());
    const Lame lame(c.model, {1000.0, poisson});
    double energy = 0.0;  // of Hooke's law at that constant strain
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j)
        for (int r = 0; r < d; ++r)
          for (int s = 0; s < d; ++s) energy += 0.5 * lame(i, j, r, s) * strain(i, j) * strain(r, s);
    for (const auto& element : p.element) {
      const Corners x = corners(p, element);
      const Eigen::MatrixXd ke = kernel_stiffness(c, x, {1000.0, poisson}, thickness);
      for (std::size_t a = 0; a < element.size(); ++a)
        for (std::size_t b = 0; b < element.size(); ++b)
          k.block(element[a] * d, element[b] * d, d, d) +=
              ke.block(static_cast<Eigen::Index>(a) * d, static_cast<Eigen::Index>(b) * d, d, d);
      for (const GaussPoint& point : gauss(c.type, 3)) {
        double determinant = 0.0;
        (void)gradients(c.type, x, point.natural, determinant);
        volume += point.weight * determinant * (d == 2 ? thickness : 1.0);
      }
    }
    const Eigen::Index inner = p.inner * d;
    const Eigen::VectorXd others = [&] {
      Eigen::VectorXd u = linear;
      u.segment(inner, d).setZero();
      return u;
    }();
    const Eigen::VectorXd solved = k.block(inner, inner, d, d).ldlt().solve(-(k.middleRows(inner, d) * others));
    EXPECT_LT((solved - linear.segment(inner, d)).cwiseAbs().maxCoeff(), 1e-12 * linear.cwiseAbs().maxCoeff());
    EXPECT_NEAR(0.5 * linear.dot(k * linear) / (energy * volume), 1.0, 1e-12);
  }
}

// The nodal forces of a constant stress: integral of sigma g dV, the volume integral of g taken with many points.
TEST_P(EachPatch, AnswersConstantStrainWithConstantStress) {
  const Case c = GetParam();
  const int d = dimension(c.type);
  Random random(2);
  const Corners corner = distorted(c.type, random, 0.2);
  Eigen::Matrix3d slope;
  slope << 0.03, -0.02, 0.01, 0.01, 0.04, -0.03, 0.02, 0.015, -0.05;
  const Lame lame(c.model, tissue);
  Eigen::MatrixXd sigma = Eigen::MatrixXd::Zero(d, d);
  for (int i = 0; i < d; ++i)
    for (int j = 0; j < d; ++j)
      for (int r = 0; r < d; ++r)
        for (int s = 0; s < d; ++s) sigma(i, j) += lame(i, j, r, s) * slope(r, s);
  Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(d, node_count(c.type));
  for (const GaussPoint& p : gauss(c.type, 4)) {
    double determinant = 0.0;
    const Eigen::MatrixXd g = gradients(c.type, corner, p.natural, determinant);
    mean += p.weight * determinant * (d == 2 ? thickness : 1.0) * g;
  }
  const Eigen::MatrixXd expected = sigma * mean;
  Eigen::VectorXd u(node_count(c.type) * d);
  for (int k = 0; k < node_count(c.type); ++k) u.segment(k * d, d) = leading(slope * corner.col(k), d);
  const Eigen::VectorXd force = kernel_stiffness(c, corner, tissue, thickness) * u;
  EXPECT_LT((force - Eigen::Map<const Eigen::VectorXd>(expected.data(), expected.size())).cwiseAbs().maxCoeff(),
            1e-12 * expected.cwiseAbs().maxCoeff());
}

}  // namespace
}  // namespace trocar::element
