// The contacts between needle and tissue as the needle moves: where they are, how they are coupled, which force each may carry.
//
// Path. The tip's own place X in the reference mesh solves X + u(X) = tip. While X moves on into new tissue the path grows, and while it
// comes back the path shrinks; complete withdrawal forgets it. Lengths along the path are material lengths.
//   Embedded: the path is cut into segments of law.spacing_m; contact j is the mean over segment j (a constant force density along it,
//     tied by the shape functions integrated over it). The last segment ends at the tip; its weights follow the tip in steps of 1/128 of
//     the spacing. While it is short its tie across the shaft is softened by a tenth of its own compliance times (spacing / length - 1),
//     in steps of 1/512 of the spacing, so that beginning or leaving it does not kick. A segment keeps the course that was cut: coming
//     back follows it. In planar tissue what elements and segments cannot follow is added (unresolved.hpp): without the
//     ridge of a line load an oblique needle is some 3 % too stiff on 80 x 80 elements, without the jumps of the density forces alternate,
//     without the end of the line stiffness wavers by some per cent as segments come and go. displacement_m() is the elements' own.
//   Snap, Adapt: where the tip crosses a cell's edge, the nearer end of the edge becomes a contact: pulled onto the shaft, or moved there
//     in the reference mesh; a node of the surface is not moved inwards. Contact j carries the path from half way to its predecessor to
//     half way to its successor, the last one to the tip. Adapt, planar: elements make a line of nodes too long by a third of an edge or
//     two, and the tip lies somewhere between nodes. The last contact's tie gives way, or is held faster, by what the difference is worth;
//     without it stiffness wavers by 4 % along and 6 % across the shaft on 40 x 40 elements. Snap does without: it is what the thesis did.
//   Bevelled tip (embedded): while it cuts, the tissue presses on its face and carries it aside, by the angle of the face at most, and less
//     the more of the full lateral force F = tip_lateral * cutting force the ties at the tip hold already: the course of the cut is
//     axis + face (1 - held / F), the bracket within 0 and 1. So the ties end up with about F, the needle bends under it, and the path
//     curves; where the needle does not give way, the tissue does. First order in the spacing.
//   Subdivided: a mesh that was cut along the path has nodes on it (fem/subdivide.hpp). They are named beforehand, and each becomes a
//     contact as the tip passes it. Looked for at edges, from a tip that runs a little beside them, some are missed for their neighbours.
//   Explicit: points given by the scene, none added or removed.
// Thresholds: the density times the length that a contact carries, so their sum is the density times the path. Over the last tip_zone_m of
// the path ever cut the tip's density replaces the shaft's, in the upper bound alone: only while new tissue is cut. Regularisation: 1e-6
// (explicit and node contacts: 1e-12) of a contact's own compliance is added to it.
//
// Fixed size, no allocation. Cost: a tick that keeps its contacts and cells, O(s); a new contact or cell, O(s) with the embeddings'
// sizes; a moved node, O(s p) with the moves before it. Never the size of the mesh.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "common/contact/compliance.hpp"
#include "common/contact/geometry.hpp"
#include "common/contact/solver.hpp"
#include "common/contact/unresolved.hpp"
#include "common/core/capacities.hpp"
#include "common/model/law.hpp"
#include "common/model/tissue.hpp"

namespace trocar::contact {

class WorkingSet {
 public:
  struct Point {
    Embedding at{};
    Vector2 material_m{};  // mean position in the reference mesh
    Vector2 begin_m{};     // of the segment; of a node contact: where the path crosses
    Vector2 direction{};   // of the path there, unit
    double path_m{};       // length of the path up to begin_m
    double arclength_m{};  // where it is anchored on the needle, from the base; the needle's owner keeps it
    double length_m{};     // embedded: that its weights stand for
    Vector2 heading{};     // embedded: course of the cut per length along direction
    double cut_m{};        // embedded: how far it was ever cut
    bool fresh{true};      // anchor it where it now is
  };
  // What could not be done in the last call; each leaves a consistent working set.
  struct Trouble {
    bool full{};             // a contact is missing for want of capacity
    bool left_candidates{};  // the path runs on where the image has no candidates
    bool tip_lost{};         // the search for the tip's material point did not converge: it counts as where it is in space
    bool not_adapted{};      // a node could not be moved and was pulled instead
  };

  // Both must outlive this object; the image reader has checked them. Face and lateral over cutting force: of a bevelled tip.
  void open(const model::Tissue& tissue, const Law& law, double face_rad = 0.0, double tip_lateral = 0.0) noexcept;
  void clear() noexcept;
  // Snap: these nodes in this order, none of them supported, are the contacts, in place of those found at edges. They must outlive the
  // path; empty: none named. Call it while there is no contact; open() forgets them.
  void name_nodes(std::span<const std::uint32_t> along_path) noexcept { named_ = along_path; }

  [[nodiscard]] std::size_t size() const noexcept { return solver_.size(); }
  [[nodiscard]] const Point& point(std::size_t i) const noexcept { return point_[i]; }
  [[nodiscard]] Point& point(std::size_t i) noexcept { return point_[i]; }
  [[nodiscard]] Solver& solver() noexcept { return solver_; }
  [[nodiscard]] const Solver& solver() const noexcept { return solver_; }
  [[nodiscard]] const Geometry& geometry() const noexcept { return geometry_; }
  [[nodiscard]] Compliance& compliance() noexcept { return compliance_; }
  [[nodiscard]] double path_m() const noexcept { return path_m_; }        // from entry to tip
  [[nodiscard]] double deepest_m() const noexcept { return deepest_m_; }  // longest path since the last complete withdrawal
  [[nodiscard]] Vector2 tip_material_m() const noexcept { return tip_; }

