#include "host/camera/image.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "common/config/user_error.hpp"

namespace trocar::camera {
namespace {

using Bytes = std::vector<unsigned char>;

constexpr std::uintmax_t largest_file = std::uintmax_t{1} << 30U;

Bytes read_bytes(const std::filesystem::path& file) {
  const auto refuse = [&file](const std::string& problem) { throw config::UserError(fmt::format("{}: {}", file.string(), problem)); };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (status.type() == std::filesystem::file_type::not_found) refuse("there is no such file; check the path");
  if (status.type() == std::filesystem::file_type::directory) refuse("this is a folder; name the images in it, such as FOLDER/*.png");
  if (status.type() != std::filesystem::file_type::regular) refuse("not a regular file; name an image");
  if (std::filesystem::file_size(file, error) > largest_file) refuse("larger than 1 GiB; name an image");
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse(fmt::format("cannot be opened: {}; check the permissions of the file", std::strerror(errno)));
  return {std::istreambuf_iterator<char>(stream), {}};
}

// OpenCV decodes a JPEG that ends early without a word, and fills the rest with grey. Walks the segments to the end marker.
bool jpeg_is_cut(const Bytes& data) {
  std::size_t at = 2;
  while (at + 1 < data.size()) {
    if (data[at] != 0xFF) {
      ++at;  // entropy-coded data
      continue;
    }
    const unsigned char marker = data[at + 1];
    if (marker == 0xD9) return false;
    // Fill bytes, stuffed zeros, restarts and TEM have no length.
    if (marker == 0xFF) {
      ++at;
    } else if (marker == 0x00 || marker == 0x01 || (marker >= 0xD0 && marker <= 0xD8)) {
      at += 2;
    } else {
      if (at + 3 >= data.size()) return true;
      at += 2 + 256U * data[at + 2] + data[at + 3];
    }
  }
  return true;
}

// What the image libraries under OpenCV print to stderr, of their own accord, about an image that they decode: kept, and not shown.
class Murmur {
 public:
  Murmur() : file_(::memfd_create("murmur", MFD_CLOEXEC)), stderr_(::fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 3)) {
    std::fflush(stderr);
    if (file_ >= 0 && stderr_ >= 0) (void)::dup2(file_, STDERR_FILENO);
  }
  ~Murmur() {
    std::fflush(stderr);
    if (file_ >= 0 && stderr_ >= 0) (void)::dup2(stderr_, STDERR_FILENO);
    for (const int fd : {file_, stderr_})
      if (fd >= 0) (void)::close(fd);
  }
  Murmur(const Murmur&) = delete;
  Murmur& operator=(const Murmur&) = delete;
  [[nodiscard]] bool any() const { return file_ >= 0 && ::lseek(file_, 0, SEEK_END) > 0; }

 private:
  int file_, stderr_;
};

}  // namespace

cv::Mat read_image(const std::filesystem::path& file, Colour colour) {
  const Bytes data = read_bytes(file);
  if (data.empty()) throw DamagedImage("the file is empty");
  const bool jpeg = data.size() > 2 && data[0] == 0xFF && data[1] == 0xD8;
  if (jpeg && jpeg_is_cut(data)) throw DamagedImage("truncated: the JPEG ends before its end marker");
  cv::Mat image;
  const Murmur murmur;
  try {
    image = cv::imdecode(data, colour == Colour::Grey ? cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION : cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception& e) {
    throw DamagedImage(fmt::format("cannot be decoded ({})", e.err));
  }
  if (image.empty()) throw DamagedImage("truncated, damaged, or no image in a format known here (PNG, JPEG, TIFF, BMP, PGM)");
  // libjpeg goes on with what it can guess, and says so only there.
  if (jpeg && murmur.any()) throw DamagedImage("damaged: its JPEG data are corrupt");
  return image;
}

}  // namespace trocar::camera
