#include "common/condense/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "common/condense/naming_the_file.hpp"
#include "common/core/capacities.hpp"
#include "common/fem/assembly.hpp"
#include "common/fem/statics.hpp"
#include "common/needle/bevel.hpp"

namespace trocar::condense {
namespace {

using fem::Type;

// Corners of the faces of each solid element, counter-clockwise from outside; a triangle repeats none and ends with -1.
constexpr std::array<std::array<int, 4>, 4> tet_faces{{{0, 2, 1, -1}, {0, 1, 3, -1}, {1, 2, 3, -1}, {0, 3, 2, -1}}};
constexpr std::array<std::array<int, 4>, 6> brick_faces{
    {{0, 3, 2, 1}, {4, 5, 6, 7}, {0, 1, 5, 4}, {1, 2, 6, 5}, {2, 3, 7, 6}, {3, 0, 4, 7}}};

// Faces whose nodes are all visible; of a solid only those on its surface.
std::vector<image_file::Face> faces_of(const fem::Mesh& mesh, const std::vector<int>& visible) {
  std::vector<std::uint32_t> place(mesh.node.size(), image_file::no_corner);
  for (std::size_t v = 0; v < visible.size(); ++v) place[static_cast<std::size_t>(visible[v])] = static_cast<std::uint32_t>(v);
  std::vector<image_file::Face> faces;
  std::map<image_file::Face, std::size_t> seen;  // sorted corners of a solid's faces
  std::vector<std::size_t> times;
  const auto add = [&](const std::array<int, 8>& element, std::span<const int> corners) {
    image_file::Face face{image_file::no_corner, image_file::no_corner, image_file::no_corner, image_file::no_corner};
    for (std::size_t k = 0; k < corners.size(); ++k) {
      if (corners[k] < 0) continue;
      face[k] = place[static_cast<std::size_t>(element[static_cast<std::size_t>(corners[k])])];
      if (face[k] == image_file::no_corner) return;
    }
    image_file::Face key = face;
    std::sort(key.begin(), key.end());
    const auto [at, fresh] = seen.emplace(key, faces.size());
    if (fresh) {
      faces.push_back(face);
      times.push_back(1);
    } else {
      ++times[at->second];
    }
  };
  for (const auto& element : mesh.element) {
    switch (mesh.type) {
      case Type::Tri3:
        add(element, std::array{0, 1, 2});
        break;
      case Type::Quad4:
        add(element, std::array{0, 1, 2, 3});
        break;
      case Type::Tet4:
        for (const auto& face : tet_faces) add(element, face);
        break;
      case Type::Hex8:
        for (const auto& face : brick_faces) add(element, face);
        break;
    }
  }
  std::vector<image_file::Face> outer;
  for (std::size_t f = 0; f < faces.size(); ++f)
    if (times[f] == 1) outer.push_back(faces[f]);
  return outer;
}

Visible visible_of(const fem::Mesh& mesh, const fem::Where& where) {
  Visible visible;
  visible.node = fem::nodes_at(mesh, where);
  if (visible.node.empty()) throw fem::Error("contact.visible holds no node of the mesh; name a side or a group that does");
  for (const int n : visible.node) visible.node_m.push_back(mesh.node[static_cast<std::size_t>(n)]);
  visible.face = faces_of(mesh, visible.node);
  return visible;
}

// Nonzeros of a factor in nested dissection: n log2 n in the plane, n^(4/3) in space; the constants fit bricks and quads in CHOLMOD
// with METIS from 400 to 150,000 unknowns to a factor of about 1.5 (thin plates take less).
std::size_t factor_estimate(double unknowns, int dimension) {
  const double n = std::max(2.0, unknowns);
  const double nonzeros = dimension == 2 ? 7.0 * n * std::log2(n) : 20.0 * std::pow(n, 4.0 / 3.0);
  return static_cast<std::size_t>(8.0 * nonzeros);
}

// What fits in one image, or an error that names the key.
void check_method(const scene::Scene& scene, bool solid) {
  if (!scene.needle || !scene.contact)
    throw fem::Error("no [needle] or no [contact]: an image needs both; write them as in host/share/scenes");
  if (scene.needle->model == scene::NeedleModel::Thesis)
    throw fem::Error("needle.model = \"thesis\" is computed offline alone; write model = \"beam\" or \"rigid\"");
  if (scene.contact->method == contact::Method::Subdivide)
    throw fem::Error(
        "contact.method = \"subdivide\" changes the unknowns, which an image cannot; write \"embedded\", \"snap\" or \"adapt\"");
  if (scene.contact->method == contact::Method::Adapt && solid)
    throw fem::Error("contact.method = \"adapt\" moves nodes of planar elements, and this tissue is solid; write \"embedded\" or \"snap\"");
  if (needle::lateral_per_axial(scene.needle->bevel) != 0.0 &&
      (scene.contact->method != contact::Method::Embedded || scene.contact->explicit_count > 0))
    throw fem::Error(
        "needle.bevel_deg: the side force of a bevel acts where embedded contacts are cut; write contact.method = \"embedded\" and no "
        "contact.points_m, or bevel = \"symmetric\"");
  if (scene.tissue.strain != fem::Strain::Linear)
    throw fem::Error("tissue.strain = \"green_lagrange\" cannot be condensed; write \"linear\"");
}

// Length of needle that the candidates can hold at most.
double reach_m(const Candidates& c, double needle_m) {
  const model::Vector2 size{c.buckets.size_m[0] * c.buckets.count[0], c.buckets.size_m[1] * c.buckets.count[1]};
  return std::min(needle_m, std::hypot(size[0], size[1]));
}

void plan_contacts(const scene::Scene& scene, Plan& plan) {
  const Candidates& c = plan.candidates;
  plan.law = *scene.contact;
  const double reach = reach_m(c, scene.needle->length_m);
  const bool given = plan.law.spacing_m > 0.0;
  // One force per edge would alternate along the path: the edges' averages hardly feel such a load (inf-sup). In planar tissue the contacts
  // are stabilised against it (contact/working_set.hpp); in a solid 1.5 edges keep it off, and 2 cost detail.
  // A node method makes a contact where the needle crosses an edge.
  const bool nodes = plan.law.method != contact::Method::Embedded;
  const bool triangles = c.cell.front().count == 3 && !nodes;
  const double edges_per_segment = scene.tissue.model == fem::Model::Solid ? 1.5 : triangles ? model::square_of_triangles : 1.0;
  if (!given) plan.law.spacing_m = std::max(edges_per_segment * c.edge_length_m, reach / static_cast<double>(capacity::contacts));
  if (plan.law.explicit_count > capacity::contacts)
    throw fem::Error(
        fmt::format("contact.points_m has {} contacts and the capacity is {}; give fewer", plan.law.explicit_count, capacity::contacts));
  for (std::size_t i = 0; i < plan.law.explicit_count; ++i) {
    const auto& x = plan.law.explicit_point_m[i];
    if (cell_at(c.node_m, c.cell, c.buckets, x) < 0)
      throw fem::Error(fmt::format("contact.points_m[{}] = ({}, {}) m lies outside of the tissue{}; move it inside", i, x[0], x[1],
                                   scene.corridor ? " in contact.corridor" : ""));
    const auto& cell = c.cell[static_cast<std::size_t>(cell_at(c.node_m, c.cell, c.buckets, x))];
    const auto held = [&](std::uint32_t node) { return (c.flags[node] & model::fixed_x) != 0 && (c.flags[node] & model::fixed_y) != 0; };
    bool all = true;
    bool on_one = false;
    for (std::size_t k = 0; k < cell.count; ++k) {
      const auto& at = c.node_m[cell.node[k]];
      all = all && held(cell.node[k]);
      on_one = on_one || (held(cell.node[k]) && std::hypot(at[0] - x[0], at[1] - x[1]) < 1e-6 * c.edge_length_m);
    }
    if (all || on_one)
      throw fem::Error(
          fmt::format("contact.points_m[{}] = ({}, {}) m lies on supported tissue, which cannot give way; move it", i, x[0], x[1]));
  }
  const double spacing = nodes ? c.edge_length_m : plan.law.spacing_m;
  const double contacts = plan.law.explicit_count > 0 ? plan.law.explicit_count : std::ceil(reach / spacing * (1.0 - 1e-12));
  if (contacts > static_cast<double>(capacity::contacts))
    throw fem::Error(
        fmt::format("a needle with {:.4g} m in the tissue makes {:.0f} contacts, one every {:.4g} m, and the capacity is {}; {}", reach,
                    contacts, spacing, capacity::contacts,
                    nodes ? "take a coarser mesh, a shorter needle or the method \"embedded\"" : "give a larger contact.spacing_m"));
  plan.need.contacts = static_cast<std::uint32_t>(contacts);
  plan.need.cells_per_bucket = c.buckets.longest;
  for (std::size_t n = 0; n < c.node_m.size(); ++n)
    if ((c.flags[n] & model::whole_ring) != 0)
      plan.need.ring_cells = std::max(plan.need.ring_cells, static_cast<std::uint32_t>(c.ring[n].size()));
}

void plan_cost(const scene::Scene& scene, WithVisible with_visible, Plan& plan) {
  Cost& cost = plan.cost;
  const fem::Mesh& mesh = plan.mesh;
  cost.unknowns = mesh.node.size() * static_cast<std::size_t>(mesh.dimension());
  cost.columns = plan.candidates.columns();
  const std::size_t entry = plan.single_precision ? sizeof(float) : sizeof(double);
  cost.image_bytes = model::image_size(plan.image(scene)) + cost.columns * cost.columns * entry;
  if (with_visible == WithVisible::Yes)
    cost.visible_bytes = image_file::visible_size(static_cast<std::uint32_t>(mesh.dimension()), plan.visible.node.size(),
                                                  plan.visible.face.size(), cost.columns);
  cost.factor_bytes = factor_estimate(static_cast<double>(cost.unknowns), mesh.dimension());
}

Plan plan_checked(const scene::Scene& scene, fem::Mesh mesh, WithVisible with_visible) {
  check_method(scene, mesh.dimension() == 3);
  Candidates candidates = candidates_of(mesh, scene);
  Plan result{.mesh = std::move(mesh), .candidates = std::move(candidates)};
  result.needle = {.length_m = scene.needle->length_m, .radius_m = 0.5 * scene.needle->outer_m.value_or(0.0)};
  if (scene.needle->model == scene::NeedleModel::Beam) {
    const needle::Properties beam = scene::beam_of(*scene.needle);
    result.needle.elements = beam.elements;
    result.needle.bending_nm2 = beam.bending_nm2;
    result.needle.axial_n = beam.axial_n;
    result.needle.curvature_per_m = beam.curvature_per_m;
  }
  result.needle.face_rad = scene.needle->bevel.angle_rad;
  result.needle.tip_lateral = needle::lateral_per_axial(scene.needle->bevel);
  result.single_precision = scene.single_precision;
  if (with_visible == WithVisible::Yes) result.visible = visible_of(result.mesh, scene.visible);
  plan_contacts(scene, result);
  plan_cost(scene, with_visible, result);
  result.cost.memory_bytes = peak_memory_bytes(result.cost, result.cost.factor_bytes);
  return result;
}

}  // namespace

model::Image Plan::image(const scene::Scene& scene) const {
  model::Image image{};
  model::Tissue& t = image.tissue;
  const Candidates& c = candidates;
  t.model = scene.tissue.model;
  t.integration = scene.tissue.integration;
  t.thickness_m = mesh.dimension() == 2 ? scene.tissue.thickness_m : 0.0;
  t.edge_length_m = c.edge_length_m;
  t.node_m = c.node_m;
  t.node_flags = c.flags;
  t.cell = c.cell;
  t.ring_begin = c.ring.begin;
  t.ring_cell = c.ring.entry;
  t.material = c.material;
  t.buckets = {.origin_m = c.buckets.origin_m,
               .size_m = c.buckets.size_m,
               .count = c.buckets.count,
               .begin = c.buckets.cells.begin,
               .cell = c.buckets.cells.entry};
  image.law = &law;
  image.needle = needle;
  image.need = need;
  return image;
}

std::size_t peak_memory_bytes(const Cost& cost, std::size_t factor_bytes) {
  constexpr std::size_t around_each_unknown = 3000;  // mesh, stiffness twice, blocks of columns: measured
  return factor_bytes + cost.unknowns * around_each_unknown + cost.columns * cost.columns * sizeof(double) + cost.image_bytes +
         2 * cost.visible_bytes;
}

fem::Mesh check_tissue(const scene::Scene& scene) {
  return naming_the_file(scene, [&] {
    fem::Mesh mesh = fem::make_mesh(scene.tissue);
    (void)fem::supported_degrees_of_freedom(mesh, scene.tissue.supports);
    (void)fem::assemble_stiffness(mesh, scene.tissue);
    return mesh;
  });
}

Plan plan(const scene::Scene& scene, WithVisible with_visible) {
  return naming_the_file(scene, [&] { return plan_checked(scene, fem::make_mesh(scene.tissue), with_visible); });
}

Plan plan(const scene::Scene& scene, fem::Mesh mesh, WithVisible with_visible) {
  return naming_the_file(scene, [&] { return plan_checked(scene, std::move(mesh), with_visible); });
}

}  // namespace trocar::condense
