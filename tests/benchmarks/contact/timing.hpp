// Times several things against each other on a machine that others use as well: short batches, taking turns, and the median of each.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace trocar::bench {

// Seconds that `work` takes, by the steady clock (reading it costs some 25 ns).
template <class Work>
double timed(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

struct Row {
  std::string name{};
  std::function<double()> tick{};  // does one tick and returns the seconds of the part that counts
  int ticks{200};                  // in one turn
  double median_s{};
  double quartile_s[2]{};
};

// A tick of microseconds that took a third of a millisecond was interrupted by another process: that says nothing about the tick.
inline double mean_of_uninterrupted(std::vector<double>& seconds) {
  std::vector<double> sorted = seconds;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
  const double limit = std::max(3e-4, 30.0 * sorted[sorted.size() / 2]);
  double sum = 0.0, count = 0.0;
  for (const double each : seconds)
    if (each <= limit) sum += each, count += 1.0;
  return sum / count;
}

// `turns` times round all rows. Each turn's figure is the mean of its ticks, so that rare exchanges count with their share.
inline void measure(std::vector<Row>& rows, int turns) {
  std::vector<std::vector<double>> figure(rows.size());
  std::vector<double> seconds;
  for (int turn = -1; turn < turns; ++turn)  // the first turn warms up
    for (std::size_t k = 0; k < rows.size(); ++k) {
      seconds.clear();
      const int ticks = turn < 0 ? std::min(rows[k].ticks, 20) : rows[k].ticks;
      for (int i = 0; i < ticks; ++i) seconds.push_back(rows[k].tick());
      if (turn >= 0) figure[k].push_back(mean_of_uninterrupted(seconds));
    }
  for (std::size_t k = 0; k < rows.size(); ++k) {
    std::sort(figure[k].begin(), figure[k].end());
    const auto at = [&](double part) {
      return figure[k][static_cast<std::size_t>(part * static_cast<double>(figure[k].size() - 1) + 0.5)];
    };
    rows[k].median_s = at(0.5);
    rows[k].quartile_s[0] = at(0.25);
    rows[k].quartile_s[1] = at(0.75);
  }
}

}  // namespace trocar::bench
