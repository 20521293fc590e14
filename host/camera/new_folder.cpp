#include "host/camera/new_folder.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>

#include "common/config/user_error.hpp"

namespace trocar::camera {

NewFolder::NewFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  if (folder_.filename().empty()) folder_ = folder_.parent_path();  // a name that ends in '/'
  std::error_code error;
  if (std::filesystem::exists(std::filesystem::symlink_status(folder_, error)))
    throw config::UserError(fmt::format("{}: is there already; name a new folder", folder_.string()));
  part_ = folder_.parent_path() / fmt::format(".{}.{}.part", folder_.filename().string(), ::getpid());
  if (!std::filesystem::create_directory(part_, error))
    throw config::UserError(
        fmt::format("{}: cannot be made: {}; choose a place that exists and is yours", folder_.string(), error.message()));
}

NewFolder::~NewFolder() {
  std::error_code ignored;
  if (!part_.empty()) std::filesystem::remove_all(part_, ignored);
}

void NewFolder::keep() {
  std::error_code error;
  std::filesystem::rename(part_, folder_, error);
  if (error) throw config::UserError(fmt::format("{}: cannot be made: {}", folder_.string(), error.message()));
  part_.clear();
}

}  // namespace trocar::camera
