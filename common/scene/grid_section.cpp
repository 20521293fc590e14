#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/fem/mesh.hpp"
#include "common/scene/sections.hpp"
#include "common/scene/spacing.hpp"

namespace trocar::scene {
namespace {

using config::Range;
using config::Table;

constexpr std::array<const char*, 3> axis_key{"x_m", "y_m", "z_m"};
constexpr Range extent{1e-4, 10.0};
constexpr std::int64_t most_nodes = 2001;  // along one axis
constexpr double steepest_allowed = 3.0;

fem::Type element_of(const Table& table, bool solid) {
  const std::string word = table.one_of("element", {"tri3", "quad4", "tet4", "hex8"});
  const bool solid_word = word == "tet4" || word == "hex8";
  if (solid_word != solid) {
    table.fail("element", solid ? "a planar element in a solid; write \"tet4\" or \"hex8\", or take the model plane_stress"
                                : "an element of solids in a planar model; write \"tri3\" or \"quad4\", or take the model solid");
  }
  return word == "tri3" ? fem::Type::Tri3 : word == "quad4" ? fem::Type::Quad4 : word == "tet4" ? fem::Type::Tet4 : fem::Type::Hex8;
}

// The member named `key` of a list of 2 or 3.
template <class Number, class Read2, class Read3>
std::array<Number, 3> of_dimension(int dimension, Number rest, const Read2& read2, const Read3& read3) {
  std::array<Number, 3> all{rest, rest, rest};
  if (dimension == 2) {
    const auto two = read2();
    std::copy(two.begin(), two.end(), all.begin());
  } else {
    const auto three = read3();
    std::copy(three.begin(), three.end(), all.begin());
  }
  return all;
}

std::vector<double> graded(const Table& entry, double from, double to, int nodes, std::size_t axis) {
  const char* const letter = axis == 0 ? "x" : axis == 1 ? "y" : "z";
  double towards =
      entry.number("towards_m", coordinate, fmt::format("where the elements are smallest, from {} to {} along {}", from, to, letter));
  const double slack = 1e-9 * (to - from);
  if (towards < from - slack || towards > to + slack)
    entry.fail("towards_m", fmt::format("outside of the grid, which reaches from {} to {} m along {}", from, to, letter));
  towards = std::abs(towards - from) <= slack ? from : std::abs(towards - to) <= slack ? to : towards;
  const bool inner = towards > from && towards < to;
  if (inner && nodes < 3) entry.fail("towards_m", fmt::format("{} nodes along {} have none inside; give at least 3", nodes, letter));
  if (entry.has("smallest_m") == entry.has("ratio"))
    entry.fail("smallest_m", "give either smallest_m, the size of the smallest elements, or ratio, by which they grow");

  std::vector<double> result;
  const char* key = "ratio";
  if (entry.has("smallest_m")) {
    key = "smallest_m";
    const double smallest = entry.number("smallest_m", {1e-6, 10.0}, "the size of the elements at towards_m, such as 0.0005");
    result = axis_with_smallest(from, to, towards, nodes, smallest);
    if (result.empty())
      entry.fail("smallest_m",
                 fmt::format("{} nodes along {} with elements of at least this size do not fit; equal ones are {:.4g} m, so write less",
                             nodes, letter, (to - from) / (nodes - 1)));
  } else {
    result = axis_with_ratio(from, to, towards, nodes,
                             entry.number("ratio", {1.0, steepest_allowed}, "from one element to the next, such as 1.2"));
  }
  if (const double steep = steepest(result); steep > steepest_allowed * (1.0 + 1e-9))
    entry.fail(key, fmt::format("neighbouring elements differ by a factor of {:.3g}, and {} is the most; give more nodes along {}{}", steep,
                                steepest_allowed, letter, entry.has("smallest_m") ? " or a larger smallest_m" : " or move towards_m"));
  return result;
}

}  // namespace

fem::Grid grid_of(const Table& table, fem::Model model) {
  const bool solid = model == fem::Model::Solid;
  const int dimension = solid ? 3 : 2;
  fem::Grid grid;
  grid.element = element_of(table, solid);
  if (table.has("x_m") || table.has("y_m") || table.has("z_m")) {
    for (const char* other : {"size_m", "origin_m", "nodes", "spacing"})
      if (table.has(other)) table.fail(other, "the node coordinates are given by x_m and y_m; remove either these or those");
    if (!solid && table.has("z_m")) table.fail("z_m", "a planar model has no z; remove the key or take the model solid");
    for (std::size_t a = 0; a < static_cast<std::size_t>(dimension); ++a) {
      grid.axis_m[a] = table.list(axis_key[a], coordinate, "node coordinates, increasing, such as [0.0, 0.01, 0.03]");
      const auto& axis = grid.axis_m[a];
      if (axis.size() < 2 || axis.size() > static_cast<std::size_t>(most_nodes))
        table.fail(axis_key[a], fmt::format("{} nodes; give from 2 to {}", axis.size(), most_nodes));
      if (std::adjacent_find(axis.begin(), axis.end(), std::greater_equal<>()) != axis.end())
        table.fail(axis_key[a], "must increase from each entry to the next; sort them and remove doubles");
    }
    return grid;
  }

  constexpr std::string_view size_remedy = "extent along each axis, such as 0.1";
  constexpr std::string_view origin_remedy = "the corner with the least coordinates, such as [-0.05, 0.15]";
  constexpr std::string_view nodes_remedy = "along each axis, such as 21";
  const auto size = of_dimension(
      dimension, 0.0, [&] { return table.numbers<2>("size_m", extent, size_remedy); },
      [&] { return table.numbers<3>("size_m", extent, size_remedy); });
  const auto origin = of_dimension(
      dimension, 0.0, [&] { return table.numbers<2>("origin_m", coordinate, origin_remedy); },
      [&] { return table.numbers<3>("origin_m", coordinate, origin_remedy); });
  const auto nodes = of_dimension(
      dimension, std::int64_t{1}, [&] { return table.integers<2>("nodes", 2, most_nodes, nodes_remedy); },
      [&] { return table.integers<3>("nodes", 2, most_nodes, nodes_remedy); });
  if (static_cast<double>(nodes[0]) * static_cast<double>(nodes[1]) * static_cast<double>(nodes[2]) > fem::most_nodes)
    table.fail("nodes", fmt::format("{} nodes; at most {} fit in memory", nodes[0] * nodes[1] * nodes[2], fem::most_nodes));
  grid =
      fem::uniform_grid(grid.element, origin, size, {static_cast<int>(nodes[0]), static_cast<int>(nodes[1]), static_cast<int>(nodes[2])});

  if (!table.has("spacing")) return grid;
  const auto entries =
      table.words_and_tables("spacing", {"uniform"}, "one entry an axis: \"uniform\" or { towards_m, smallest_m } or { towards_m, ratio }");
  if (entries.size() != static_cast<std::size_t>(dimension))
    table.fail("spacing", fmt::format("{} entries; write one for each of the {} axes", entries.size(), dimension));
  for (std::size_t a = 0; a < entries.size(); ++a)
    if (entries[a]) grid.axis_m[a] = graded(*entries[a], origin[a], origin[a] + size[a], static_cast<int>(nodes[a]), a);
  return grid;
}

}  // namespace trocar::scene
