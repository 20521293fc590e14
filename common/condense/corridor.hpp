// Distance between the corridor's centre line and cells.
#pragma once

#include <span>

#include "common/model/tissue.hpp"
#include "common/scene/scene.hpp"

namespace trocar::condense {

// m; 0 when they touch. The polygon is convex and counter-clockwise.
[[nodiscard]] double distance_m(const scene::Corridor& line, std::span<const model::Vector2> polygon);

}  // namespace trocar::condense
