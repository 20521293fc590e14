#include "common/scene/spacing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace trocar::scene {
namespace {

// 1 + r + … + r^(n-1)
double sum_of_powers(double ratio, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum = 1.0 + ratio * sum;
  return sum;
}

// Factor with which n elements that begin with `smallest` fill `length`; nothing when even equal ones are too long.
std::optional<double> ratio_for(double length, int n, double smallest) {
  const double wanted = length / smallest;
  if (wanted < n * (1.0 - 1e-12)) return std::nullopt;
  if (n == 1) return std::abs(wanted - 1.0) < 1e-9 ? std::optional(1.0) : std::nullopt;
  double low = 1.0;
  double high = 2.0;
  while (sum_of_powers(high, n) < wanted) high *= 2.0;
  for (int i = 0; i < 200 && high - low > 0.0; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle == low || middle == high) break;
    (sum_of_powers(middle, n) < wanted ? low : high) = middle;
  }
  return high;
}

// `n` elements from `towards` to `end`, growing by `ratio`; coordinates without `towards`, in that order.
std::vector<double> side(double towards, double end, int n, double ratio) {
  std::vector<double> nodes;
  const double all = sum_of_powers(ratio, n);
  for (int i = 1; i < n; ++i) nodes.push_back(towards + (end - towards) * sum_of_powers(ratio, i) / all);
  if (n > 0) nodes.push_back(end);
  return nodes;
}

std::vector<double> joined(double from, double to, double towards, int left, double left_ratio, int right, double right_ratio) {
  std::vector<double> axis = side(towards, from, left, left_ratio);
  std::reverse(axis.begin(), axis.end());
  axis.push_back(towards);
  const std::vector<double> upper = side(towards, to, right, right_ratio);
  axis.insert(axis.end(), upper.begin(), upper.end());
  return axis;
}

// Tries every division of the elements between the two sides; mismatch(left, right) is to be least, infinite for one that cannot be.
template <class Mismatch>
std::optional<int> best_division(double from, double to, double towards, int elements, const Mismatch& mismatch) {
  std::optional<int> best;
  double least = std::numeric_limits<double>::infinity();
  for (int left = from < towards ? 1 : 0; left <= (from < towards ? (towards < to ? elements - 1 : elements) : 0); ++left) {
    if (towards < to && left == elements) break;
    const double here = mismatch(left, elements - left);
    if (here < least) {
      least = here;
      best = left;
    }
  }
  return best;
}

}  // namespace

std::vector<double> axis_with_smallest(double from, double to, double towards, int nodes, double smallest) {
  const auto ratio = [&](double length, int n) { return n == 0 ? std::optional(1.0) : ratio_for(length, n, smallest); };
  const auto mismatch = [&](int left, int right) {
    const auto a = ratio(towards - from, left);
    const auto b = ratio(to - towards, right);
    if (!a || !b) return std::numeric_limits<double>::infinity();
    return left == 0 || right == 0 ? 0.0 : std::abs(std::log(*a / *b));
  };
  const auto left = best_division(from, to, towards, nodes - 1, mismatch);
  if (!left) return {};
  const int right = nodes - 1 - *left;
  return joined(from, to, towards, *left, *ratio(towards - from, *left), right, *ratio(to - towards, right));
}

std::vector<double> axis_with_ratio(double from, double to, double towards, int nodes, double ratio) {
  const auto mismatch = [&](int left, int right) {
    if (left == 0 || right == 0) return 0.0;
    return std::abs(std::log((towards - from) / sum_of_powers(ratio, left) / (to - towards) * sum_of_powers(ratio, right)));
  };
  const auto left = best_division(from, to, towards, nodes - 1, mismatch);
  return left ? joined(from, to, towards, *left, ratio, nodes - 1 - *left, ratio) : std::vector<double>{};
}

double steepest(const std::vector<double>& axis) {
  double most = 1.0;
  for (std::size_t i = 2; i < axis.size(); ++i) {
    const double ratio = (axis[i] - axis[i - 1]) / (axis[i - 1] - axis[i - 2]);
    most = std::max({most, ratio, 1.0 / ratio});
  }
  return most;
}

}  // namespace trocar::scene
