// What a scene says about tissue, as plain data. SI units, scene frame. Planar models leave third components at 0.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "common/element/element.hpp"

namespace trocar::fem {

// A model that cannot be computed; what() says why and what to change.
class Error : public std::invalid_argument {
 public:
  using std::invalid_argument::invalid_argument;
};

using Point = std::array<double, 3>;  // x_m, y_m, z_m

using element::Integration;
using element::Material;
using element::Model;
using element::Type;

enum class Strain : std::uint8_t { Linear, GreenLagrange };
enum class Side : std::uint8_t { XMin, XMax, YMin, YMax, ZMin, ZMax };  // of the mesh's bounding box

struct Box {  // corners belong to it; unbounded unless stated
  static constexpr double far = std::numeric_limits<double>::infinity();
  Point min_m{-far, -far, -far};
  Point max_m{far, far, far};
  friend bool operator==(const Box&, const Box&) = default;
};

// Node coordinates along each axis, increasing, at least two: uniform or graded. Planar elements leave the third axis empty.
// Tri3: diagonals from lower left to upper right. Tet4: six to a brick, all around its diagonal from the least to the greatest corner.
struct Grid {
  Type element{Type::Quad4};
  std::array<std::vector<double>, 3> axis_m{};
};

// Where nodes are chosen: on a side, in a box, or the group of that name (a physical group of a gmsh file).
// The constructors are implicit on purpose: a side, a box or a name is what a caller has in hand.
struct Where {
  enum class Kind : std::uint8_t { Side, Box, Group };
  Where() = default;
  Where(Side on) : side(on) {}
  Where(const Box& in) : kind(Kind::Box), box(in) {}
  Where(std::string name) : kind(Kind::Group), group(std::move(name)) {}
  friend bool operator==(const Where&, const Where&) = default;

  Kind kind{Kind::Side};
  Side side{};
  Box box{};
  std::string group{};
};

// Material of the elements whose centroid lies in `box` and that belong to `region`; of all elements without either.
// Later zones override earlier ones.
struct Zone {
  Material material{};
  std::optional<Box> box{};
  std::optional<std::string> region{};
};

// Displacement zero along the axes in `fix`.
struct Support {
  Where where{};
  std::array<bool, 3> fix{};
};

struct Tissue {
  Model model{Model::PlaneStress};
  Integration integration{Integration::Full};
  Strain strain{Strain::Linear};
  double thickness_m{};               // planar models
  std::optional<Grid> grid{};         // exactly one of grid and mesh_file
  std::filesystem::path mesh_file{};  // gmsh .msh
  std::vector<Zone> zones{};
  std::vector<Support> supports{};
};

}  // namespace trocar::fem
