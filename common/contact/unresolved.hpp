// What planar elements do not resolve of a stuck line of contacts, as compliance (m/N) to be added to the contacts' own. Pure functions of
// the reference mesh; `WorkingSet` says when each counts. In a solid the force is spread over the needle's cross-section, which the mesh
// may resolve: nothing of this is for it.
//   Line load. q per length bends the displacement sharply, by -q |d| / (2 C t) at the distance d, and elements that the line crosses
//     cannot: on the line they miss about q / (2 C t) sum w_k |d_k|, the ridge, nothing where the line runs along edges. C is the shear
//     modulus along the line, that of uniaxial strain across it.
//   Jumps. A density that alternates from segment to segment hardly moves elements of their size, though it moves tissue; one force per
//     edge would not be inf-sup stable. The jump of density to the predecessor counts, g h^2 / (C t) (q_i - q_(i-1)), h the element's edge
//     (Burman and Hansbo 2010, doi.org/10.1016/j.cma.2010.05.011): a sum of squares, and nothing for a constant density.
//   Short segments, shorter than the elements, move them as one of their size would: they miss A ln(size / length),
//     A = (1 / mu + 1 / C) / (4 pi t) the logarithm's factor in the plane's point load (Kelvin).
//   End. A stuck line bears on its end like 1 / sqrt(distance), which neither nodes nor segments follow.
// Constants: tests/benchmarks/accuracy/unresolved.py.
#pragma once

#include "common/contact/geometry.hpp"
#include "common/contact/vector.hpp"
#include "common/model/tissue.hpp"

namespace trocar::contact {

// What is to be added to a segment where the line ends.
struct LineEnd {
  Vector2 tangent{};
  double along{}, across{};
  double line{};  // the line's own, A, as far as the end counts
};

struct Unresolved {
  Block jump{};    // per jump of density to the predecessor
  Block softer{};  // of a segment that is still short and has a predecessor
  LineEnd end{};
};

// Of the segment between two points that lies in this cell, weights and own compliance as given; ends: whether the line may end with it.
// Adds ridge and logarithm to `own`.
[[nodiscard]] Unresolved add_unresolved(Block& own, const Geometry& geometry, const model::Tissue& tissue, const model::Cell& cell,
                                        const Embedding& at, const Vector2& from_m, const Vector2& to_m, double spacing_m,
                                        bool ends) noexcept;

// For the last segment of the line, and for the last but one while the last has grown to a share of the spacing.
[[nodiscard]] Block at_end(const LineEnd& end) noexcept;
[[nodiscard]] Block before_end(const LineEnd& end, double grown) noexcept;

// A line of nodes that elements conform to ends `beyond_m` after its last node, which lies `gap_m` after the one before: by which share of
// what that node yields along and across the line, all others held, its tie is to give way; negative: to be held faster.
[[nodiscard]] Vector2 gives_at_tip(const model::Tissue& tissue, const model::Cell& cell, const Vector2& direction, double beyond_m,
                                   double gap_m) noexcept;

}  // namespace trocar::contact
