#include "common/config/new_file.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "common/config/user_error.hpp"

namespace trocar::config {

NewFile::NewFile(std::filesystem::path file) : file_(std::move(file)) {
  const std::string name = file_.string();
  std::error_code error;
  const auto status = std::filesystem::status(file_, error);
  if (status.type() == std::filesystem::file_type::directory) throw UserError(fmt::format("{}: this is a folder; name a file in it", name));
  if (std::filesystem::exists(status) && status.type() != std::filesystem::file_type::regular)
    throw UserError(fmt::format("{}: not a regular file; choose another name", name));
  part_ = file_.parent_path() / fmt::format(".{}.{}.part", file_.filename().string(), ::getpid());
  errno = 0;
  stream_.open(part_, std::ios::binary | std::ios::trunc);
  if (!stream_)
    throw UserError(fmt::format("{}: cannot be written: {}; choose a folder that exists and is yours", name, std::strerror(errno)));
}

NewFile::~NewFile() {
  stream_.close();
  std::error_code ignored;
  if (!part_.empty()) std::filesystem::remove(part_, ignored);
}

void NewFile::keep() {
  errno = 0;
  stream_.close();
  if (stream_.fail()) throw UserError(fmt::format("{}: cannot be written: {}; is the disk full?", file_.string(), std::strerror(errno)));
  std::error_code error;
  std::filesystem::rename(part_, file_, error);
  if (error) throw UserError(fmt::format("{}: cannot be written: {}", file_.string(), error.message()));
  part_.clear();
}

}  // namespace trocar::config
