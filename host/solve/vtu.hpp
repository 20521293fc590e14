// Fields on a mesh as a VTK XML file (.vtu), which ParaView opens.
#pragma once

#include <iosfwd>
#include <string>
#include <vector>

#include "common/fem/mesh.hpp"

namespace trocar::host {

struct Field {
  std::string name{};  // with its unit: displacement_m
  int components{1};
  std::vector<double> value{};  // components a point or cell, one after the other
};

// Binary, appended raw, little endian; cells are the elements in their order. Throws std::invalid_argument when a field's size does not
// fit.
void write_vtu(std::ostream& stream, const fem::Mesh& mesh, const std::vector<Field>& points, const std::vector<Field>& cells);

}  // namespace trocar::host
