// The step: base pose in, base wrench out. Tissue, contacts and a needle that bends are solved in one go, to a residual.
//
//   Pose of the base in the rig frame, theta from base to tip; t = (cos theta, sin theta). Contact i: material point X_i, displacement u_i,
//   anchored at arclength s_i. Its target is d_i = b + s_i t - X_i; contact/solver.hpp solves for the forces f_i of the needle on the
//   tissue; a contact that slipped is anchored anew: s_i <- s_i - ds_i. Then the tip is followed (contact/working_set.hpp). base wrench =
//   what the base applies to the needle = sum f_i, sum (X_i + u_i - b) x f_i: right-handed about the base point (MODELS 8).
// A needle that bends: flexible.hpp; the tip goes where the bent shaft points.
// Skips, none of which changes a result: needle outside of the tissue, no contact solve; rigid needle, no beam; no state, frame or geometry
// changed, the factor is used again (solver.hpp); nothing changed at all, the last forces stay: the solution to 1e-13 N, where all others
// keep every bit. One step is a pure function of (state,
// pose, dt): no allocation, lock, system call, exception; bounded time whatever the mesh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/contact/density.hpp"
#include "common/contact/working_set.hpp"
#include "common/core/capacities.hpp"
#include "common/core/precision.hpp"
#include "common/insertion/flexible.hpp"
#include "common/model/image.hpp"

namespace trocar::insertion {

using contact::Vector2;

using needle::Pose;
using needle::Wrench;

// In order of severity: a step reports the first that applies.
enum class Status : std::uint8_t {
  Ok,
  NotAdapted,       // a node could not be moved onto the needle and was pulled instead
  CapacityReached,  // a contact is missing: more would be needed than capacity::contacts
  LeftCandidates,   // the path runs where the image has no candidates; what lies there carries no force
  TipLost,          // the tip's material point was not found: tissue torn out of all proportion by a jump of the base
  IllConditioned,   // the residual stays above the tolerance
  PivotLimit,       // the bound on pivots was hit; forces within their bounds
  NotConverged,     // a needle that bends found no equilibrium: bend and forces are the last ones, carried on rigidly
  OffShaft,         // an explicit contact does not lie on the shaft at the first step: nothing is computed
  NotFinite,        // pose or time step refused; the last result stays
};
[[nodiscard]] const char* to_string(Status status) noexcept;

struct Result {
  Status status{Status::Ok};
  Wrench base{};
  Pose tip{};
  std::uint32_t contacts{};
  std::int32_t pivots{};
  std::int32_t iterations{};  // solves of the contacts
  std::int32_t newton{};      // iterations of a needle that bends
  std::int32_t rows_factored{};
  double residual_n{};
  double path_m{};  // length of the path in the tissue, entry to tip
};

class Insertion {
 public:
  static constexpr double speed_filter_s = 0.020;  // low-pass of the speed along the shaft, for the velocity law
  static constexpr double explicit_point_tolerance_m = tolerance(1e-9, 1e-6);  // across the shaft, at the first step

  // Starts afresh with this model, which must outlive its use here and come from model::open.
  void open(const model::Image& image) noexcept;
  // Forgets contacts, path and speed.
  void reset() noexcept;

  // dt_s since the last step serves the speed alone; ignored in the first step.
  Result step(const Pose& base, double dt_s) noexcept;

  // Needle manipulation Jacobian of the last step, if that was Ok: see Flexible::jacobian. It holds for motion that goes on as it did;
  // where contacts that slip would stick, at a reversal, the derivative is another one. Not for every tick.
  bool jacobian(Jacobian& out) noexcept;

  struct ContactReport {
    Vector2 position_m{};  // deformed
    double arclength_m{};
    double axial_n{};  // of the needle on the tissue
    double lateral_n{};
    contact::State state{};
  };
  [[nodiscard]] std::size_t contacts() const noexcept { return set_.size(); }
  [[nodiscard]] ContactReport contact(std::size_t i) const noexcept;
  [[nodiscard]] const contact::WorkingSet& working_set() const noexcept { return set_; }
  [[nodiscard]] contact::WorkingSet& working_set() noexcept { return set_; }
  // Bent shape after a step; meaningless for a rigid needle.
  [[nodiscard]] const needle::Beam& beam() const noexcept { return flexible_.beam(); }
  [[nodiscard]] bool bends() const noexcept { return bends_; }
  [[nodiscard]] double speed_m_s() const noexcept { return speed_m_s_; }  // along the shaft, filtered
  [[nodiscard]] double shaft_n_per_m() const noexcept { return shaft_n_per_m_; }

  // For tests and benchmarks: every step computes everything again, from force-free contacts when the base rests, and outside of the tissue
  // with none. Changes no result.
  void skip(bool enabled) noexcept { skip_ = enabled; }

 private:
  bool place_explicit() noexcept;
  void anchor_fresh() noexcept;
  void take_tip() noexcept;
  void release() noexcept;
  void solve_rigid(Result& result) noexcept;
  void solve_bending(Result& result) noexcept;
  [[nodiscard]] Wrench base_wrench() const noexcept;

  const model::Image* image_{nullptr};
  contact::WorkingSet set_{};
  Flexible flexible_{};
  bool bends_{false};
  Pose tip_{};  // of the shaft as it stands
  Vector2 tip_axis_{1.0, 0.0};
  contact::Density density_{};
  std::array<contact::Target, capacity::contacts> target_{};
  bool skip_{true};
  bool started_{false};
  bool rests_{false};  // the base is where it was in the last step
  Pose pose_{};
  Vector2 axis_{1.0, 0.0};
  double speed_m_s_{};
  double shaft_n_per_m_{}, tip_n_per_m_{};
  Result result_{};
};

}  // namespace trocar::insertion
