// A needle that bends, its contacts and the condensed tissue, in one solve a tick.
//
//   Unknown: the forces f_i of the needle on the tissue. Tissue: u = G f. Needle: Newton's step of the beam under loads -f at the
//   arclengths s_i, r_i(f) = p_i + c_i - sum_j B_ij (f_j - f_j placed)  (needle/beam.hpp: the Schur complement of K on the contacts).
//   What ties them, in the frame of the bent shaft at s_i with the anchor a_i:  u_i = r_i + (a_i - s_i) t_i - X_i  across the shaft, and
//   along it with stick and slip. So contact/solver.hpp solves it, with G + B for G. A contact that slips by ds is at a_i - ds: the loads
//   move there, and the next iteration starts from there. It ends when tissue and shaft meet at every contact, the forces obey friction in
//   the frame of the shaft as it now stands, and the beam is in equilibrium: measured afterwards, not with the step.
//   Warm start: the last tick's bend, forces, states and slips.
//   Chord method: K, B and the factor of G + B serve until an iteration gains less than a factor of `gain`; then they are made anew.
//   Friction turns with the shaft and loads slide along it; the quick step learns of that an iteration late. Where it contracts slowly, a
//   very flexible needle, Newton's full step (whole.cpp) takes over once the states stand.
//   Under thrust beyond buckling K and B are indefinite and the tissue holds the needle; an equilibrium is stable where G + B has as many
//   negative eigenvalues as K (Haynsworth). A step towards one that is not takes the convex part of K instead, and one that was reached
//   is left by a nudge to a side.
//   A base whose pose leads nowhere is approached by a quarter of its way a tick.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "common/contact/working_set.hpp"
#include "common/core/capacities.hpp"
#include "common/core/precision.hpp"
#include "common/model/image.hpp"
#include "common/needle/beam.hpp"

namespace trocar::insertion {

// Row by row.
using Jacobian = std::array<std::array<double, 3>, 3>;

class Flexible {
 public:
  static constexpr int max_iterations = 24;  // of Newton towards a pose; as many again towards a part of the way
  static constexpr double gain = 10.0;
  static constexpr double slow = 4.0;              // a gain below this is slow
  static constexpr int most_full_steps = 12;       // towards a pose: each costs (3 contacts)^3 / 3 operations
  static constexpr double least_nudge_rad = 1e-3;  // out of an unstable equilibrium
  static constexpr double part_way = 0.25;         // of the base's motion that is tried where the whole of it leads nowhere
  // Of the residual: what is left between tissue and shaft, over the contact's own compliance.
  static constexpr double tolerance_n = tolerance(1e-9, 1e-4);
  static constexpr double beam_tolerance_nm = tolerance(1e-11, 1e-6);

  struct Outcome {
    bool converged{};  // otherwise bend and forces are those of the last converged tick, carried on rigidly
    int iterations{};  // of Newton
    int pivots{};
    int solves{};
    double solved_n{};    // residual of the contacts alone, in the frames that they were solved in
    double residual_n{};  // of the whole
  };

  void open(const model::Needle& needle) noexcept;
  void reset() noexcept { beam_.reset(); }

  // Nothing touches the needle.
  bool free(const needle::Pose& base) noexcept;
  // `target` brings the bounds; size of the set. Leaves forces, states, slips and anchors in the set.
  Outcome solve(const needle::Pose& base, contact::WorkingSet& set, std::span<contact::Target> target) noexcept;

  [[nodiscard]] const needle::Beam& beam() const noexcept { return beam_; }
  // d(tip x, y, theta) / d(base x, y, theta), m and rad, of the last step: differentiated implicitly at its states, where a contact that
  // slips goes on slipping and one that sticks goes on sticking. False when the equations are singular. Dense: (3 contacts)^3 / 3
  // operations, some 0.06 ms with 32; not for every tick. Leaves bend and forces as they are.
  bool jacobian(const needle::Pose& base, const contact::WorkingSet& set, Jacobian& out) noexcept;
  // Where on the shaft, or its straight continuation, the point at x_m stands; searched from `near_m` on.
  [[nodiscard]] double arclength_m(const contact::Vector2& x_m, double near_m) const noexcept;

 private:
  void start(const needle::Pose& base, contact::WorkingSet& set) noexcept;
  void differentiate(const contact::WorkingSet& set) noexcept;
  [[nodiscard]] std::array<double, 3> shaft_under(std::size_t i, std::size_t j, const contact::Vector2& f) const noexcept;
  [[nodiscard]] std::array<double, 3> shaft_by(std::size_t i, std::size_t j, std::size_t k) const noexcept;
  bool full_step(contact::WorkingSet& set, std::span<const contact::Target> target) noexcept;
  [[nodiscard]] static contact::Vector2 stands_m(const contact::WorkingSet& set, std::size_t i) noexcept;
  [[nodiscard]] bool stable() noexcept;
  bool linearise(needle::Tangent tangent, const contact::WorkingSet& set) noexcept;
  bool iterate(contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept;
  bool aim(const contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept;
  bool converge(contact::WorkingSet& set, std::span<contact::Target> target, Outcome& outcome) noexcept;
  void take(const contact::WorkingSet& set) noexcept;
  [[nodiscard]] double residual_n(const contact::WorkingSet& set, std::span<const contact::Target> target) const noexcept;

  needle::Beam beam_{};
  contact::Solver joined_{};    // G + B
  needle::Pose solved_base_{};  // of the last tick that converged
  int beam_negative_{};         // negative eigenvalues of K
  bool convex_{};               // the last linearisation
  std::array<needle::Load, capacity::contacts + 1> load_{};
  std::array<double, capacity::contacts> anchor_m_{};
  std::array<contact::Contact, capacity::contacts> contact_{}, before_{};
  static constexpr std::size_t most_unknowns = 3 * capacity::contacts;
  struct Whole {
    std::array<std::size_t, capacity::contacts + 1> first{};  // unknown of a contact
    std::array<bool, capacity::contacts> slips{};
    std::array<std::array<contact::Vector2, 3>, capacity::contacts> force{};  // that an unknown stands for
    std::array<needle::Slide, capacity::contacts> slide{};
    std::array<std::array<double, capacity::needle_loads>, capacity::contacts> turned_by{};
    std::array<std::array<double, most_unknowns + 3>, most_unknowns> equation{};  // with up to three right-hand sides behind
  };
  Whole whole_{};
};

}  // namespace trocar::insertion
