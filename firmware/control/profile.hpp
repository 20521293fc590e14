// Jerk-limited motion along one path coordinate: pieces of constant jerk, evaluated in closed form.
// Rest to rest uses at most seven pieces (ramp up 3, cruise 1, ramp down 3); braking from any state at most three.
#pragma once

#include <array>
#include <cstddef>

namespace trocar::control {

struct PathState {
  double position{};
  double velocity{};
  double acceleration{};
};

struct PathLimits {
  double velocity{};  // all > 0, in path units per s, s^2, s^3
  double acceleration{};
  double jerk{};
};

class Profile {
 public:
  // From rest at 0 to rest at `distance` >= 0. Zero distance gives a finished profile.
  [[nodiscard]] static Profile rest_to_rest(double distance, const PathLimits& limits) noexcept;

  // From `start` to rest, as soon as the limits allow. The position where it ends is the result, not a choice.
  [[nodiscard]] static Profile brake(const PathState& start, const PathLimits& limits) noexcept;

  // State at `time_s` after the start; at rest at the end position from duration_s() on.
  [[nodiscard]] PathState at(double time_s) const noexcept;
  [[nodiscard]] double duration_s() const noexcept { return duration_s_; }

 private:
  struct Piece {
    double duration_s{};
    double jerk{};
  };
  void append(double duration_s, double jerk) noexcept;
  void append_velocity_change(double from_velocity, double from_acceleration, double to_velocity, const PathLimits& limits) noexcept;

  PathState start_{};
  PathState end_{};
  std::array<Piece, 7> piece_{};
  std::size_t pieces_{};
  double duration_s_{};
};

}  // namespace trocar::control
