// A needle that bends in the plane: a geometrically exact Kirchhoff beam that also stretches, clamped at a moving base.
//
//   Unknown: the angle theta(s) of the shaft at arclength s of the unloaded needle, 0 at the base, L at the tip; t = (cos theta, sin
//   theta), n = (-sin theta, cos theta) = dt/dtheta. Loads are dead: force f_j and moment M_j at s_j keep their direction in the plane. The
//   cantilever is statically determinate, so the force in the section, N(s) = sum of f_j with s_j > s, is known, and position follows from
//   theta:
//     r(s) = r_0 + integral_0^s (1 + N.t / EA) t ds
//   Equilibrium is where the energy is stationary (stable: least) over theta with theta(0) = theta of the base:
//     Pi = integral of EI (theta' - kappa)^2 / 2  -  integral of (N.t + (N.t)^2 / (2 EA))  -  sum M_j theta(s_j)
//   Elements of three nodes, theta quadratic; the loads' integrals take 3 Gauss points in each interval between element ends and loads, so
//   that N is constant in each. Everything below is a derivative of this one discrete energy: r_j - r_0 = -dPi/df_j, residual R =
//   dPi/dtheta, tangent K = dR/dtheta (bandwidth 2, L D L^T), P_j = dr_j/dtheta = -dR/df_j and the flexibility
//     B_ij = dr_i/df_j = P_i^T K^-1 P_j + integral_0^min(s_i, s_j) t t^T / EA.
//   Beyond the tip the needle is continued straight and rigid along the tip's tangent, and before the base straight along the base's: loads
//   there act as force and moment on the tip, or on the clamp. Antman, Nonlinear Problems of Elasticity, chapter 4; Love, chapter 19.
//
// K of a needle under thrust is indefinite past pi^2 EI / (4 L^2), the load at which a free cantilever buckles: B then has as many negative
// eigenvalues as K, and so has its sum with the compliance of a tissue that keeps the needle from buckling.
// Fixed size, no allocation, bounded loops. About 0.4 MB: not for a stack.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/core/capacities.hpp"
#include "common/core/precision.hpp"

namespace trocar::needle {

using Vector2 = std::array<double, 2>;
using Block = std::array<double, 4>;  // xx, xy, yx, yy

struct Properties {
  double length_m{};
  double bending_nm2{};      // EI
  double axial_n{};          // EA
  double curvature_per_m{};  // kappa of the unloaded needle, counter-clockwise
  std::size_t elements{24};
};

struct Pose {
  double x_m{};
  double y_m{};
  double theta_rad{};
};

// On the needle, in the frame of the pose. A force of zero makes a point whose position and compliance are wanted.
struct Load {
  double arclength_m{};
  Vector2 force_n{};
  double moment_nm{};
};

// What the base applies to the needle; the moment about the base point.
struct Wrench {
  double fx_n{};
  double fy_n{};
  double tau_nm{};
};

enum class Status : std::uint8_t {
  Ok,
  Unstable,         // equilibrium, but not a least one: an ideal needle under more thrust than buckles it
  NotConverged,     // out of iterations: the state is the one of least energy that was found
  CapacityReached,  // more loads than capacity::needle_loads: nothing was changed
  NotFinite,        // an input is not finite: nothing was changed; or a result: the bend is as before, and no load acts
  NotOpen,          // no properties, or refused ones
};
[[nodiscard]] const char* to_string(Status status) noexcept;

struct Result {
  Status status{Status::Ok};
  int iterations{};
  double residual_nm{};  // largest entry of R
};

enum class Tangent : std::uint8_t {
  Exact,   // K
  Convex,  // K without what thrust takes from it at each integration point: always positive definite, never softer than K
};

struct Factor {
  Status status{Status::Ok};
  int negative_pivots{};  // negative eigenvalues of K
  bool singular{};        // a pivot vanished against the bending stiffness and was replaced by a tiny one
};

// A point of the bent shaft.
struct Station {
  Vector2 position_m{};
  double theta_rad{};
  Vector2 tangent{1.0, 0.0};  // of length 1; the normal is (-tangent[1], tangent[0])
  double stretch{1.0};        // |dr/ds|
  double curvature_per_m{};   // dtheta/ds; 0 on the rigid continuations
};

// What a load that moves along the shaft does, per length.
struct Slide {
  double moment_nm{};  // on the section where it stands
  Vector2 own_m{};     // where it stands itself, the bend kept
  Vector2 beyond_m{};  // everything further from the base, by the stretch that it takes along
};

class Beam {
 public:
  static constexpr std::size_t most_loads = capacity::needle_loads;
  static constexpr int max_iterations = 100;  // of solve, every trial of a step counted
  static constexpr double correction_rad =
      tolerance(1e-9, 1e-5);                       // solve ends after a Newton step below this: the next would be about its square
  static constexpr double longest_step_rad = 1.0;  // of any node in one Newton step

