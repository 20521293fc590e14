// One clock seen from another: pairs (time on the remote clock, local time of arrival), where arrivals are late by an unknown delay that is
// never less than some least one.
//   local = remote + offset + drift (remote - remote_0) + delay,  delay >= 0
// The line that lies under all points of a window, as high as it can where the window's middle is: an edge of their lower convex hull. What
// is common to all delays, such as the time of exposure and read-out, cannot be told from the offset, and stays in it.
// Two of them put a frame on the rig's clock: camera to host from the frames, rig to host from the controller's samples;
//   t_rig = t_camera + offset_camera - offset_rig, and the uncertainties add.
// A controller's time_ns counts from its start, a camera's from an arbitrary zero; both may begin anew.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace trocar::camera {

class ClockOffset {
 public:
  static constexpr std::int64_t window_ns = 20'000'000'000;  // drift of a quartz within it: below a microsecond beyond the line
  static constexpr std::size_t most_points = 2048;
  static constexpr double largest_drift = 2e-4;  // of quartz against quartz, with room; more is a step
  static constexpr std::int64_t step_ns = 500'000'000;

  // False: the remote clock stepped or went backwards; what was known of it is forgotten, and this pair is the first.
  bool see(std::int64_t remote_ns, std::int64_t local_ns);

  struct Estimate {
    std::int64_t offset_ns{};       // local minus remote, now
    double drift{};                 // of local against remote, s/s; 0 until the window is long enough
    std::int64_t uncertainty_ns{};  // middle half of the delays above the line, over the square root of the points near it: how well the
                                    // line is held
  };
  [[nodiscard]] std::optional<Estimate> estimate() const;  // nothing before two pairs
  [[nodiscard]] std::optional<std::int64_t> to_local(std::int64_t remote_ns) const;
  [[nodiscard]] std::optional<std::int64_t> to_remote(std::int64_t local_ns) const;
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }

 private:
  struct Point {
    std::int64_t remote_ns{}, difference_ns{};  // local - remote
  };
  struct Line {
    double slope{}, at_ns{};  // difference at the newest point's remote time
  };
  [[nodiscard]] Line line() const;

  std::deque<Point> points_{};
  std::uint64_t steps_{};
};

}  // namespace trocar::camera
