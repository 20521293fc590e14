// A model image in a file, ready for a tick.
#pragma once

#include <filesystem>

#include "common/image_file/bytes.hpp"
#include "common/model/image.hpp"

namespace trocar::image_file {

class MappedImage {
 public:
  // Throws config::UserError: "FILE: what is wrong; what to do".
  explicit MappedImage(const std::filesystem::path& file, Lock lock = Lock::No);
  [[nodiscard]] const model::Image& image() const { return image_; }
  [[nodiscard]] std::span<const std::byte> bytes() const { return file_.bytes(); }

 private:
  MappedFile file_;
  model::Image image_{};
};

}  // namespace trocar::image_file
