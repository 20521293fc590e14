// The pose of a plane before the camera as TOML: rotation_rad = [..], translation_m = [..] (plane.hpp).
#pragma once

#include <filesystem>
#include <ostream>

#include "common/optics/plane.hpp"

namespace trocar::optics {

[[nodiscard]] Pose read_pose(const std::filesystem::path& file);  // throws config::UserError with file, line, key and remedy
void write_pose(std::ostream& stream, const Pose& pose);          // what read_pose takes, to the last bit

}  // namespace trocar::optics
