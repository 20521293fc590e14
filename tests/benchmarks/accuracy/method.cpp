#include "tests/benchmarks/accuracy/method.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>

#include "common/fem/statics.hpp"
#include "common/fem/subdivide.hpp"

namespace trocar::bench {
namespace {

// More than any force here by far.
constexpr double glued_n_per_m = 1e9;

class Placed {
 public:
  Placed(const Compiled& compiled, contact::Method method, double density_factor, const Path& path, double depth_m)
      : law_(compiled.law()), image_(compiled.image()), path_(path), depth_m_(depth_m) {
    law_.method = method == contact::Method::Subdivide ? contact::Method::Snap : method;
    law_.shaft_n_per_m *= density_factor;
    law_.tip_n_per_m *= density_factor;
    // Explicit contacts have literal thresholds; the others follow from the densities.
    for (std::size_t i = 0; i < law_.explicit_count; ++i) law_.explicit_slip_force_n[i] *= density_factor;
    image_.law = &law_;
    insertion_->open(image_);
    const insertion::Result at_rest = insertion_->step(base_pose(path, depth_m), 1e-3);
    note(at_rest);
    rest_ = at_rest.base;
  }

  insertion::Result move(double along_m, double across_m) {
    const auto [tx, ty] = path_.tangent();
    insertion::Pose pose = base_pose(path_, depth_m_);
    pose.x_m += along_m * tx - across_m * ty;
    pose.y_m += along_m * ty + across_m * tx;
    const insertion::Result result = insertion_->step(pose, 1e-3);
    note(result);
    return result;
  }

  [[nodiscard]] const insertion::Insertion& insertion() const { return *insertion_; }
  [[nodiscard]] insertion::Status status() const { return status_; }
  // What holds the nodes that snap has pulled onto the shaft, before the base moves. Zero for the other methods.
  [[nodiscard]] const insertion::Wrench& rest() const { return rest_; }

  // Contact forces on the nodes of the mesh, 2 rows a node.
  [[nodiscard]] Eigen::VectorXd loads_n(const Compiled& compiled) const {
    Eigen::VectorXd f = Eigen::VectorXd::Zero(2 * static_cast<Eigen::Index>(compiled.mesh().node.size()));
    const contact::WorkingSet& set = insertion_->working_set();
    for (std::size_t i = 0; i < set.size(); ++i) {
      const contact::Embedding& at = set.point(i).at;
      const contact::Vector2& force = set.solver().contact(i).force_n;
      for (std::uint32_t k = 0; k < at.count; ++k)
        f.segment<2>(2 * compiled.mesh_node(at.node[k])) += at.weight[k] * Eigen::Vector2d(force[0], force[1]);
    }
    return f;
  }

  [[nodiscard]] fem::Mesh mesh(const Compiled& compiled) const {
    fem::Mesh mesh = compiled.mesh();
    const contact::Geometry& geometry = insertion_->working_set().geometry();
    for (std::uint32_t n = 0; n < image_.tissue.node_m.size(); ++n)
      if (geometry.is_moved(n)) {
        const contact::Vector2 x = geometry.node_m(n);
        mesh.node[static_cast<std::size_t>(compiled.mesh_node(n))] = {x[0], x[1], 0.0};
      }
    return mesh;
  }

 private:
  void note(const insertion::Result& result) { status_ = std::max(status_, result.status); }

