#include "common/image_file/mapped_image.hpp"

#include "common/config/user_error.hpp"

namespace trocar::image_file {

MappedImage::MappedImage(const std::filesystem::path& file, Lock lock) : file_(file, lock) {
  const model::ImageStatus status = model::open(file_.bytes(), image_);
  if (status != model::ImageStatus::Ok) throw config::UserError(file.string() + ": " + model::to_string(status));
}

}  // namespace trocar::image_file
