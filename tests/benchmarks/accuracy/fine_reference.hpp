// What the needle does to the tissue by a mesh that is made for it: quads that conform to the shaft, graded towards it, its entry and its
// tip. Nothing of common/contact or common/condense is used.
//   stuck: the shaft's nodes are displaced as the needle is, base force = sum of what holds them (fem::Statics, prescribed displacements)
//   partial slip: A of the shaft's nodes, thresholds the density over a node's share of the shaft, solved by tests/reference/box_qp.hpp
#pragma once

#include <Eigen/Core>
#include <vector>

#include "tests/benchmarks/accuracy/block.hpp"

namespace trocar::bench {

// Base displaced along and across the shaft; what was asked of every method.
struct Answer {
  double axial_n_per_m{};                              // stuck
  double lateral_n_per_m{};                            // stuck
  double slip_force_n{};                               // axial, some contacts slip
  double tip_m{};                                      // axial displacement of the tissue at the tip in partial slip
  Eigen::VectorXd axial_visible{}, lateral_visible{};  // per m of the base, 2 rows a place
  Eigen::VectorXd slip_visible_m{};
  double slipping{};  // share of the shaft that slips
  // Of the fine mesh alone: the shaft's nodes and what the needle does to them, 2 rows a node; columns axial, lateral (per m), slip.
  std::vector<fem::Point> shaft_m{};
  Eigen::MatrixX3d force_n{};
};

// Of the base, along the shaft, from rest: about half of the shaft slips then.
[[nodiscard]] double slip_motion_m(double depth_m);

// `level` times every interval of the graded mesh is halved.
[[nodiscard]] Answer fine_answer(const Path& path, double depth_m, int level, const std::vector<fem::Point>& places);

// What refining would lead to: from one level to the next differences shrink by 2.7 to 3.2 (the tip's and the held corners' singularities).
// Forces on the shaft are the finer mesh's.
[[nodiscard]] Answer extrapolated(const Answer& coarser, const Answer& finer);

}  // namespace trocar::bench