  contact::Law law_;
  model::Image image_;
  Path path_;
  double depth_m_;
  std::unique_ptr<insertion::Insertion> insertion_{std::make_unique<insertion::Insertion>()};
  insertion::Status status_{};
  insertion::Wrench rest_{};
};

double axial(const insertion::Wrench& base, const Path& path) {
  const auto [tx, ty] = path.tangent();
  return tx * base.fx_n + ty * base.fy_n;
}

double lateral(const insertion::Wrench& base, const Path& path) {
  const auto [tx, ty] = path.tangent();
  return tx * base.fy_n - ty * base.fx_n;
}

}  // namespace

Compiled::Compiled(const scene::Scene& scene) { open(scene, condense::plan(scene, condense::WithVisible::No)); }

Compiled::Compiled(const scene::Scene& scene, const fem::Mesh& mesh) {
  open(scene, condense::plan(scene, mesh, condense::WithVisible::No));
}

void Compiled::open(const scene::Scene& scene, const condense::Plan& plan) {
  mesh_ = plan.mesh;
  bytes_ = condense::compile(scene, plan, {.visible = condense::WithVisible::No}).image;
  if (const model::ImageStatus status = model::open(bytes_.span(), image_); status != model::ImageStatus::Ok)
    throw std::runtime_error(std::string("the compiled scene is refused: ") + model::to_string(status));
  if (mesh_.dimension() != 2) return;
  const fem::Locator locator(mesh_);
  for (const model::Vector2& x : image_.tissue.node_m) {
    const int node = locator.nearest_node({x[0], x[1], 0.0});
    if (mesh_.node[static_cast<std::size_t>(node)] != fem::Point{x[0], x[1], 0.0})
      throw std::logic_error("a candidate is no node of the mesh");
    mesh_node_.push_back(node);
  }
}

const char* name_of(contact::Method method) {
  switch (method) {
    case contact::Method::Embedded:
      return "embedded";
    case contact::Method::Snap:
      return "snap";
    case contact::Method::Adapt:
      return "adapt";
    case contact::Method::Subdivide:
      break;
  }
  return "subdivide";
}

Compiled subdivided(scene::Scene scene, const Path& path, double depth_m) {
  fem::Mesh mesh = fem::make_mesh(scene.tissue);
  const std::vector<int> nodes = fem::subdivide(mesh, path.at(0.0), path.at(depth_m), 0.0);
  if (nodes.size() > capacity::contacts) throw std::runtime_error("subdivision makes more contacts than there may be");
  contact::Law& law = *scene.contact;
  std::vector<double> depth;
  for (const int n : nodes) depth.push_back(mesh.node[static_cast<std::size_t>(n)][1] / path.tangent()[1]);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const fem::Point& x = mesh.node[static_cast<std::size_t>(nodes[i])];
    const double begin = i == 0 ? 0.0 : 0.5 * (depth[i - 1] + depth[i]);
    const double end = i + 1 == nodes.size() ? depth_m : 0.5 * (depth[i] + depth[i + 1]);
    law.explicit_point_m[i] = {x[0], x[1]};
    law.explicit_slip_force_n[i] = density_integral_n(begin, end, depth_m);
  }
  law.explicit_count = static_cast<std::uint32_t>(nodes.size());
  return {scene, mesh};
}

insertion::Pose base_pose(const Path& path, double depth_m) {
  const fem::Point base = path.at(depth_m - needle_length_m);
  return {base[0], base[1], 0.5 * std::numbers::pi - path.angle_rad};
}

Asked coarse_answer(const Compiled& compiled, contact::Method method, const Path& path, double depth_m,
                    const std::vector<fem::Point>& places) {
  constexpr double small_m = 1e-4;  // everything is linear while it is stuck
  Asked asked;
  Placed along(compiled, method, glued_n_per_m, path, depth_m), across(compiled, method, glued_n_per_m, path, depth_m);
  Placed slipping(compiled, method, 1.0, path, depth_m);
  // Stiffness and what it makes visible are changes from rest; partial slip is what the needle does altogether.
  const Eigen::VectorXd rest_n = along.loads_n(compiled);
  asked.answer.axial_n_per_m = (axial(along.move(small_m, 0.0).base, path) - axial(along.rest(), path)) / small_m;
  asked.answer.lateral_n_per_m = (lateral(across.move(0.0, small_m).base, path) - lateral(across.rest(), path)) / small_m;
  asked.answer.slip_force_n = axial(slipping.move(slip_motion_m(depth_m), 0.0).base, path);
  asked.status = std::max({along.status(), across.status(), slipping.status()});
  asked.contacts = slipping.insertion().contacts();

  const fem::Mesh mesh = along.mesh(compiled);
  const fem::Statics statics(mesh, block_tissue());
  const fem::Locator locator(mesh);
  Eigen::MatrixXd loads(statics.degrees_of_freedom(), 3);
  loads << (along.loads_n(compiled) - rest_n) / small_m, (across.loads_n(compiled) - rest_n) / small_m, slipping.loads_n(compiled);
  const Eigen::MatrixXd u = statics.solve(loads);
  asked.answer.axial_visible = displacement_at(locator, u.col(0), places);
  asked.answer.lateral_visible = displacement_at(locator, u.col(1), places);
  asked.answer.slip_visible_m = displacement_at(locator, u.col(2), places);
  const Eigen::VectorXd tip = displacement_at(locator, u.col(2), {path.at(depth_m)});
  const auto [tx, ty] = path.tangent();
  asked.answer.tip_m = tx * tip(0) + ty * tip(1);
  return asked;
}

}  // namespace trocar::bench
