// A model image of a small planar mesh whose nodes are all candidates, made without common/condense, together with the whole sparse system
// that it stands for. For tests.
//   compliance  A = K^-1 with the supports eliminated, 2 rows a node, zero where a degree of freedom is supported
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "common/fem/mesh.hpp"
#include "common/fem/statics.hpp"
#include "common/model/image.hpp"

namespace trocar::reference {

// A rectangle, width along x about x = 0, depth along y from y = 0, held at its far side y = depth.
struct Block {
  fem::Type element{fem::Type::Quad4};
  int nodes_x{21};
  int nodes_y{21};
  double width_m{0.1};
  double depth_m{0.1};
  fem::Model model{fem::Model::PlaneStress};
  element::Integration integration{element::Integration::Full};
  std::vector<fem::Zone> zones{{{25300.0, 0.48}, {}, {}}};
  // Inner nodes are displaced by up to this share of an edge, from a fixed seed.
  double distortion{0.0};
};

class GridImage {
 public:
  explicit GridImage(const Block& block = {});
  // Throws std::logic_error when model::verify refuses what was built.
  GridImage(fem::Mesh mesh, const fem::Tissue& tissue, double edge_length_m);
  GridImage(const GridImage&) = delete;
  GridImage& operator=(const GridImage&) = delete;

  [[nodiscard]] const model::Image& image() const { return image_; }
  [[nodiscard]] const fem::Mesh& mesh() const { return mesh_; }
  [[nodiscard]] const fem::Statics& statics() const { return *statics_; }
  // Shaft 34 N/m, tip 68 N/m over 2.5 mm, spacing of the mesh, a needle of 0.1 m. Change it before a model is opened with the image.
  contact::Law law{};
  void set_needle_m(double length_m) { image_.needle.length_m = length_m; }

  // The same tissue with node moved to x, assembled and factored from scratch.
  [[nodiscard]] std::unique_ptr<GridImage> with_moved(const std::vector<std::pair<std::uint32_t, model::Vector2>>& moves) const;

 private:
  void add_neighbours();
  void add_rings();
  void add_buckets();
  void add_compliance();

  fem::Tissue tissue_{};
  fem::Mesh mesh_{};
  double edge_length_m_{};
  std::unique_ptr<fem::Statics> statics_{};
  std::vector<model::Vector2> node_m_{};
  std::vector<std::uint8_t> flags_{};
  std::vector<model::Cell> cell_{};
  std::vector<std::uint32_t> ring_begin_{}, ring_cell_{}, bucket_begin_{}, bucket_cell_{};
  std::vector<element::Material> material_{};
  std::vector<double> compliance_{};
  model::Image image_{};
};

}  // namespace trocar::reference
