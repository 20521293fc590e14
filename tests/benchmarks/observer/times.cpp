#include "tests/benchmarks/observer/times.hpp"

#include <fmt/core.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "tests/benchmarks/contact/timing.hpp"
#include "tests/benchmarks/observer/judge.hpp"

namespace trocar::bench {

void print_times(const Course& course, const rig::Rig& rig, int turns) {
  std::vector<Row> rows;
  double sink = 0.0;
  for (const std::string& method : methods) {
    rows.push_back({method, [&, estimate = estimator(method, rig, 390.0), k = std::size_t{0}]() mutable {
                      const Sample& sample = course.samples[k++ % course.samples.size()];
                      return timed([&] { sink += estimate(sample, course.tick_s)(0); });
                    }});
  }
  measure(rows, turns);
  if (!std::isfinite(sink)) throw std::runtime_error("an estimate is not finite");
  for (const Row& row : rows)
    fmt::print("{:<9} {:.2f} us an estimate (quartiles {:.2f}, {:.2f})\n", row.name, 1e6 * row.median_s, 1e6 * row.quartile_s[0],
               1e6 * row.quartile_s[1]);
}

}  // namespace trocar::bench
