#include "common/fem/subdivide.hpp"

#include <algorithm>
#include <cmath>
#include <string>

namespace trocar::fem {
namespace {

void require_triangles(const Mesh& mesh) {
  if (mesh.type != Type::Tri3) throw Error("paths are subdivided in meshes of tri3 elements only; take tri3, or another path method");
}

std::string words(const Point& x) { return "(" + std::to_string(x[0]) + ", " + std::to_string(x[1]) + ") m"; }

const Point& node(const Mesh& mesh, int n) { return mesh.node[static_cast<std::size_t>(n)]; }

double distance(const Point& a, const Point& b) { return std::hypot(b[0] - a[0], b[1] - a[1]); }

bool holds(const std::vector<int>& group, int n) { return std::binary_search(group.begin(), group.end(), n); }

void join_groups(Mesh& mesh, int a, int b, const std::vector<int>& opposite, int added) {
  for (auto& [name, nodes] : mesh.group) {
    bool member = holds(nodes, a) && holds(nodes, b);
    if (opposite.size() == 2) member = member && holds(nodes, opposite[0]) && holds(nodes, opposite[1]);
    if (member) nodes.push_back(added);
  }
}

// What lies on the path: a node, or an edge that is crossed away from its ends.
struct Touch {
  double along{};  // m from the start
  int a{};
  int b{};  // -1 for a node
  Point x{};
};

}  // namespace

int insert_node_on_edge(Mesh& mesh, int a, int b, const Point& x_m) {
  require_triangles(mesh);
  std::vector<std::size_t> beside;
  std::vector<int> opposite;
  for (std::size_t e = 0; e < mesh.element.size(); ++e)
    for (std::size_t k = 0; k < 3; ++k) {
      const int first = mesh.element[e][k];
      const int second = mesh.element[e][(k + 1) % 3];
      if ((first != a || second != b) && (first != b || second != a)) continue;
      beside.push_back(e);
      opposite.push_back(mesh.element[e][(k + 2) % 3]);
    }
  if (beside.empty()) throw Error("no edge of the mesh joins the nodes " + std::to_string(a) + " and " + std::to_string(b));
  const Point& start = node(mesh, a);
  const double length = distance(start, node(mesh, b));
  const double ex = (node(mesh, b)[0] - start[0]) / length;
  const double ey = (node(mesh, b)[1] - start[1]) / length;
  const double along = (x_m[0] - start[0]) * ex + (x_m[1] - start[1]) * ey;
  const double off = (x_m[1] - start[1]) * ex - (x_m[0] - start[0]) * ey;
  if (!(std::abs(off) <= 1e-9 * length) || !(along > 0.0 && along < length))
    throw Error("the point " + words(x_m) + " does not lie on the edge between the nodes " + std::to_string(a) + " and " +
                std::to_string(b));

  const int added = static_cast<int>(mesh.node.size());
  join_groups(mesh, a, b, opposite, added);
  mesh.node.push_back(x_m);
  for (const std::size_t e : beside) {
    auto child = mesh.element[e];
    std::replace(mesh.element[e].begin(), mesh.element[e].end(), b, added);
    std::replace(child.begin(), child.end(), a, added);
    mesh.element.push_back(child);
    if (!mesh.region.empty()) mesh.region.push_back(mesh.region[e]);
  }
  return added;
}

std::vector<int> subdivide(Mesh& mesh, const Point& from_m, const Point& to_m, double snap) {
  require_triangles(mesh);
  if (!(snap >= 0.0 && snap <= 0.25))
    throw Error("snap = " + std::to_string(snap) + ": must be within 0 and 0.25 of an edge, such as 0.05");
  const double length = distance(from_m, to_m);
  if (!(length > 0.0) || !std::isfinite(length)) throw Error("the path from " + words(from_m) + " to " + words(to_m) + " has no length");
  const double dx = (to_m[0] - from_m[0]) / length;
  const double dy = (to_m[1] - from_m[1]) / length;

  std::vector<double> reach(mesh.node.size(), 0.0);  // shortest edge at each node
  for (const auto& e : mesh.element)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = e[k];
      const int b = e[(k + 1) % 3];
      const double edge = distance(node(mesh, a), node(mesh, b));
      for (const int n : {a, b}) {
        double& shortest = reach[static_cast<std::size_t>(n)];
        shortest = shortest == 0.0 ? edge : std::min(shortest, edge);
      }
    }

  // Rounding may put a node on the line, or a crossing at an end, to either side of it: at least this much of an edge is nothing.
  constexpr double rounding = 1e-9;
  std::vector<double> along(mesh.node.size()), off(mesh.node.size());
  std::vector<Touch> touches;
  for (std::size_t n = 0; n < mesh.node.size(); ++n) {
    if (reach[n] == 0.0) continue;  // belongs to no element
    const double rx = mesh.node[n][0] - from_m[0];
    const double ry = mesh.node[n][1] - from_m[1];
    along[n] = rx * dx + ry * dy;
    off[n] = ry * dx - rx * dy;
    const double slack = std::max(snap, rounding) * reach[n];
    if (std::abs(off[n]) > slack) continue;
    off[n] = 0.0;
    if (along[n] >= -slack && along[n] <= length + slack) touches.push_back({along[n], static_cast<int>(n), -1, mesh.node[n]});
  }
  for (const auto& e : mesh.element)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = std::min(e[k], e[(k + 1) % 3]);
      const int b = std::max(e[k], e[(k + 1) % 3]);
      const auto ia = static_cast<std::size_t>(a);
      const auto ib = static_cast<std::size_t>(b);
      if (!(off[ia] * off[ib] < 0.0)) continue;
      const double share = off[ia] / (off[ia] - off[ib]);
      const double at = along[ia] + share * (along[ib] - along[ia]);
      const double slack = rounding * std::min(reach[ia], reach[ib]);
      if (at < -slack || at > length + slack) continue;
      const Point& p = mesh.node[ia];
      const Point& q = mesh.node[ib];
      touches.push_back({at, a, b, {p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), 0.0}});
    }
  // An inner edge was found from both of its triangles.
  std::sort(touches.begin(), touches.end(), [](const Touch& l, const Touch& r) {
    return l.along != r.along ? l.along < r.along : l.a != r.a ? l.a < r.a : l.b < r.b;
  });
  touches.erase(std::unique(touches.begin(), touches.end(), [](const Touch& l, const Touch& r) { return l.a == r.a && l.b == r.b; }),
                touches.end());

  std::vector<int> path;
  for (const Touch& touch : touches) path.push_back(touch.b < 0 ? touch.a : insert_node_on_edge(mesh, touch.a, touch.b, touch.x));
  return path;
}

}  // namespace trocar::fem
