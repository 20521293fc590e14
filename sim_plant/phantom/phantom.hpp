// A rigid straight needle in a block of soft tissue, quasi-static: base pose in, base wrench out.
//
//   Tissue: linear finite elements, condensed at construction to A = K^-1 on all nodes (symmetric, m/N).
//   Contacts: points X_j of the reference mesh, one element edge apart along the path that the tip has cut, tied to the element
//   around them by its shape functions N: u_j = N_j u. Place of contact j on the needle: s_j = t.(X_j + u_j - b).
//   The tip's own place in the reference mesh solves X + u(X) = b + L t; the path grows where X moves on into new tissue,
//   and the last contact is dropped when X comes back to it.
//   Tributary length: contact j carries the path from its own point to the next contact, the last one to the tip. So the sum of
//   the thresholds is the density times the path cut, it grows from zero, and a new contact starts with no force. A step is
//   measured in the reference mesh, not along the compressed shaft. Across the shaft the last contact's tie is softened by its own
//   compliance times (edge / length - 1), without end as its length vanishes: leaving it behind does not kick.
//   Tip: over the last tip_zone_m of the path ever cut the density is the tip's, in the upper bound alone: only in forward
//   slip, fading while the tip stands behind the end of the path. Complete withdrawal forgets the path.
//   Friction: incremental Tresca (contact_problem.hpp). Densities follow the base's speed along the shaft, low-pass 20 ms.
//
// Frames and signs: rig frame; theta is the direction base -> tip; the wrench is what the base applies to the needle, which is
// the sum of the contact forces on the tissue; the moment is right-handed about the base.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "sim_plant/phantom/config.hpp"
#include "sim_plant/phantom/contact_problem.hpp"
#include "sim_plant/phantom/monotone_cubic.hpp"
#include "sim_plant/phantom/plane_grid.hpp"

namespace trocar::sim_plant {

class Phantom {
 public:
  using Vector3 = std::array<double, 3>;

  // Throws fem::Error for a scene that cannot be computed.
  explicit Phantom(const PhantomConfig& config);

  // base_pose: x_m, y_m, theta_rad. Returns N, N, N m. dt_s > 0 since the last call serves the speed alone. A pose or time
  // step that is not finite is refused: counted, and the last wrench stays.
  Vector3 advance(const Vector3& base_pose, double dt_s) noexcept;

  [[nodiscard]] const Vector3& base_wrench() const noexcept { return wrench_; }
  [[nodiscard]] double path_m() const noexcept;                           // path in the tissue, entry to tip, reference mesh
  [[nodiscard]] double speed_m_s() const noexcept { return speed_m_s_; }  // along the shaft, filtered
  [[nodiscard]] Point tip_material_m() const noexcept { return tip_material_; }
  [[nodiscard]] double shaft_density_n_per_m() const noexcept { return shaft_n_per_m_; }

  struct Contact {
    Point material_m{};
    double arclength_m{};  // on the needle, from the base
    ContactForce force{};  // of the needle on the tissue
  };
  [[nodiscard]] std::size_t contacts() const noexcept { return problem_.size(); }
  [[nodiscard]] Contact contact(std::size_t i) const noexcept { return {place_[i].material, place_[i].arclength, problem_.contact(i)}; }

  struct Counters {  // since construction
    std::uint64_t steps{};
    std::uint64_t unconverged{};  // contact problems out of pivots, tip searches out of iterations
    std::uint64_t refused{};      // input not finite
    std::uint64_t full{};         // steps in which a contact was missing for want of capacity
    std::uint64_t pivots{};
    std::uint64_t factorisations{};
  };
  [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
  [[nodiscard]] double residual_n() const noexcept { return residual_n_; }  // of the last step

 private:
  struct Place {
    Point material{};
    Point direction{};  // of the path where it reaches this contact, reference mesh
    double path{};      // length of the path up to here
    double arclength{};
    Embedding embedding{};
  };

  [[nodiscard]] Block coupling(const Embedding& a, const Embedding& b) const noexcept;
  [[nodiscard]] std::array<Point, 4> node_displacements(const Embedding& at) noexcept;
  [[nodiscard]] double exit_distance(const Point& from, const Point& direction) const noexcept;
  [[nodiscard]] double beyond_last() const noexcept;  // path from the last contact to the tip, inside of the tissue
  void add_contact(const Point& material, const Point& direction, double path) noexcept;
  void enter() noexcept;
  void solve_contacts() noexcept;
  void find_tip() noexcept;
  void follow_tip() noexcept;

  PhantomConfig config_;
  MonotoneCubic shaft_law_, tip_law_;
  PlaneGrid grid_;
  double spacing_m_;
  std::size_t rows_{};
  std::vector<double> compliance_;  // A, rows_ x rows_
  ContactProblem problem_;
  std::vector<Place> place_;
  std::vector<ContactInput> input_;
  std::vector<Block> row_;

  // Displacements of one element's nodes per unit contact force, kept while the tip stays in that element.
  int tip_element_{-1};
  std::vector<std::array<Block, 4>> tip_coupling_;
  std::size_t tip_coupled_{};

  bool started_{false};
  Point base_{}, axis_{};
  Point tip_material_{};
  double tip_beyond_m_{};  // along the last contact's direction
  double deepest_m_{};     // longest path cut since the last complete withdrawal
  double speed_m_s_{}, shaft_n_per_m_{}, tip_n_per_m_{};
  Vector3 wrench_{};
  double residual_n_{};
  Counters counters_{};
};

}  // namespace trocar::sim_plant
