#include "common/scene/scene.hpp"

#include <fmt/format.h>

#include "common/config/user_error.hpp"
#include "common/scene/sections.hpp"

namespace trocar::scene {

Scene read_scene(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  Scene scene;
  scene.file = file;
  scene.tissue = tissue_of(root.table("tissue"), file);
  scene.visible = scene.tissue.model == fem::Model::Solid ? fem::Where(fem::Side::ZMax) : fem::Where(fem::Box{});
  if (const auto needle = root.optional_table("needle")) scene.needle = needle_of(*needle);
  if (const auto contact = root.optional_table("contact"))
    read_contact(root, *contact, scene);
  else if (root.has("velocity_law"))
    root.fail("velocity_law", "a velocity law without [contact], which would use it; add that table or remove the law");
  document.refuse_unknown_keys();
  return scene;
}

Needle read_needle(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  if (root.has("tissue")) {
    const Scene scene = read_scene(file);
    if (scene.needle) return *scene.needle;
    throw config::UserError(
        fmt::format("{}: needle: missing; add the table [needle] with model = \"beam\", length_m and gauge", file.string()));
  }
  Needle needle = needle_of(root.table("needle"));
  document.refuse_unknown_keys();
  return needle;
}

void require_insertion(const Scene& scene) {
  const std::string file = scene.file.string();
  if (!scene.needle) throw config::UserError(fmt::format("{}: needle: missing; add the table [needle] with model and length_m", file));
  if (scene.needle->model == NeedleModel::Thesis)
    throw config::UserError(
        fmt::format("{}: needle.model = \"thesis\": computed offline alone; write \"beam\" or \"rigid\"", scene.needle->where));
  if (!scene.contact)
    throw config::UserError(
        fmt::format("{}: contact: missing; add the table [contact] with shaft_n_per_m, tip_n_per_m and tip_zone_m", file));
}

std::array<double, 2> entry_m(const Scene& scene) {
  if (!scene.tissue.grid)
    throw config::UserError(fmt::format("{}: tissue.file: where the needle enters is known for grids alone; describe the tissue with grid",
                                        scene.file.string()));
  const auto& axis = scene.tissue.grid->axis_m;
  return {axis[0].front() + 0.5 * (axis[0].back() - axis[0].front()), axis[1].front()};
}

}  // namespace trocar::scene