  // Starts at rest, theta' = kappa. NotOpen: length, EI and EA must be positive and finite, elements from 1 to capacity::needle_elements.
  Status open(const Properties& properties) noexcept;
  void reset() noexcept;  // back to rest
  // Remembers the bend, and takes it again: the next place starts from it.
  void keep() noexcept { kept_ = bend_; }
  void restore() noexcept { bend_ = kept_; }
  [[nodiscard]] const Properties& properties() const noexcept { return properties_; }

  // Equilibrium from the present bend: theta relative to the base is kept from one call to the next. Least energy by Newton's method with a
  // line search; where K is indefinite along the direction of negative curvature.
  Result solve(const Pose& base, std::span<const Load> loads) noexcept;

  // One Newton step together with others' equations, for loads that depend on where the needle goes:
  //   place      the present bend on this base under these loads, which need not be in equilibrium; R, positions, wrench follow
  //   linearise  r_i(f) = position_m(i) + correction_m(i) + sum_j compliance(i, j) (f_j - f_j placed): where the beam's own Newton step
  //              under forces f takes point i. Valid until the next place, solve or apply.
  //   apply      takes that step for the f that the caller chose, shortened to longest_step_rad, and places again under f, at arclengths
  //              that may have moved meanwhile. As many loads as were placed. moment_nm: of each load, by which R is about to change.
  //   correct    instead of linearise after an apply: the beam's own step anew, from the K and P of the last linearise (chord method).
  // Points keep the order of the loads. apply returns R at the new place; refused loads leave the last place.
  Result place(const Pose& base, std::span<const Load> loads) noexcept;
  Factor linearise(Tangent tangent = Tangent::Exact) noexcept;
  void correct() noexcept;  // precondition: linearise, then as many loads
  // Bends the needle to a side, by this angle at the tip: out of an equilibrium that is none to stay in.
  void nudge(double tip_rad) noexcept;
  Result apply(std::span<const Load> loads, std::span<const double> moment_nm = {}) noexcept;

  // After solve, place or apply.
  [[nodiscard]] std::size_t loads() const noexcept { return count_; }
  [[nodiscard]] Vector2 position_m(std::size_t i) const noexcept { return position_[rank_[i]]; }
  [[nodiscard]] double theta_rad(std::size_t i) const noexcept;  // at load i
  [[nodiscard]] Station at(double arclength_m) const noexcept;
  [[nodiscard]] Station tip() const noexcept { return at(properties_.length_m); }
  // Force from the section at the base, moment from R at the clamped node.
  [[nodiscard]] Wrench reaction() const noexcept;
  [[nodiscard]] double residual_nm() const noexcept { return residual_nm_; }
  [[nodiscard]] double energy_j() const noexcept { return energy_j_; }
  // Nodes and mid-nodes, base to tip: 2 elements + 1.
  [[nodiscard]] std::size_t nodes() const noexcept { return nodes_; }
  [[nodiscard]] double node_arclength_m(std::size_t k) const noexcept;

  // After linearise; the first and correction_m after correct too.
  [[nodiscard]] Block compliance(std::size_t i, std::size_t j) const noexcept {  // m/N
    const double* const x = &flexibility_[4 * most_loads * j];
    return {x[i], x[2 * most_loads + i], x[most_loads + i], x[3 * most_loads + i]};
  }
  // The same in columns: of force x and of force y at load 0, at load 1, …: displacements x of most_loads loads, then y.
  [[nodiscard]] std::span<const double> flexibility() const noexcept { return flexibility_; }
  [[nodiscard]] Vector2 correction_m(std::size_t i) const noexcept { return correction_[i]; }
  [[nodiscard]] Vector2 by_base_angle(std::size_t i) const noexcept { return by_base_[i]; }  // dr_i/dtheta of the base, m/rad
  [[nodiscard]] Vector2 rotation(std::size_t i, std::size_t j) const noexcept;               // dtheta(s_i)/df_j, rad/N
  [[nodiscard]] Vector2 tip_rotation(std::size_t j) const noexcept;                          // dtheta(L)/df_j
  [[nodiscard]] double rotation_correction(std::size_t i) const noexcept;                    // of theta(s_i) by the beam's own step
  [[nodiscard]] double rotation_by_base_angle(std::size_t i) const noexcept;                 // dtheta(s_i)/dtheta of the base
  [[nodiscard]] double tip_rotation_by_base_angle() const noexcept;
  // dtheta(s_i)/dM_j for all loads i.
  void rotations_by_moment(std::size_t j, std::span<double> rotation) const noexcept;
  [[nodiscard]] Slide slide(std::size_t j) const noexcept;
  [[nodiscard]] bool beyond(std::size_t i, std::size_t j) const noexcept { return rank_[i] > rank_[j]; }  // load i beyond load j

