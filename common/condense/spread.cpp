#include "common/condense/spread.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trocar::condense {
namespace {

// Gauss-Legendre on [0, 1], by Newton from Chebyshev's guess.
struct Gauss {
  std::vector<double> x{}, w{};
};

Gauss gauss(int n) {
  Gauss rule;
  for (int i = 0; i < n; ++i) {
    double t = std::cos(std::numbers::pi * (i + 0.75) / (n + 0.5));
    double slope = 0.0;
    for (int step = 0; step < 50; ++step) {
      double p = 1.0;
      double before = 0.0;
      for (int k = 1; k <= n; ++k) {
        const double next = ((2 * k - 1) * t * p - (k - 1) * before) / k;
        before = p;
        p = next;
      }
      slope = n * (t * p - before) / (t * t - 1.0);
      const double change = p / slope;
      t -= change;
      if (std::abs(change) < 1e-15) break;
    }
    rule.x.push_back(0.5 * (1.0 + t));
    rule.w.push_back(1.0 / ((1.0 - t * t) * slope * slope));
  }
  return rule;
}

}  // namespace

BallRule ball_rule(int n) {
  const Gauss line = gauss(n);
  const auto size = static_cast<std::size_t>(n);
  BallRule rule;
  double sum = 0.0;
  for (std::size_t r = 0; r < size; ++r)
    for (std::size_t c = 0; c < size; ++c)
      for (std::size_t a = 0; a < size; ++a) {
        // Equal steps of the polar angle rather than of its cosine: distances from the axis stay smooth at the poles.
        const double radius = line.x[r];
        const double polar = 0.5 * std::numbers::pi * line.x[c];
        const double azimuth = 0.5 * std::numbers::pi * line.x[a];
        const double z = radius * std::cos(polar);
        const double in_plane = radius * std::sin(polar);
        const double weight = radius * radius * std::sin(polar) * line.w[r] * line.w[c] * line.w[a];
        sum += 8.0 * weight;
        for (int octant = 0; octant < 8; ++octant) {
          rule.point.push_back({(octant & 1) != 0 ? -in_plane * std::cos(azimuth) : in_plane * std::cos(azimuth),
                                (octant & 2) != 0 ? -in_plane * std::sin(azimuth) : in_plane * std::sin(azimuth),
                                (octant & 4) != 0 ? -z : z});
          rule.weight.push_back(weight);
        }
      }
  for (double& w : rule.weight) w /= sum;
  return rule;
}

int ball_order(double radius_m, double edge_m) { return static_cast<int>(std::clamp(std::ceil(2.5 * radius_m / edge_m), 4.0, 24.0)); }

std::vector<NodeWeight> ball_weights(const fem::Locator& locator, const fem::Point& centre_m, double radius_m, const BallRule& rule) {
  std::vector<NodeWeight> all;
  double inside = 0.0;
  for (std::size_t q = 0; q < rule.point.size(); ++q) {
    fem::Point x = centre_m;
    for (std::size_t axis = 0; axis < 3; ++axis) x[axis] += radius_m * rule.point[q][axis];
    const auto at = locator.locate(x);
    if (!at) continue;
    inside += rule.weight[q];
    for (std::size_t k = 0; k < static_cast<std::size_t>(at->count); ++k) all.push_back({at->node[k], rule.weight[q] * at->weight[k]});
  }
  std::stable_sort(all.begin(), all.end(), [](const NodeWeight& a, const NodeWeight& b) { return a.node < b.node; });
  std::vector<NodeWeight> merged;
  for (const NodeWeight& w : all) {
    if (merged.empty() || merged.back().node != w.node) merged.push_back({w.node, 0.0});
    merged.back().weight += w.weight / inside;
  }
  return merged;
}

}  // namespace trocar::condense
