#include "tests/benchmarks/accuracy/course.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>

namespace trocar::bench {

Course insert(const Compiled& compiled, contact::Method method, const Path& path, double depth_m) {
  constexpr double step_m = 1e-5;
  constexpr std::size_t steps_of_window = 10;
  contact::Law law = compiled.law();
  law.method = method;
  model::Image image = compiled.image();
  image.law = &law;
  const auto needle = std::make_unique<insertion::Insertion>();
  needle->open(image);
  const auto [tx, ty] = path.tangent();

  Course course;
  std::vector<double> seconds, excess_n, lateral_n;
  for (double depth = -1e-3; depth < depth_m; depth += step_m) {
    const insertion::Pose pose = base_pose(path, depth);
    const auto begin = std::chrono::steady_clock::now();
    const insertion::Result result = needle->step(pose, 1e-3);
    const double taken = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (result.contacts > 0) seconds.push_back(taken);
    course.status = std::max(course.status, result.status);
    course.contacts = std::max<std::size_t>(course.contacts, result.contacts);
    excess_n.push_back(tx * result.base.fx_n + ty * result.base.fy_n - density_integral_n(0.0, result.path_m, result.path_m));
    lateral_n.push_back(tx * result.base.fy_n - ty * result.base.fx_n);
  }
  for (std::size_t k = steps_of_window; k < excess_n.size(); ++k) {
    course.worst_jump_mn = std::max(course.worst_jump_mn, 1e3 * std::abs(excess_n[k] - excess_n[k - steps_of_window]));
    course.worst_lateral_change_mn =
        std::max(course.worst_lateral_change_mn, 1e3 * std::abs(lateral_n[k] - lateral_n[k - steps_of_window]));
  }
  std::sort(seconds.begin(), seconds.end());
  course.median_us = 1e6 * seconds[seconds.size() / 2];
  course.percentile99_us = 1e6 * seconds[seconds.size() * 99 / 100];
  return course;
}

double push_explicit_us(const Compiled& compiled, const Path& path, double depth_m) {
  const auto needle = std::make_unique<insertion::Insertion>();
  needle->open(compiled.image());
  std::vector<double> seconds;
  for (int k = 0; k < 1000; ++k) {
    const insertion::Pose pose = base_pose(path, depth_m + 1e-5 * k);
    const auto begin = std::chrono::steady_clock::now();
    const insertion::Result result = needle->step(pose, 1e-3);
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    if (result.status != insertion::Status::Ok)
      throw std::runtime_error(std::string("a step of explicit contacts ended with: ") + insertion::to_string(result.status));
  }
  std::sort(seconds.begin(), seconds.end());
  return 1e6 * seconds[seconds.size() / 2];
}

}  // namespace trocar::bench