  // An explicit contact; false outside of the candidates or without capacity.
  [[nodiscard]] bool place(const Vector2& x_m) noexcept;

  // Upper and lower bounds of every contact's axial force from the two densities.
  void set_bounds(double shaft_n_per_m, double tip_n_per_m, std::span<Target> target) const noexcept;
  // The force per length that cuts, by which a bevelled tip is carried aside in the next follow().
  void set_cutting(double excess_n_per_m) noexcept { cutting_n_per_m_ = excess_n_per_m; }

  [[nodiscard]] bool in_tissue(const Vector2& x_m) const noexcept { return geometry_.locate(x_m, -1) >= 0; }
  // Turns the soft tie of the last segment into the frame of this tick. Before every solve.
  void soften_last(const Vector2& tangent) noexcept;

  // First contact of a needle whose tip stands in undeformed tissue; the path begins where its straight shaft crosses the surface, at most
  // `most_m` behind the tip.
  Trouble enter(const Vector2& tip_m, const Vector2& direction, double most_m) noexcept;
  // After a solve: finds the tip's material point and lets the path grow or shrink with it.
  Trouble follow(const Vector2& tip_m, const Vector2& direction) noexcept;

  // Displacement that the present forces cause, m. O(s) for points that are tied to nodes in use.
  [[nodiscard]] Vector2 displacement_m(const Embedding& at) noexcept;
  // Of a contact as its solve sees it: with the softness and the regularisation of its tie.
  [[nodiscard]] Vector2 tied_displacement_m(std::size_t contact) noexcept;

 private:
  struct NodeCoupling {  // displacement of a node per unit force at each contact
    std::uint32_t node{};
    std::size_t known{};
    std::uint64_t used{};
    std::array<Block, capacity::contacts> block{};
  };
  static constexpr std::size_t nodes_in_use = 48;

  [[nodiscard]] bool segments() const noexcept { return law_->method == Method::Embedded && law_->explicit_count == 0; }
  [[nodiscard]] bool adapts() const noexcept { return law_->method == Method::Adapt && law_->explicit_count == 0; }
  const NodeCoupling& coupling_of(std::uint32_t node) noexcept;
  void forget_couplings(std::size_t from_contact) noexcept;
  [[nodiscard]] Vector2 node_displacement(std::uint32_t node) noexcept;
  std::size_t make_row(const Embedding& at, std::size_t before) noexcept;
  void add_unresolved(const Embedding& at, const Vector2& from_m, const Vector2& to_m, std::size_t i) noexcept;
  [[nodiscard]] Block own_at_end(double softness, const Vector2& tangent) const noexcept;
  [[nodiscard]] Vector2 yields_held(const Vector2& t) const noexcept;
  [[nodiscard]] Block own_at_tip() const noexcept;
  void push(const Point& point) noexcept;
  void pop() noexcept;
  void resize_last(double length_m, const Vector2& direction) noexcept;
  [[nodiscard]] double aside_m(double length_m, const Vector2& direction) const noexcept;
  void push_segment(const Vector2& begin_m, const Vector2& direction, double path_m) noexcept;
  void push_passed(const Vector2& direction, Trouble& trouble) noexcept;
  void push_single(std::uint32_t node, const Vector2& begin_m, const Vector2& direction) noexcept;
  void push_node(const Vector2& crossing_m, const model::Cell& cell, std::size_t edge, const Vector2& direction, Trouble& trouble) noexcept;
  void find_tip(const Vector2& tip_m, Trouble& trouble) noexcept;
  void follow_segments(const Vector2& direction, Trouble& trouble) noexcept;
  void follow_nodes(const Vector2& before_m, std::int32_t cell, const Vector2& direction, Trouble& trouble) noexcept;
  void walk(Vector2 from_m, std::int32_t cell, const Vector2& to_m, const Vector2& direction, Trouble& trouble) noexcept;
  [[nodiscard]] double reach(const Vector2& from_m, std::int32_t cell, const Vector2& direction, double most_m,
                             Trouble& trouble) const noexcept;
  [[nodiscard]] double beyond_last() const noexcept;

  const model::Tissue* tissue_{nullptr};
  const Law* law_{nullptr};
  double face_rad_{};
  double tip_lateral_{};
  double cutting_n_per_m_{};
  double regularisation_{};
  double least_compliance_{};
  Geometry geometry_{};
  Compliance compliance_{};
  Solver solver_{};
  std::array<Point, capacity::contacts> point_{};
  std::span<const std::uint32_t> named_{};
  std::array<Block, capacity::contacts> row_{};
  std::array<Block, capacity::contacts> own_{};  // without the softness of its tie, the end of the line and the jump to its successor
  std::array<LineEnd, capacity::contacts> end_{};
  Vector2 yields_{};  // adapt: the last contact, along the path and across it, m/N
  bool yields_known_{false};
  std::size_t softened_{};      // the contact and
  double softened_length_m_{};  // the length that the softness is for
  std::array<NodeCoupling, nodes_in_use> coupling_{};
  std::size_t coupling_count_{0};
  std::uint64_t clock_{0};
  Vector2 tip_{};
  std::int32_t tip_cell_{-1};  // the last cell that held the tip
  bool tip_inside_{false};
  bool ends_inside_{false};  // as the last segment was made
  double path_m_{0.0};
  double deepest_m_{0.0};
};

}  // namespace trocar::contact
