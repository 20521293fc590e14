// The Locator of mesh.hpp.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/fem/mesh.hpp"

namespace trocar::fem {
namespace {

double squared_distance(const Point& a, const Point& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < 3; ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

}  // namespace

Locator::Locator(const Mesh& mesh) : mesh_(&mesh), bounds_(bounding_box(mesh)) {
  // About one bucket an element.
  const auto dimension = static_cast<std::size_t>(mesh.dimension());
  double volume = 1.0;
  for (std::size_t a = 0; a < dimension; ++a) volume *= bounds_.max_m[a] - bounds_.min_m[a];
  const double edge =
      std::pow(volume / static_cast<double>(std::max<std::size_t>(mesh.element.size(), 1)), 1.0 / static_cast<double>(dimension));
  for (std::size_t a = 0; a < 3; ++a) {
    const double size = bounds_.max_m[a] - bounds_.min_m[a];
    if (a < dimension && edge > 0.0) count_[a] = std::clamp(static_cast<int>(std::min(size / edge, 1e4)), 1, 4096);
    bucket_size_m_[a] = size > 0.0 ? size / count_[a] : 1.0;
  }

  // Counting sort of what overlaps each bucket: elements by their bounding boxes, nodes by their place.
  const std::size_t buckets =
      static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) * static_cast<std::size_t>(count_[2]);
  const auto sort_into = [&](std::size_t items, const auto& box_of_item, std::vector<int>& begin, std::vector<int>& list) {
    begin.assign(buckets + 1, 0);
    for (const bool counting : {true, false}) {
      for (std::size_t i = 0; i < items; ++i) {
        const Box box = box_of_item(i);
        const auto low = bucket_of(box.min_m);
        const auto high = bucket_of(box.max_m);
        for (int z = low[2]; z <= high[2]; ++z)
          for (int y = low[1]; y <= high[1]; ++y)
            for (int x = low[0]; x <= high[0]; ++x) {
              const std::size_t b = index_of({x, y, z});
              if (counting)
                ++begin[b + 1];
              else
                list[static_cast<std::size_t>(begin[b]++)] = static_cast<int>(i);
            }
      }
      if (counting) {
        std::partial_sum(begin.begin(), begin.end(), begin.begin());
        list.resize(static_cast<std::size_t>(begin.back()));
      }
    }
    std::rotate(begin.begin(), begin.end() - 1, begin.end());  // filling moved each begin to its end
    begin.front() = 0;
  };
  sort_into(
      mesh.element.size(),
      [&](std::size_t e) {
        const auto corner = mesh.corners(e).leftCols(mesh.nodes_per_element()).eval();
        const Eigen::Vector3d low = corner.rowwise().minCoeff();
        const Eigen::Vector3d high = corner.rowwise().maxCoeff();
        return Box{{low[0], low[1], low[2]}, {high[0], high[1], high[2]}};
      },
      element_begin_, element_);
  sort_into(
      mesh.node.size(),
      [&](std::size_t n) {
        return Box{mesh.node[n], mesh.node[n]};
      },
      node_begin_, node_);
}

// Points outside belong to the nearest bucket.
std::array<int, 3> Locator::bucket_of(const Point& x_m) const {
  std::array<int, 3> bucket{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double place = std::floor((x_m[a] - bounds_.min_m[a]) / bucket_size_m_[a]);
    bucket[a] = static_cast<int>(std::clamp(place, 0.0, static_cast<double>(count_[a] - 1)));
  }
  return bucket;
}

std::size_t Locator::index_of(const std::array<int, 3>& bucket) const {
  return (static_cast<std::size_t>(bucket[2]) * static_cast<std::size_t>(count_[1]) + static_cast<std::size_t>(bucket[1])) *
             static_cast<std::size_t>(count_[0]) +
         static_cast<std::size_t>(bucket[0]);
}

std::optional<Embedding> Locator::locate(const Point& x_m, double tolerance_m) const {
  Point low = x_m;
  Point high = x_m;
  for (std::size_t a = 0; a < 3; ++a) {
    if (!std::isfinite(x_m[a])) return std::nullopt;
    low[a] -= tolerance_m;
    high[a] += tolerance_m;
  }
  const auto from = bucket_of(low);
  const auto to = bucket_of(high);
  const Eigen::Vector3d x(x_m[0], x_m[1], x_m[2]);
  // Elements that hold the point up to rounding come before those that it merely comes close to.
  for (const bool close : {false, true}) {
    int best = -1;
    Eigen::Vector3d best_natural = Eigen::Vector3d::Zero();
    for (int k = from[2]; k <= to[2]; ++k)
      for (int j = from[1]; j <= to[1]; ++j)
        for (int i = from[0]; i <= to[0]; ++i) {
          const std::size_t b = index_of({i, j, k});
          for (int at = element_begin_[b]; at < element_begin_[b + 1]; ++at) {
            const int e = element_[static_cast<std::size_t>(at)];
            if (best >= 0 && e >= best) break;
            const element::Corners corner = mesh_->corners(static_cast<std::size_t>(e));
            const auto used = corner.leftCols(mesh_->nodes_per_element());
            const Eigen::Vector3d size = used.rowwise().maxCoeff() - used.rowwise().minCoeff();
            const double slack = close ? tolerance_m : 1e-12 * size.maxCoeff();
            if (((x - used.rowwise().minCoeff()).array() < -slack).any() || ((used.rowwise().maxCoeff() - x).array() < -slack).any())
              continue;
            Eigen::Vector3d natural;
            if (!element::natural_coordinates(mesh_->type, corner, x, natural)) continue;
            if (!element::inside(mesh_->type, natural, 2.0 * slack / size.head(mesh_->dimension()).minCoeff())) continue;
            best = e;
            best_natural = natural;
          }
        }
    if (best < 0) continue;
    Embedding found;
    found.element = best;
    found.count = mesh_->nodes_per_element();
    element::Shape weight;
    element::ShapeGradient gradient;
    element::shape(mesh_->type, best_natural, weight, gradient);
    for (std::size_t n = 0; n < static_cast<std::size_t>(found.count); ++n) {
      found.node[n] = mesh_->element[static_cast<std::size_t>(best)][n];
      found.weight[n] = weight[static_cast<Eigen::Index>(n)];
    }
    return found;
  }
  return std::nullopt;
}

int Locator::nearest_node(const Point& x_m) const {
  const auto home = bucket_of(x_m);
  const auto dimension = static_cast<std::size_t>(mesh_->dimension());
  double thinnest = bucket_size_m_[0];
  for (std::size_t a = 1; a < dimension; ++a) thinnest = std::min(thinnest, bucket_size_m_[a]);
  const int rings = *std::max_element(count_.begin(), count_.end());
  int best = -1;
  double best_squared = 0.0;
  for (int ring = 0; ring <= rings; ++ring) {
    // Whatever lies in this ring or beyond is at least so far away; that x itself may lie outside only adds to it.
    const double bound = std::max(0, ring - 1) * thinnest;
    if (best >= 0 && best_squared < bound * bound) break;
    for (int k = std::max(home[2] - ring, 0); k <= std::min(home[2] + ring, count_[2] - 1); ++k)
      for (int j = std::max(home[1] - ring, 0); j <= std::min(home[1] + ring, count_[1] - 1); ++j)
        for (int i = std::max(home[0] - ring, 0); i <= std::min(home[0] + ring, count_[0] - 1); ++i) {
          if (std::max({std::abs(i - home[0]), std::abs(j - home[1]), std::abs(k - home[2])}) != ring) continue;
          const std::size_t b = index_of({i, j, k});
          for (int at = node_begin_[b]; at < node_begin_[b + 1]; ++at) {
            const int n = node_[static_cast<std::size_t>(at)];
            const double squared = squared_distance(mesh_->node[static_cast<std::size_t>(n)], x_m);
            if (best < 0 || squared < best_squared || (squared == best_squared && n < best)) {
              best = n;
              best_squared = squared;
            }
          }
        }
  }
  return best;
}

}  // namespace trocar::fem
