// Scene files, and the needle of one: refused in one line, or data that is finite.
#include <cmath>

#include "common/config/user_error.hpp"
#include "common/scene/scene.hpp"
#include "memory_file.hpp"

using namespace trocar;
using fuzz::require;

namespace {

template <class Read>
void attempt(const std::filesystem::path& file, Read read) {
  try {
    read();
  } catch (const config::UserError& refusal) {
    fuzz::require_message(refusal.what(), file);
  }
}

void check(const scene::Needle& needle) {
  require(std::isfinite(needle.length_m) && needle.length_m > 0.0, "a needle has a length");
  require(needle.elements >= 0 && std::isfinite(needle.curvature_per_m), "a needle is finite");
  if (needle.outer_m && needle.inner_m) require(*needle.inner_m < *needle.outer_m, "a tube has a wall");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::filesystem::path file = fuzz::memory_file(data, size);
  attempt(file, [&] {
    const scene::Scene scene = scene::read_scene(file);
    if (scene.contact) {
      require(std::isfinite(scene.contact->shaft_n_per_m) && std::isfinite(scene.contact->tip_n_per_m), "densities are finite");
      require(scene.contact->explicit_count <= capacity::contacts, "explicit contacts fit the capacity");
      require(scene.contact->velocity.rows <= capacity::velocity_law_rows, "a velocity law fits the capacity");
    }
    if (scene.needle) {
      check(*scene.needle);
      attempt(file, [&] { (void)scene::beam_of(*scene.needle); });
      if (scene.needle->model == scene::NeedleModel::Thesis) attempt(file, [&] { (void)scene::triangles_of(*scene.needle); });
    }
    attempt(file, [&] { scene::require_insertion(scene); });
    attempt(file, [&] {
      const auto entry = scene::entry_m(scene);
      require(std::isfinite(entry[0]) && std::isfinite(entry[1]), "the entry is a point");
    });
  });
  attempt(file, [&] { check(scene::read_needle(file)); });
  return 0;
}
