#include "common/image_file/bytes.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "common/config/user_error.hpp"

namespace trocar::image_file {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const std::string& what, const std::string& remedy) {
  throw config::UserError(file.string() + ": " + what + "; " + remedy);
}

// 0 or errno; a file that has become shorter meanwhile is an error of input.
int copy(int descriptor, std::byte* to, std::size_t size) {
  for (std::size_t done = 0; done < size;) {
    const ssize_t n = ::read(descriptor, to + done, size - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return n < 0 ? errno : EIO;
    done += static_cast<std::size_t>(n);
  }
  return 0;
}

}  // namespace

MappedFile::MappedFile(const std::filesystem::path& file, Lock lock) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(file, std::string("cannot be opened (") + std::strerror(errno) + ")", "check the path and its permissions");
  struct stat status {};
  int error = fstat(descriptor, &status) == 0 ? 0 : errno;
  const bool regular = error == 0 && S_ISREG(status.st_mode);
  size_ = regular ? static_cast<std::size_t>(status.st_size) : 0;
  if (size_ > 0) {
    void* const at = lock == Lock::Yes ? mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)
                                       : mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    error = at == MAP_FAILED ? errno : 0;
    if (error == 0) data_ = at;
    if (error == 0 && lock == Lock::Yes) error = copy(descriptor, static_cast<std::byte*>(data_), size_);
    if (error != 0 && data_ != nullptr) munmap(std::exchange(data_, nullptr), size_);
  }
  ::close(descriptor);
  if (!regular) fail(file, "is no regular file", "give the path of a file");
  if (error != 0) fail(file, std::string("cannot be read (") + std::strerror(error) + ")", "free memory or check the disk");
  if (lock == Lock::Yes && size_ > 0 && mlock(data_, size_) != 0) {
    const std::string reason = std::strerror(errno);
    munmap(std::exchange(data_, nullptr), size_);
    fail(file, "cannot be locked in memory (" + reason + ")", "allow " + std::to_string((size_ >> 20U) + 1) + " MiB with ulimit -l");
  }
}

MappedFile& MappedFile::operator=(MappedFile&& other) noexcept {
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) munmap(data_, size_);
}

}  // namespace trocar::image_file
