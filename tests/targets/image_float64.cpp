#include "tests/targets/replay.hpp"

namespace trocar::targets {

// The PC's file as it is, through the reader that checks everything.
bool open_image(std::span<const std::byte> bytes, Memory&, model::Image& image) noexcept {
  return model::open(bytes, image) == model::ImageStatus::Ok;
}

}  // namespace trocar::targets
