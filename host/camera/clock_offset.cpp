#include "host/camera/clock_offset.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace trocar::camera {
namespace {

constexpr std::int64_t long_enough_ns = 2'000'000'000;  // for a slope

}  // namespace

bool ClockOffset::see(std::int64_t remote_ns, std::int64_t local_ns) {
  const std::int64_t difference = local_ns - remote_ns;
  bool same = true;
  if (!points_.empty()) {
    // Arrivals may be late by much, but never early: a difference that falls by more than drift explains, or time that runs back, is a
    // step. One that rises by as much is a late arrival or a step; the next arrivals will tell, since the window forgets.
    const Point& last = points_.back();
    const Line under = line();
    const double expected = under.at_ns + under.slope * static_cast<double>(remote_ns - last.remote_ns);
    const double room = largest_drift * static_cast<double>(std::abs(remote_ns - last.remote_ns)) + static_cast<double>(step_ns);
    same = remote_ns > last.remote_ns && static_cast<double>(difference) > expected - room;
    if (same && points_.size() >= 8) {
      // All of the last ones late by more than a step, on a clock that was steady before: it was set back or began anew.
      same = static_cast<double>(difference) < expected + 20.0 * room;
    }
  }
  if (!same) {
    points_.clear();
    ++steps_;
  }
  points_.push_back({remote_ns, difference});
  while (points_.size() > most_points || remote_ns - points_.front().remote_ns > window_ns) points_.pop_front();
  return same;
}

ClockOffset::Line ClockOffset::line() const {
  const Point& newest = points_.back();
  const auto x = [&](const Point& p) { return static_cast<double>(p.remote_ns - newest.remote_ns); };
  const std::int64_t base = newest.difference_ns;
  const auto y = [&](const Point& p) { return static_cast<double>(p.difference_ns - base); };
  const double span = -x(points_.front());
  const auto level = [&] {
    double least = 0.0;
    for (const Point& p : points_) least = std::min(least, y(p));
    return Line{0.0, static_cast<double>(base) + least};
  };
  if (span < static_cast<double>(long_enough_ns)) return level();
  // Lower hull from the left (Andrew 1979); its edge over the window's middle.
  std::vector<const Point*> hull;
  for (const Point& p : points_) {
    while (hull.size() >= 2) {
      const Point &a = *hull[hull.size() - 2], &b = *hull.back();
      if ((x(b) - x(a)) * (y(p) - y(a)) > (y(b) - y(a)) * (x(p) - x(a))) break;
      hull.pop_back();
    }
    hull.push_back(&p);
  }
  const double middle = -0.5 * span;
  for (std::size_t k = 0; k + 1 < hull.size(); ++k) {
    const Point &a = *hull[k], &b = *hull[k + 1];
    if (x(b) < middle) continue;
    const double slope = (y(b) - y(a)) / (x(b) - x(a));
    if (std::abs(slope) > largest_drift) return level();  // the hull of a few late arrivals
    return {slope, static_cast<double>(base) + y(a) - slope * x(a)};
  }
  return level();
}

std::optional<ClockOffset::Estimate> ClockOffset::estimate() const {
  if (points_.size() < 2) return std::nullopt;
  const Line under = line();
  std::vector<double> delay;
  for (const Point& p : points_)
    delay.push_back(static_cast<double>(p.difference_ns) - under.at_ns -
                    under.slope * static_cast<double>(p.remote_ns - points_.back().remote_ns));
  const auto middle = delay.begin() + static_cast<std::ptrdiff_t>(delay.size() / 2);
  std::ranges::nth_element(delay, middle);
  const double uncertainty = *middle / std::sqrt(0.5 * static_cast<double>(delay.size()));
  return Estimate{std::llround(under.at_ns), under.slope, std::max<std::int64_t>(1, std::llround(uncertainty))};
}

std::optional<std::int64_t> ClockOffset::to_local(std::int64_t remote_ns) const {
  if (points_.size() < 2) return std::nullopt;
  const Line under = line();
  return remote_ns + std::llround(under.at_ns + under.slope * static_cast<double>(remote_ns - points_.back().remote_ns));
}

std::optional<std::int64_t> ClockOffset::to_remote(std::int64_t local_ns) const {
  if (points_.size() < 2) return std::nullopt;
  const Line under = line();
  const std::int64_t newest = points_.back().remote_ns, offset = std::llround(under.at_ns);
  // local = newest + since + offset + slope * since
  return newest + std::llround(static_cast<double>(local_ns - newest - offset) / (1.0 + under.slope));
}

}  // namespace trocar::camera
