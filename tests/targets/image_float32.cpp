#include "tests/targets/replay.hpp"

namespace trocar::targets {

// The PC's file holds float64; this is the same image in float32, as the generator wrote it.
bool open_image(std::span<const std::byte> bytes, Memory& memory, model::Image& image) noexcept {
  Reader in(bytes);
  fields(in, image, memory.law);
  image.law = &memory.law;
  return in.ok() && in.at_end();
}

}  // namespace trocar::targets
