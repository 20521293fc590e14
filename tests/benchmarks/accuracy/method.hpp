// The four path methods on a coarse mesh, asked the same as the fine one: the needle is placed in undeformed tissue by common/insertion,
// its base is moved, and the contact forces that common/insertion reports are put on the mesh that the method has in the end (as it came,
// with nodes moved, or subdivided), which common/fem solves for what is visible.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "common/condense/compile.hpp"
#include "common/insertion/insertion.hpp"
#include "tests/benchmarks/accuracy/fine_reference.hpp"

namespace trocar::bench {

// A compiled scene; methods and laws may be changed in the image that it hands out.
class Compiled {
 public:
  // Throws for a scene that cannot be compiled.
  explicit Compiled(const scene::Scene& scene);
  Compiled(const scene::Scene& scene, const fem::Mesh& mesh);

  [[nodiscard]] const model::Image& image() const { return image_; }
  [[nodiscard]] const contact::Law& law() const { return *image_.law; }
  [[nodiscard]] const fem::Mesh& mesh() const { return mesh_; }
  [[nodiscard]] int mesh_node(std::uint32_t candidate) const { return mesh_node_[candidate]; }

 private:
  void open(const scene::Scene& scene, const condense::Plan& plan);

  fem::Mesh mesh_{};
  std::vector<int> mesh_node_{};  // planar scenes: of each candidate
  image_file::AlignedBytes bytes_{};
  model::Image image_{};
};

[[nodiscard]] const char* name_of(contact::Method method);

// Subdivide: common/fem makes the mesh conform to the path, and the nodes on it, all of them exactly, are explicit contacts.
[[nodiscard]] Compiled subdivided(scene::Scene scene, const Path& path, double depth_m);

struct Asked {
  Answer answer{};
  std::size_t contacts{};
  insertion::Status status{};  // worst of all steps
};
[[nodiscard]] Asked coarse_answer(const Compiled& compiled, contact::Method method, const Path& path, double depth_m,
                                  const std::vector<fem::Point>& places);

[[nodiscard]] insertion::Pose base_pose(const Path& path, double depth_m);

}  // namespace trocar::bench
