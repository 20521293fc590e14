// Method (b) for paths that do not follow the mesh (thesis 5.3): element edges that the needle crosses are bisected, so that nodes lie on
// the path. Triangle meshes, reference coordinates, offline: it adds unknowns.
//   Each crossed edge gets a node where it is crossed, and both triangles beside it are cut from there to their opposite corner. Two
//   crossings in a row lie in one triangle, so the second cut ends in the first's node: consecutive path nodes are joined by edges.
//   A node closer to the line than `snap` times its shortest edge counts as lying on it and stays where it is, in place of slivers.
// Path nodes are therefore on the line but for at most snap times an edge. Area, and every boundary, stay as they were.
#pragma once

#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::fem {

inline constexpr double default_snap = 0.05;

// Splits the one or two triangles beside the edge between nodes a and b at x_m, which lies on it; returns the new node's index, the
// largest. Children take their parent's region; the new node joins the groups that hold both ends, and inside of the mesh only those that
// hold all corners of the triangles beside (a chord between two boundary nodes is no boundary).
// Throws Error: no triangle mesh, no such edge, x_m farther than 1e-9 of the edge's length from it or not between its ends.
int insert_node_on_edge(Mesh& mesh, int a, int b, const Point& x_m);

// Makes the straight segment a chain of mesh edges, but for its ends: inside of a triangle they get no node. Returns the nodes along it in
// order, none twice; empty when it touches no element. Paths grow by calling again with the next segment, which names the node at a common
// end again. Throws Error: no triangle mesh, a segment that has no length or is not finite, snap outside of [0, 0.25].
[[nodiscard]] std::vector<int> subdivide(Mesh& mesh, const Point& from_m, const Point& to_m, double snap = default_snap);

}  // namespace trocar::fem
