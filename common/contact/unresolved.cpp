#include "common/contact/unresolved.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "common/element/element.hpp"

namespace trocar::contact {
namespace {

// Of the jumps. Between 0.1 and 0.15 hardly any error that accuracy_benchmark measures changes by a third, but without them forces along
// grid lines alternate.
constexpr double jump_stabilisation = 0.15;
// In plane stress with Poisson's ratios 0.3 to 0.48.
//   along, across   Of the ridge: more than the elements' interpolation would miss, as a share of that, times sin^2 of twice the angle to
//                   their edges; for an axial and for a lateral load.
//   end             Of the end of a line of segments: `all` less `per_ridge` times the last one's ridge, in 1 / (mu t). Quadrilaterals'
//                   are rounded towards stiffness; triangles' axial one is that of a line along edges (at an angle it hardly depends on
//                   the ridge).
//   excess          By how many of their edges a line of nodes seems to reach beyond its last one; askew: less, times the same sin^2.
struct AtEnd {
  double all, per_ridge;
};
struct Constants {
  double along, across;
  AtEnd end_along, end_across;
  double excess_along, excess_across, excess_across_askew;
};
constexpr Constants of_triangles{0.4, -0.1, {0.1, 0.66}, {0.06, 0.2}, 0.6, 0.36, 0.0};
constexpr Constants of_quadrilaterals{0.03, -0.4, {0.06, 0.53}, {0.02, 0.07}, 0.385, 0.22, 0.15};
// A density that is constant over a segment cannot follow the end, and its jump there is not to count. Without it the line seems shorter by
// up to a fifth of a segment. Shares of the line's own compliance A and of the jump's; in a plane without elements.
constexpr double end_share_of_line = 1.0 / 6.0, end_share_of_jump = 1.0 / 3.0;
// While a segment grows by its share g, its predecessor is an end less and less. In between, the pair's stiffness is to follow the depth as
// it does between whole segments (accuracy_benchmark's paths, at depths it does not ask for): laterally g (1 - g) (a + b g^2) of A less;
// axially a short segment is softer by c (1 - g)^4 in 1 / (mu t).
constexpr double grown_half = 1.8, grown_late = 3.8, short_is_softer = 0.35;
// A line of nodes: what the last one yields while the others are held, over what it does while the four before it are.
constexpr double held_by_all = 0.97;
constexpr double beyond_step = 1.0 / 512.0;  // of an edge: how finely its tie follows the tip

const Constants& constants_of(const model::Cell& cell) noexcept { return cell.count == 3 ? of_triangles : of_quadrilaterals; }

// Of the cells, in the mean; of triangles, that of the squares that two of them make.
double edge_m_of(const model::Tissue& tissue, const model::Cell& cell) noexcept {
  return tissue.edge_length_m * (cell.count == 3 ? model::square_of_triangles : 1.0);
}

// sin^2 of twice the angle between a direction and a cell's edges before any was moved, the mean over the two that meet most squarely.
double askew_to(const model::Tissue& tissue, const model::Cell& cell, const Vector2& direction) noexcept {
  double least = 2.0, askew = 0.0;
  for (std::size_t k = 0; k < cell.count; ++k) {
    const Vector2 at = tissue.node_m[cell.node[k]];
    const Vector2 a = minus(tissue.node_m[cell.node[(k + 1) % cell.count]], at);
    const Vector2 b = minus(tissue.node_m[cell.node[(k + cell.count - 1) % cell.count]], at);
    const double off_square = std::abs(dot(a, b)) / (length(a) * length(b));
    if (off_square >= least) continue;
    least = off_square;
    const auto to = [&](const Vector2& edge) {
      const double cosine = dot(edge, direction) / length(edge);
      return 4.0 * cosine * cosine * (1.0 - cosine * cosine);
    };
    askew = 0.5 * (to(a) + to(b));
  }
  return askew;
}

}  // namespace

Unresolved add_unresolved(Block& own, const Geometry& geometry, const model::Tissue& tissue, const model::Cell& cell, const Embedding& at,
                          const Vector2& from_m, const Vector2& to_m, double spacing_m, bool ends) noexcept {
  const Vector2 chord = minus(to_m, from_m);
  const double length_m = length(chord);
  const Vector2 t = scaled(chord, 1.0 / length_m);
  const Constants& constants = constants_of(cell);
  const element::Elasticity c = element::elasticity(tissue.model, tissue.material[cell.material]);
  const double shear = 1.0 / (c(2, 2) * tissue.thickness_m), strain = 1.0 / (c(0, 0) * tissue.thickness_m);
  const double line = (shear + strain) / (4.0 * std::numbers::pi);
  const double mixed = 2.0 * own[1] * t[0] * t[1];
  const double own_along = own[0] * t[0] * t[0] + own[3] * t[1] * t[1] + mixed;
  const double own_across = own[0] + own[3] - own_along;

  // The load's length is a whole segment's from the start: a shorter one is no line on the scale of the elements.
  double distance_m = 0.0;
  for (std::uint32_t k = 0; k < at.count; ++k) {
    const Vector2 x = minus(geometry.node_m(at.node[k]), from_m);
    distance_m += at.weight[k] * std::abs(t[0] * x[1] - t[1] * x[0]);
  }
  const double ridge = std::max(0.0, distance_m) / (2.0 * spacing_m), askew = askew_to(tissue, cell, t);
  const double ridge_along = ridge * (1.0 + askew * constants.along), ridge_across = ridge * (1.0 + askew * constants.across);
  add(own, in_axes(t, ridge_along * shear, ridge_across * strain));
  const double edge_m = edge_m_of(tissue, cell);
  const double resolved_m = std::min(spacing_m, edge_m);
  if (length_m < resolved_m) add(own, {line, 0.0, 0.0, line}, std::log(resolved_m / length_m));

  // On segments shorter than the elements the ends are the elements'. Where these hardly yield, at a support or because they are all but
  // incompressible (plane stress never is), the end is not to take what there is.
  const double per_edge = edge_m / spacing_m;
  const double jump = jump_stabilisation * per_edge * per_edge;
  const double whole = ends ? std::min(1.0, 1.0 / (per_edge * per_edge)) : 0.0;
  const double yields_along = whole * std::clamp(own_along / line - 1.5, 0.0, 1.0);
  const double yields_across = whole * std::clamp(own_across / line - 1.5, 0.0, 1.0) * std::min(1.0, 4.0 * strain / shear);
  const auto end_of = [&](const AtEnd& end, double ridge_there, double modulus) {
    return (end.all - end.per_ridge * ridge_there) * shear - end_share_of_line * line - end_share_of_jump * jump * modulus;
  };
  const double lacks = 1.0 - std::min(1.0, length_m / spacing_m);
  return {in_axes(t, jump * shear, jump * strain),
          in_axes(t, whole * short_is_softer * lacks * lacks * lacks * lacks * shear, 0.0),
          {t, yields_along * end_of(constants.end_along, ridge_along, shear),
           yields_across * end_of(constants.end_across, ridge_across, strain), yields_across * line}};
}

Block at_end(const LineEnd& end) noexcept { return in_axes(end.tangent, end.along, end.across); }

Block before_end(const LineEnd& end, double grown) noexcept {
  const double lacks = 1.0 - grown;
  return in_axes(end.tangent, lacks * lacks * end.along,
                 lacks * (end.across - grown * (grown_half + grown_late * grown * grown) * end.line));
}

// To a line of nodes it is the same to be longer by the share e of its last gap, and to have its last node give way by -e / (1 + e) of what
// it yields while the others are held: at e = -1 it were not there.
Vector2 gives_at_tip(const model::Tissue& tissue, const model::Cell& cell, const Vector2& direction, double beyond_m,
                     double gap_m) noexcept {
  const Constants& constants = constants_of(cell);
  const double edge_m = edge_m_of(tissue, cell);
  const double beyond = beyond_step * std::floor(beyond_m / (beyond_step * edge_m));
  const double gap = std::max(0.25, gap_m / edge_m);
  const auto gives = [&](double excess) {
    const double longer = std::clamp((beyond - excess) / gap, -0.75, 1.0);
    return -held_by_all * longer / (1.0 + longer);
  };
  return {gives(constants.excess_along),
          gives(constants.excess_across - constants.excess_across_askew * askew_to(tissue, cell, direction))};
}

}  // namespace trocar::contact
