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

// `turns` times round all rows. Each turn's figure is the mean of its ticks, so that rare exchanges count with their share.
inline void measure(std::vector<Row>& rows, int turns) {
  std::vector<std::vector<double>> figure(rows.size());
  for (int turn = -1; turn < turns; ++turn)  // the first turn warms up
    for (std::size_t k = 0; k < rows.size(); ++k) {
      double sum = 0.0;
      const int ticks = turn < 0 ? std::min(rows[k].ticks, 20) : rows[k].ticks;
      for (int i = 0; i < ticks; ++i) sum += rows[k].tick();
      if (turn >= 0) figure[k].push_back(sum / ticks);
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
