// What compiling a scene will do and cost, before anything large is computed.
#pragma once

#include <cstddef>
#include <vector>

#include "common/condense/candidates.hpp"
#include "common/fem/mesh.hpp"
#include "common/image_file/visible_map.hpp"
#include "common/model/image.hpp"
#include "common/model/law.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

struct Cost {
  std::size_t unknowns{};  // of the tissue
  std::size_t columns{};   // of the compliance, 2 a candidate node
  std::size_t image_bytes{};
  std::size_t visible_bytes{};  // 0 without a visible map
  std::size_t factor_bytes{};   // estimated from the mesh; the factor itself tells later
  std::size_t memory_bytes{};   // at the peak, with that factor
};

struct Visible {
  std::vector<int> node{};  // of the mesh, increasing
  std::vector<std::array<double, 3>> node_m{};
  std::vector<image_file::Face> face{};  // over `node`; faces of solids only where no second element shares them
};

struct Plan {
  fem::Mesh mesh{};
  Candidates candidates{};
  Visible visible{};
  contact::Law law{};  // the scene's, with a spacing
  model::Needle needle{};
  model::Need need{};
  bool single_precision{};
  Cost cost{};

  // The image as it will be, without compliance. Points into this plan.
  [[nodiscard]] model::Image image(const scene::Scene& scene) const;
};

[[nodiscard]] std::size_t peak_memory_bytes(const Cost& cost, std::size_t factor_bytes);

// The mesh of a scene, with supports that hold it and elements that can be assembled, whether it has a needle or not. Throws
// config::UserError.
[[nodiscard]] fem::Mesh check_tissue(const scene::Scene& scene);

enum class WithVisible { No, Yes };

// Throws config::UserError that begins with the scene's file: everything that candidates_of() throws, no needle or contact, a needle that
// is not rigid, a method that images cannot hold, explicit contacts outside of the candidates, a capacity exceeded.
[[nodiscard]] Plan plan(const scene::Scene& scene, WithVisible with_visible = WithVisible::Yes);
// With this mesh in place of the scene's own (subdivided along a path, say).
[[nodiscard]] Plan plan(const scene::Scene& scene, fem::Mesh mesh, WithVisible with_visible = WithVisible::Yes);

}  // namespace trocar::condense