 private:
  static constexpr std::size_t most_nodes = 2 * capacity::needle_elements + 1;
  static constexpr std::size_t most_intervals = capacity::needle_elements + most_loads;
  static constexpr std::size_t gauss_points = 3;
  static constexpr std::size_t lanes = 4;
  static constexpr std::size_t most_columns = 2 * ((most_loads + lanes) / lanes * lanes);
  static_assert(most_columns / 2 > most_loads);

  using Shape = std::array<double, 3>;
  struct Point {  // of integration
    double weight_m{};
    Shape shape{};
    double geometric_n{};  // coefficient of K, times the weight
  };
  struct Interval {
    double from_m{}, to_m{};
    std::size_t element{};
    std::uint16_t next{};  // first load, by rank, that pulls at it
    Vector2 force_n{};     // N
    Vector2 start_m{};
    std::array<Vector2, 3> lever{};  // its part of P for loads beyond it: dr/dtheta of the element's nodes
    std::array<double, 3> axial{};   // its part of the axial flexibility, xx, xy, yy
    std::array<Point, gauss_points> point{};
  };
  // A load by rank, that is in order of arclength.
  struct Ranked {
    Load load{};
    std::uint16_t after{};  // intervals between base and load
    std::size_t element{};  // whose theta it sees
    Shape shape{};
    double overhang_m{};  // beyond the tip (> 0) or before the base (< 0)
  };

  [[nodiscard]] static bool known(std::span<const Load> loads) noexcept;  // finite
  [[nodiscard]] double element_m() const noexcept { return properties_.length_m / static_cast<double>(properties_.elements); }
  [[nodiscard]] Shape shape_at(std::size_t element, double arclength_m) const noexcept;
  [[nodiscard]] double bend_at(std::size_t element, const Shape& shape) const noexcept;
  void rank(std::span<const Load> loads) noexcept;
  void cut() noexcept;
  void share_out() noexcept;
  bool assemble() noexcept;
  bool lay_out(std::span<const Load> loads) noexcept;  // all of the above
  Factor factorise(Tangent tangent) noexcept;
  void newton_step(std::span<double> step) const noexcept;
  void back_substitute(std::span<double> step) const noexcept;
  void negative_curvature(std::span<double> direction) const noexcept;
  void fill_levers() noexcept;
  void solve_columns() noexcept;
  void integrate_columns() noexcept;
  void emit(std::size_t i, std::span<const double> x, std::span<const double> y, const std::array<double, 3>& axial) noexcept;

  Properties properties_{};
  bool open_{false};
  bool linear_{false};  // what linearise or correct leaves is of the present place
  std::size_t nodes_{0};
  std::size_t count_{0};  // loads
  std::size_t intervals_{0};
  std::size_t block_columns_{0};  // columns of x forces, with the beam's own step behind them; as many of y, with the base angle
  Pose base_{};
  Vector2 base_tangent_{1.0, 0.0};
  Vector2 tip_tangent_{1.0, 0.0};
  Vector2 tip_m_{};
  Vector2 clamp_n_{};  // N(0), loads on the base included
  double residual_nm_{}, energy_j_{}, energy_noise_j_{};
  double overhang_geometric_nm_{};
  std::array<double, most_nodes> bend_{};  // theta relative to the base
  std::array<double, most_nodes> kept_{};
  std::array<double, most_nodes> r_{};  // R
  // K row i: diagonal, with i - 1, with i - 2; then D and L in their place.
  std::array<double, most_nodes> diagonal_{}, first_{}, second_{};
  std::array<double, 2> clamped_{};  // K of nodes 1 and 2 with node 0
  std::array<Ranked, most_loads> ranked_{};
  std::array<std::uint16_t, most_loads> rank_{};       // of load i
  std::array<std::uint16_t, most_loads> owner_{};      // load of a rank
  std::array<std::uint16_t, most_loads> column_of_{};  // of load i: its rank at the last linearise
  std::array<Vector2, most_loads> position_{};         // by rank
  std::array<Interval, most_intervals> interval_{};
  alignas(64) std::array<double, gauss_points * most_intervals> angle_{}, cosine_{}, sine_{};  // of the integration points
  alignas(64) std::array<double, 4 * most_loads * most_loads> flexibility_{};
  std::array<Vector2, most_loads> correction_{}, by_base_{};
  // K^-1 P, node by node, 2 block_columns_ each.
  alignas(64) std::array<double, most_nodes * most_columns> column_{};
};

}  // namespace trocar::needle
