// What a scene file says about tissue, as plain data. SI units.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

namespace trocar::fem {

// A model that cannot be computed; what() says why and what to change.
class Error : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

enum class Model : std::uint8_t { PlaneStress, PlaneStrain };
enum class Element : std::uint8_t { Tri3, Quad4 };  // Tri3: diagonals run from lower left to upper right
enum class Edge : std::uint8_t { XMin, XMax, YMin, YMax };

struct Box {
  std::array<double, 2> min_m{};
  std::array<double, 2> max_m{};
};

struct Grid {
  std::array<double, 2> size_m{};
  std::array<double, 2> origin_m{};  // lower left corner
  std::array<int, 2> nodes{};        // along x and y, at least 2
  Element element{Element::Quad4};
};

// Applies where the element's centroid lies inside `box`, everywhere without one. Later zones override earlier ones.
struct Material {
  double young_pa{};
  double poisson{};  // 0 <= nu < 0.5
  std::optional<Box> box{};
};

// Nodes on an edge of the mesh's bounding box, or inside `box` when given.
struct Support {
  Edge edge{};
  std::optional<Box> box{};
  bool fix_x{};
  bool fix_y{};
};

struct Tissue {
  Model model{Model::PlaneStress};
  double thickness_m{};
  Grid grid{};
  std::vector<Material> materials{};
  std::vector<Support> supports{};
};

}  // namespace trocar::fem
