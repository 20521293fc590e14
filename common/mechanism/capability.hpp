// What a mechanism can do: workspace, resolution, force, moving mass. For `rig info` and for choosing a design; sampled
// on grids, so milliseconds to a second of work: not for the tick, though nothing here allocates either.
#pragma once

#include <array>

#include "common/mechanism/twin.hpp"

namespace trocar::mechanism {

// The drives as the joints see them (behind gear and efficiency). A single five-bar uses the first two.
struct DriveLimits {
  Vec4 peak_torque_nm = Vec4::Zero();
  Vec4 continuous_torque_nm = Vec4::Zero();
  double encoder_counts_per_turn{};  // of the joint
};

struct Rectangle {  // of handle positions
  std::array<double, 2> x_m{}, y_m{};
};

// Where and how densely to look. Counts below 2 (orientations below 1) are raised to that.
struct Sampling {
  int positions = 21;     // along each side of a rectangle, corners included
  int orientations = 36;  // of the handle, evenly over one turn; a single five-bar has none
};

struct Figures {
  double singularity{};  // singularity_distance
  // One count of one encoder moves the computed handle by F_i * 2 pi / counts (x' = F q'). Step: the largest such move
  // among the encoders. RMS: the error that quantisation alone leaves, counts independent, uniform over one count:
  // sqrt(sum_i |F_i|^2 / 12) * 2 pi / counts.
  double position_step_m{}, position_rms_m{};
  double angle_step_rad{}, angle_rms_rad{};
  // Force available in every direction at zero moment about the handle (the weakest direction), friction not subtracted.
  double peak_force_n{}, continuous_force_n{};
  double continuous_force_best_n{};  // in the best direction, else as above
  // Extreme eigenvalues of the translational block of M: kg felt along the lightest and heaviest direction, rotation held.
  double mass_least_kg{}, mass_most_kg{};
  double inertia_kg_m2{};  // M(2, 2): about the handle, position held
};

// Each figure at its own worst position and orientation within the rectangle, and at its worst orientation in the middle.
// Status other than Ok: some sampled pose cannot be taken.
struct Capability {
  Status status{};
  Figures worst{}, centre{};
};

[[nodiscard]] Capability capability(const TwinModel& model, const DriveLimits& drives, const Rectangle& rectangle,
                                    const Sampling& sampling = {}) noexcept;
[[nodiscard]] Capability capability(const FiveBarModel& model, const DriveLimits& drives, const Rectangle& rectangle,
                                    const Sampling& sampling = {}) noexcept;

struct Square {
  double side_m{};  // 0: none
  Vec2 centre_m = Vec2::Zero();
};

// The largest axis-parallel square of handle positions that are reachable in every orientation with a singularity
// distance of at least `least_distance`. Searched on a grid of step_m (enlarged where the reach would need more than
// 512 columns) that has a column at x = 0: the side is a whole number of steps, at most two too small. Of equal squares,
// the one nearest to x = 0.
[[nodiscard]] Square largest_square(const TwinModel& model, double least_distance, double step_m, int orientations = 36) noexcept;
[[nodiscard]] Square largest_square(const FiveBarModel& model, double least_distance, double step_m) noexcept;

// Radius (N) of the largest disc of forces that joint torques |tau_i| <= limit_i can make at zero moment. Exact: the
// wrenches u = H^T tau form a zonotope, bounded by |n . u| <= sum_k limit_k |n . h_k| for every n = h_i x h_j (h_k row k
// of H); its slice at zero moment is a polygon about the origin whose edges are limit sums over |n_xy| away.
[[nodiscard]] double weakest_force(const Mat43& H, const Vec4& torque_limit_nm) noexcept;
// Distance (N) of that polygon's farthest corner: the force in the best direction.
[[nodiscard]] double strongest_force(const Mat43& H, const Vec4& torque_limit_nm) noexcept;
// The same for one linkage: f = J^-T tau.
[[nodiscard]] double weakest_force(const Mat2& dend_dtheta, const Vec2& torque_limit_nm) noexcept;
[[nodiscard]] double strongest_force(const Mat2& dend_dtheta, const Vec2& torque_limit_nm) noexcept;

}  // namespace trocar::mechanism
