// What a run measured, computed from its samples, and the report that shows it beside the thesis's figures.
// Along the needle: n = (cos a, sin a) with a = needle_angle_rad, the direction of insertion in the rig frame.
//   depth          = (y + L sin(theta) - surface_y) / sin(a)   of the tip below the surface, m; for a = pi/2 the plain difference
//   axial force    = base_wrench . n                           N, positive while inserting
//   axial error    = (setpoint - pose) . n                     m, positive while lagging behind an insertion
//   position error = |setpoint - pose| in the plane            m
// A hand that feels a virtual needle: depth of the virtual tip, handle force (of the hand on the handle, as estimated) and model force (of
// the virtual needle's base on the needle) alike from the sample's handle_*, virtual_*. At rest those two are equal.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/core/contracts.hpp"
#include "host/report/eyes.hpp"

namespace trocar::report {

struct ReportError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Phase {
  std::string name;
  enum class Kind { Air, Touch, Insert, Dwell, Withdraw, Haptic, Other } kind = Kind::Other;
  double speed_m_s{};
  std::string gain_set;
  std::uint64_t first_tick{}, last_tick{};  // both included
};

struct Truth {  // what a simulation knows of a tick
  std::uint64_t tick{};
  std::array<double, 3> hand_wrench{};  // N, N, N m on the handle, rig frame
};

struct Machine {  // what the controller said of the machine that it ran on
  std::string text;
  bool real_time{};
  LoopCounters loop{};  // since the controller's start
};

struct RunInfo {
  std::filesystem::path folder;
  enum class Kind { Insertion, Haptic } kind = Kind::Insertion;
  std::string rig, scene, gains;  // names; `gains` is the set that the run used unless a phase says otherwise
  bool lockstep{};
  double surface_y_m{};
  double needle_length_m{};
  double needle_angle_rad = std::numbers::pi / 2;
  std::vector<Phase> phases;
  std::string sag_gain_set = "thesis";  // the set whose sag F/Kp is reported
  double kp_n_per_m{};                  // its proportional gain; 0: no sag is reported
  std::vector<Truth> truth;             // increasing ticks; empty for a rig that is no lock-step simulation
  std::optional<Machine> machine;       // none in lock-step
  std::optional<Eyes> eyes;             // when a camera watched
  std::vector<std::string> notes;
};

inline constexpr double not_measured = std::numeric_limits<double>::quiet_NaN();

struct Tracking {
  std::uint64_t ticks{};
  double rms_m = not_measured, max_m = not_measured;
  double rms_rad = not_measured, max_rad = not_measured;
};

struct Distribution {  // nearest rank
  std::uint64_t count{};
  double p50 = not_measured, p99 = not_measured, p99_99 = not_measured, max = not_measured;
};

struct LineFit {  // least squares: force = intercept + slope * depth
  std::uint64_t ticks{};
  double slope_n_per_m{}, intercept_n{}, residual_rms_n{};
};

struct Insertion {  // an Insert phase and the next Withdraw phase of the same speed and gains
  std::string name, gain_set;
  double speed_m_s{};
  double depth_m = not_measured;             // greatest of the tip
  std::optional<LineFit> fit;                // over 20 to 65 mm, when the insertion covers them
  double full_depth_force_n = not_measured;  // mean over the deepest 0.5 mm
  double withdrawal_force_n = not_measured;  // the most negative mean of a 1 mm slice
  Tracking insert, withdraw;
};

struct GainTracking {
  std::string gain_set;
  Tracking air, phantom;  // Air phases; Insert, Dwell and Withdraw phases
};

struct Sag {  // mean over the second half of a Dwell phase, or over the deepest 2 mm of an Insert phase that no Dwell follows
  std::string phase;
  double force_n{};             // measured at the base, along the needle
  double command_n{};           // asked of the mechanism, along the needle
  double error_m{};             // axial error
  double expected_m{};          // force_n / Kp: without friction in the mechanism
  double expected_command_m{};  // command_n / Kp
};

struct Difference {  // of two forces in the plane
  std::uint64_t ticks{};
  double rms_n = not_measured;
};

struct HapticDisplay {  // a Haptic phase: the ticks of it in which the mode is Haptic
  std::string name;
  std::uint64_t ticks{};
  double duration_s{};
  double depth_m = not_measured;         // greatest of the virtual tip
  double force_n = not_measured;         // greatest of the model
  Difference difference;                 // handle force less model force: what friction and inertia of the machine leave
  Difference at_rest;                    // the same where the handle goes slower than 5 mm/s
  double least_energy_j = not_measured;  // that the display has taken, less what it gave
  std::uint64_t unsolved_ticks{};        // without a solution of the model
  std::uint32_t most_contacts{};
  Difference observer;                    // estimated handle force less the true one
  Difference true_difference;             // true handle force less model force
  double observer_rise_s = not_measured;  // 90 % of a step of the true force, where there is one (haptic.hpp)
};

struct Summary {
  std::uint64_t samples{}, lost_ticks{}, gaps{}, restarts{};
  double duration_s{};
  std::uint64_t ticks_without_feedback{}, longest_without_feedback{};  // while the drives were not Off
  std::vector<std::string> faults;                                     // names, in the order of appearance
  std::vector<Insertion> insertions;
  std::vector<GainTracking> tracking;
  std::vector<Sag> sags;
  std::vector<HapticDisplay> displays;
  double step_m = not_measured;          // median motion of the base when one encoder moves by one count
  Distribution tick_us, wakeup_late_us;  // empty in lock-step
};

[[nodiscard]] double tip_depth_m(const RunInfo& run, const Sample& sample) noexcept;
[[nodiscard]] double axial_force_n(const RunInfo& run, const Sample& sample) noexcept;
[[nodiscard]] double virtual_depth_m(const RunInfo& run, const Sample& sample) noexcept;
[[nodiscard]] double along_needle(const RunInfo& run, const std::array<double, 3>& wrench) noexcept;

// The samples of a phase. `samples` in increasing order of ticks.
[[nodiscard]] std::span<const Sample> samples_of(const Phase& phase, std::span<const Sample> samples) noexcept;
// When the controller restarted during the recording: what came after the last restart, since ticks count from zero there.
[[nodiscard]] std::span<const Sample> after_last_restart(std::span<const Sample> samples) noexcept;

[[nodiscard]] Summary summarise(const RunInfo& run, std::span<const Sample> samples);
// One JSON document; what was not measured is null.
[[nodiscard]] std::string to_json(const RunInfo& run, const Summary& summary);
// Writes figures/*.svg and report.html into run.folder, each under a temporary name first. Throws ReportError: the folder cannot be
// written, or gnuplot is missing or failed.
void write_report(const RunInfo& run, const Summary& summary, std::span<const Sample> samples);

}  // namespace trocar::report
