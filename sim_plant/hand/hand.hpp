// A person at the handle: an arm that wants to be somewhere, a grip that holds the handle, and what a person cannot do.
//
//   arm    m y'' = k (x_w - y) + b (x_w' - y') + tremor - f        y: where the arm is, x_w: where it wants to be
//   grip   f = k_g (y - x) + b_g (y' - x')                         f: force of the hand on the handle, x: the handle
// for x, y and the angle alike, axes independent: two masses and two springs in series (Speich, Shao and Goldfarb, IEEE Trans. Robotics
// 21, 2005: the hand at a telemanipulator; Hogan 1989: arm impedance). The want is a minimum-jerk way between points (Flash and Hogan
// 1985). Tremor: noise through a resonance at 8 to 12 Hz, so many newtons (N m) RMS on the arm. No more force than `largest` leaves the
// grip: beyond, it slips. Or a recording: the wrench over time as it was, and the arm's impedance about the handle's motion of then,
// without which a handle soon goes its own way: f = f_r + k (x_r - x) + b (x_r' - x'). Integrated by the implicit midpoint rule with the
// handle's motion given: it adds no energy, however stiff the grip. With a habit it takes the handle and lets it go by itself.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "sim_plant/plant/random.hpp"

namespace trocar::sim_plant {

// One axis; SI, the angle in rad, N m.
struct ArmAxis {
  double mass{};
  double damping{}, stiffness{};            // of the arm about what it wants
  double grip_damping{}, grip_stiffness{};  // of the grip
  double largest{};                         // force that the grip holds
  double tremor{};                          // RMS
};

struct HandConfig {
  // Translation: middle of what is measured for relaxed to firm arms (0.5 to 2 kg, 50 to 500 N/m, 5 to 20 N s/m).
  ArmAxis translation{1.0, 10.0, 200.0, 30.0, 2000.0, 40.0, 0.0};
  ArmAxis rotation{1e-3, 0.01, 0.3, 0.02, 3.0, 1.0, 0.0};
  double tremor_hz{10.0};
  std::uint64_t seed{1};
};
// Impedance of the arm times a factor; the grip stays.
[[nodiscard]] HandConfig scaled(HandConfig hand, double factor) noexcept;

// A point of the way that the hand wants to go.
struct Intention {
  double time_s{};
  std::array<double, 3> pose{};
};

struct RecordedWrench {
  double time_s{};
  std::array<double, 3> wrench{};
  std::array<double, 3> pose{};  // of the handle
};

// About a recorded motion: x and y, angle. Zero: the recorded wrench alone, whatever the handle does.
struct RecordedArm {
  double stiffness{}, damping{};
  double turn_stiffness{}, turn_damping{};
};

// What a person does of his own accord: takes the handle so long after the motors came on, goes his way with it, or repeats what was
// recorded, and lets go when they go off.
struct Habit {
  double take_after_s{};
  // From where the handle was taken: along the needle, across it (to its left), angle; time from then on, the first at 0.
  std::vector<Intention> way{};
  double period_s{};                        // the way begins anew at these intervals, at least its length; 0: once
  std::vector<RecordedWrench> recording{};  // instead of the way, in the rig's frame, when it is not empty
  RecordedArm recorded_arm{};
};

class Hand {
 public:
  using Vector3 = std::array<double, 3>;

  // At rest, holding the handle at that pose and wanting to stay there.
  Hand(const HandConfig& config, const Vector3& pose);
  // Away from the handle, until the motors come on.
  Hand(const HandConfig& config, Habit habit);

  // Times increase; between two points minimum jerk, before the first and after the last one rest. Replaces what it wanted, and its habit.
  void want(std::vector<Intention> way);
  // From now on this, linear in between, zero before and after; empty: the arm again.
  void replay(std::vector<RecordedWrench> recording, const RecordedArm& arm = {});
  void let_go() noexcept { holds_ = false; }
  void hold(const Vector3& pose) noexcept;  // where the handle is
  // Before every step: whether the motors are on, and where the handle is. Without a habit this is nothing to it.
  void notice(bool motors_on, double time_s, const Vector3& pose) noexcept;

  // Wrench on the handle at the end of a step in which the handle went to this pose with this velocity. dt_s > 0.
  const Vector3& advance(double time_s, const Vector3& pose, const Vector3& velocity, double dt_s) noexcept;

  [[nodiscard]] const Vector3& wrench() const noexcept { return wrench_; }
  [[nodiscard]] bool holds() const noexcept { return holds_; }
  [[nodiscard]] const Vector3& arm() const noexcept { return y_; }
  [[nodiscard]] Vector3 wanted(double time_s) const noexcept;

 private:
  void forget_habit() noexcept;
  struct Tremor {
    double x{}, v{};
  };
  [[nodiscard]] double tremble(std::size_t axis, double rms, double dt_s) noexcept;
  [[nodiscard]] Vector3 recorded(double time_s, const Vector3& pose, const Vector3& velocity) const noexcept;

  HandConfig config_;
  std::vector<Intention> way_{};
  std::vector<RecordedWrench> recording_{};
  RecordedArm recorded_arm_{};
  std::optional<Habit> habit_{};
  double on_since_s_{};
  bool on_{false};
  double begin_s_{};   // of way and recording
  double period_s_{};  // of the way, 0: none
  Random random_;
  bool holds_{true};
  Vector3 y_{}, velocity_{};
  Vector3 rest_{};  // what it wants without a way
  Vector3 last_wanted_{};
  bool started_{false};
  Vector3 wrench_{};
  std::array<Tremor, 3> tremor_{};
};

}  // namespace trocar::sim_plant
