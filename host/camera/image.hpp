// Images from files.
#pragma once

#include <filesystem>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

namespace trocar::camera {

// The file is there, and what it holds is no whole image: what() is the reason alone.
struct DamagedImage : std::runtime_error {
  using std::runtime_error::runtime_error;
};

enum class Colour { Grey, AsStored };

// 8 bits a channel, 16 where the file has them and AsStored is asked for. Throws config::UserError when the file cannot be read,
// DamagedImage when it is empty, truncated, or in no known format.
[[nodiscard]] cv::Mat read_image(const std::filesystem::path& file, Colour colour);

}  // namespace trocar::camera
