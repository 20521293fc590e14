#include "common/optics/pose_file.hpp"

#include <fmt/format.h>

#include "common/config/document.hpp"

namespace trocar::optics {

Pose read_pose(const std::filesystem::path& file) {
  const config::Document document = config::Document::load(file);
  const config::Table root = document.root();
  Pose pose;
  pose.rotation_rad =
      root.numbers<3>("rotation_rad", {-10.0, 10.0}, "axis times angle of the plane in the camera's frame, such as [3.14159, 0.0, 0.0]");
  pose.translation_m = root.numbers<3>("translation_m", {-1e4, 1e4}, "the first marker in the camera's frame, such as [-0.05, 0.05, 0.15]");
  document.refuse_unknown_keys();
  return pose;
}

void write_pose(std::ostream& stream, const Pose& pose) {
  stream << fmt::format("# A plane in the camera's frame.\nrotation_rad = [{}]\ntranslation_m = [{}]\n", fmt::join(pose.rotation_rad, ", "),
                        fmt::join(pose.translation_m, ", "));
}

}  // namespace trocar::optics
