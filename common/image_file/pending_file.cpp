#include "common/image_file/pending_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <utility>

#include "common/config/user_error.hpp"

namespace trocar::image_file {

PendingFile::PendingFile(std::filesystem::path file) : file_(std::move(file)) {
  if (std::error_code ignored; std::filesystem::is_directory(file_, ignored)) fail(EISDIR);
  temporary_ = file_.string() + "." + std::to_string(getpid()) + ".part";
  descriptor_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(errno);
}

PendingFile::~PendingFile() {
  if (descriptor_ < 0) return;
  close(descriptor_);
  unlink(temporary_.c_str());
}

void PendingFile::fail(int error) const {
  throw config::UserError(file_.string() + ": cannot be written (" + std::strerror(error) + "); give another place with enough room");
}

void PendingFile::write(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t done = ::write(descriptor_, bytes.data(), bytes.size());
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) fail(done < 0 ? errno : ENOSPC);
    bytes = bytes.subspan(static_cast<std::size_t>(done));
  }
}

void PendingFile::sync() {
  if (fsync(descriptor_) != 0 && errno != EINVAL) fail(errno);
}

void PendingFile::commit() {
  if (std::rename(temporary_.c_str(), file_.c_str()) != 0) fail(errno);
  close(std::exchange(descriptor_, -1));
}

}  // namespace trocar::image_file
