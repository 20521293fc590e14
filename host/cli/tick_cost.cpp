#include "host/cli/tick_cost.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <vector>

#include "common/insertion/insertion.hpp"

namespace trocar::cli {
namespace {

using model::Vector2;

constexpr double step_m = 1e-4;
constexpr double dt_s = 1e-3;
constexpr int turns = 1000;
constexpr double turn_rad = 2e-3;

struct Line {
  Vector2 from_m{};
  double theta_rad{};
  double length_m{};
};

// Principal axis of the candidate nodes, with +y in front.
Line middle_line(const model::Tissue& tissue) {
  Vector2 centre{};
  for (const Vector2& x : tissue.node_m)
    for (std::size_t axis = 0; axis < 2; ++axis) centre[axis] += x[axis] / static_cast<double>(tissue.node_m.size());
  double xx = 0.0;
  double xy = 0.0;
  double yy = 0.0;
  for (const Vector2& x : tissue.node_m) {
    xx += (x[0] - centre[0]) * (x[0] - centre[0]);
    xy += (x[0] - centre[0]) * (x[1] - centre[1]);
    yy += (x[1] - centre[1]) * (x[1] - centre[1]);
  }
  const double spread = std::hypot(xx - yy, 2.0 * xy);
  constexpr double much_longer = 0.4;  // of the sum: one direction about 1.5 times the other
  double theta = spread > much_longer * (xx + yy) ? 0.5 * std::atan2(2.0 * xy, xx - yy) : std::acos(0.0);
  if (std::sin(theta) < 0.0) theta += 2.0 * std::acos(0.0);
  double first = 0.0;
  double last = 0.0;
  for (const Vector2& x : tissue.node_m) {
    const double along = (x[0] - centre[0]) * std::cos(theta) + (x[1] - centre[1]) * std::sin(theta);
    first = std::min(first, along);
    last = std::max(last, along);
  }
  return {{centre[0] + first * std::cos(theta), centre[1] + first * std::sin(theta)}, theta, last - first};
}

void summarise(std::vector<double>& times_us, double& median, double& worst) {
  if (times_us.empty()) return;
  std::sort(times_us.begin(), times_us.end());
  median = times_us[times_us.size() / 2];
  worst = times_us.back();
}

}  // namespace

TickCost tick_cost(const model::Image& image) {
  const auto insertion = std::make_unique<insertion::Insertion>();
  insertion->open(image);
  const Line line = middle_line(image.tissue);
  const auto tip_at = [&](double depth_m, double turned_rad) {
    const double behind = image.needle.length_m - depth_m;
    return insertion::Pose{line.from_m[0] - behind * std::cos(line.theta_rad), line.from_m[1] - behind * std::sin(line.theta_rad),
                           line.theta_rad + turned_rad};
  };
  const auto timed_us = [&](const insertion::Pose& pose, insertion::Result& result) {
    const auto start = std::chrono::steady_clock::now();
    result = insertion->step(pose, dt_s);
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start).count();
  };

  TickCost cost;
  insertion::Result result{};
  std::vector<double> times;
  const double depth = 0.95 * std::min(line.length_m, image.needle.length_m);
  for (double d = -step_m; d < depth; d += step_m) {
    const double us = timed_us(tip_at(d, 0.0), result);
    if (result.contacts > 0) times.push_back(us);
  }
  summarise(times, cost.insert_median_us, cost.insert_worst_us);
  cost.contacts = result.contacts;
  if (cost.contacts == 0) return cost;
  times.clear();
  for (int i = 0; i < turns; ++i) times.push_back(timed_us(tip_at(depth, turn_rad * std::sin(0.02 * i)), result));
  summarise(times, cost.turn_median_us, cost.turn_worst_us);
  return cost;
}

}  // namespace trocar::cli
