// The sections of a .msh file as they stand, before a mesh is made of them. Internal to gmsh.cpp.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "common/fem/tissue.hpp"

namespace trocar::fem {

struct MshElement {
  int type{};                      // gmsh's number
  std::vector<int> physical{};     // groups of its own dimension
  std::vector<std::int64_t> node;  // tags
};

struct MshFile {
  std::map<std::pair<int, int>, std::string> physical_name{};  // (dimension, number)
  std::vector<std::int64_t> node_tag{};
  std::vector<Point> node{};
  std::vector<MshElement> element{};
};

// What gmsh calls an element type; count 0 for a number that is not known.
struct MshType {
  int dimension{};
  int nodes{};
  const char* name{};
};
[[nodiscard]] MshType msh_type(int number);

// Throws Error for a file that cannot be read as format 2.2 or 4.1.
[[nodiscard]] MshFile read_msh(const std::filesystem::path& file);

}  // namespace trocar::fem
