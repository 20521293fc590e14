// Supports of statics.hpp, and the refusal of a mesh that they do not hold.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "common/fem/statics.hpp"

namespace trocar::fem {
namespace {

// Smallest node index of the part that each node belongs to; parts share no node.
std::vector<int> parts_of(const Mesh& mesh) {
  std::vector<int> part(mesh.node.size());
  std::iota(part.begin(), part.end(), 0);
  const auto root = [&part](int n) {
    while (part[static_cast<std::size_t>(n)] != n) {
      auto& up = part[static_cast<std::size_t>(n)];
      up = part[static_cast<std::size_t>(up)];
      n = up;
    }
    return n;
  };
  for (const auto& e : mesh.element)
    for (std::size_t k = 1; k < static_cast<std::size_t>(mesh.nodes_per_element()); ++k) {
      const int a = root(e[0]);
      const int b = root(e[k]);
      part[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  for (std::size_t n = 0; n < part.size(); ++n) part[n] = root(static_cast<int>(n));
  return part;
}

// Displacement of x along `axis` in each rigid motion about the centre: three translations, three rotations (scaled to be comparable).
Eigen::Matrix<double, 6, 1> rigid(const Eigen::Vector3d& from_centre, int axis) {
  Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
  motion[axis] = 1.0;
  const int next = (axis + 1) % 3;
  const int last = (axis + 2) % 3;
  // u = omega x r: u_axis = omega_next r_last - omega_last r_next
  motion[3 + next] = from_centre[last];
  motion[3 + last] = -from_centre[next];
  return motion;
}

constexpr std::array<const char*, 6> planar_name{"move along x", "move along y", "", "", "", "rotate"};
constexpr std::array<const char*, 6> solid_name{"move along x",   "move along y",   "move along z",
                                                "rotate about x", "rotate about y", "rotate about z"};

// The rigid motions that every support allows are the null space of their Gram matrix over the supported degrees of freedom.
// Empty when there are none, else words for those that lie in it.
std::string free_motion(const Mesh& mesh, const std::vector<int>& nodes, const std::vector<bool>& fixed) {
  const int d = mesh.dimension();
  const auto at = [&](int n) {
    const Point& x = mesh.node[static_cast<std::size_t>(n)];
    return Eigen::Vector3d(x[0], x[1], x[2]);
  };
  const auto is_fixed = [&](int n, int axis) { return fixed[static_cast<std::size_t>(n * d + axis)]; };
  // Rotations are told about a point that supports leave in place: the mean of the nodes that they hold across each axis.
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d low = at(nodes.front());
  Eigen::Vector3d high = low;
  for (int axis = 0; axis < d; ++axis) {
    int held = 0;
    for (const int n : nodes)
      for (int across = 0; across < d; ++across)
        if (across != axis && is_fixed(n, across)) {
          centre[axis] += at(n)[axis];
          ++held;
        }
    if (held > 0) centre[axis] /= held;
  }
  for (const int n : nodes) {
    low = low.cwiseMin(at(n));
    high = high.cwiseMax(at(n));
  }
  const double size = (high - low).maxCoeff();

  Eigen::Matrix<double, 6, 6> gram = Eigen::Matrix<double, 6, 6>::Zero();
  if (d == 2) gram.diagonal() << 0, 0, 1, 1, 1, 0;  // motions that a plane does not have
  for (const int n : nodes)
    for (int axis = 0; axis < d; ++axis)
      if (is_fixed(n, axis)) {
        const auto motion = rigid((at(n) - centre) / size, axis);
        gram += motion * motion.transpose();
      }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(gram);
  const double threshold = 1e-12 * std::max(1.0, eigen.eigenvalues()[5]);
  Eigen::Matrix<double, 6, 1> share = Eigen::Matrix<double, 6, 1>::Zero();  // of each motion that lies in the null space
  for (int i = 0; i < 6; ++i)
    if (eigen.eigenvalues()[i] <= threshold) share += eigen.eigenvectors().col(i).cwiseAbs2();
  if (share.maxCoeff() == 0.0) return {};
  std::string words;
  for (int i = 0; i < 6; ++i)
    if (share[i] > std::min(0.99, 0.999 * share.maxCoeff())) {
      if (!words.empty()) words += ", ";
      words += (d == 2 ? planar_name : solid_name)[static_cast<std::size_t>(i)];
    }
  return words;
}

}  // namespace

std::vector<bool> supported_degrees_of_freedom(const Mesh& mesh, const std::vector<Support>& supports) {
  if (mesh.node.empty() || mesh.element.empty()) throw Error("the mesh has no elements");
  const auto d = static_cast<std::size_t>(mesh.dimension());
  std::vector<bool> fixed(mesh.node.size() * d, false);
  for (std::size_t s = 0; s < supports.size(); ++s) {
    const std::string name = "support " + std::to_string(s + 1);
    const auto& fix = supports[s].fix;
    if (d == 2 && fix[2]) throw Error(name + " fixes z, which a planar mesh does not have");
    if (!fix[0] && !fix[1] && !fix[2]) throw Error(name + " fixes no axis");
    const std::vector<int> nodes = nodes_at(mesh, supports[s].where);
    if (nodes.empty()) throw Error(name + " holds no node; its box must contain nodes of the mesh");
    for (const int n : nodes)
      for (std::size_t a = 0; a < d; ++a)
        if (fix[a]) fixed[static_cast<std::size_t>(n) * d + a] = true;
  }

  const std::vector<int> part = parts_of(mesh);
  std::vector<std::vector<int>> nodes_of_part(mesh.node.size());
  for (std::size_t n = 0; n < part.size(); ++n) nodes_of_part[static_cast<std::size_t>(part[n])].push_back(static_cast<int>(n));
  const bool one = nodes_of_part.front().size() == mesh.node.size();
  for (const std::vector<int>& nodes : nodes_of_part) {
    if (nodes.empty()) continue;
    const std::string motion = free_motion(mesh, nodes, fixed);
    if (motion.empty()) continue;
    const Point& x = mesh.node[static_cast<std::size_t>(nodes.front())];
    const std::string what = one ? "the mesh is unsupported: it"
                                 : "a part of the mesh, " + std::to_string(nodes.size()) + " nodes around (" + std::to_string(x[0]) + ", " +
                                       std::to_string(x[1]) + ", " + std::to_string(x[2]) +
                                       ") m that share no node with the rest, is unsupported: it";
    throw Error(what + " can still " + motion + " as a rigid body; add a support that prevents it");
  }
  return fixed;
}

}  // namespace trocar::fem
