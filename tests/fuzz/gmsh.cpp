// Meshes: refused in one line, or whole: every index in range, every number finite, every element the right way round.
#include <algorithm>
#include <cmath>

#include "common/fem/gmsh.hpp"
#include "memory_file.hpp"

using namespace trocar;
using fuzz::require;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path file = fuzz::memory_file(data, size);
  fem::Mesh mesh;
  try {
    mesh = fem::read_gmsh(file);
  } catch (const fem::Error& refusal) {
    fuzz::require_message(refusal.what(), file);
    return 0;
  }
  const int nodes = static_cast<int>(mesh.node.size());
  require(nodes > 0 && !mesh.element.empty(), "a mesh is not empty");
  for (const fem::Point& node : mesh.node)
    for (const double x : node) require(std::isfinite(x), "nodes are finite");
  std::vector<bool> used(mesh.node.size());
  for (const auto& element : mesh.element) {
    for (int k = 0; k < mesh.nodes_per_element(); ++k) {
      const int node = element[static_cast<std::size_t>(k)];
      require(node >= 0 && node < nodes, "elements name nodes that are there");
      used[static_cast<std::size_t>(node)] = true;
    }
  }
  require(std::ranges::find(used, false) == used.end(), "nodes without an element are dropped");
  require(mesh.region.empty() || mesh.region.size() == mesh.element.size(), "every element has its region, or none has");
  for (const int region : mesh.region)
    require(region >= -1 && region < static_cast<int>(mesh.region_name.size()), "elements name regions that are there");
  for (const auto& [name, group] : mesh.group) {
    for (std::size_t i = 0; i < group.size(); ++i)
      require(group[i] >= 0 && group[i] < nodes && (i == 0 || group[i - 1] < group[i]), "groups hold increasing nodes");
  }
  return 0;
}
