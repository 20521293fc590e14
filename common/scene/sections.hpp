// The sections of a scene file, each read from its table. Internal to this folder.
#pragma once

#include <initializer_list>
#include <optional>
#include <string_view>

#include "common/config/document.hpp"
#include "common/scene/scene.hpp"

namespace trocar::scene {

inline constexpr config::Range coordinate{-10.0, 10.0};

// Two corners of `dimension` coordinates each, in any order; absent without the key.
[[nodiscard]] std::optional<fem::Box> box_of(const config::Table& table, int dimension);

// A side, or nothing for another word.
[[nodiscard]] std::optional<fem::Side> side_of(std::string_view word);

[[nodiscard]] fem::Grid grid_of(const config::Table& grid, fem::Model model);
[[nodiscard]] fem::Tissue tissue_of(const config::Table& tissue, const std::filesystem::path& scene_file);
[[nodiscard]] Needle needle_of(const config::Table& needle);
// Fills contact, velocity_law, corridor, plane_z_m, visible and single_precision; tissue and needle are read before.
void read_contact(const config::Table& root, const config::Table& contact, Scene& scene);

}  // namespace trocar::scene
