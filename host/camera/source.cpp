#include "host/camera/source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <string_view>

#include "common/config/user_error.hpp"
#include "host/camera/aravis_source.hpp"
#include "host/camera/file_sources.hpp"
#include "host/camera/queue.hpp"
#include "host/camera/rig_clock.hpp"
#include "host/camera/stream_source.hpp"

namespace trocar::camera {
namespace {

constexpr std::size_t queue_depth = 8;

std::string extension_of(const std::filesystem::path& file) {
  std::string text = file.extension().string();
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

bool is_one_of(const std::string& extension, std::initializer_list<std::string_view> list) {
  return std::ranges::find(list, extension) != list.end();
}

std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.is_regular_file() &&
        is_one_of(extension_of(entry.path()), {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm"}))
      files.push_back(entry.path());
  std::ranges::sort(files);
  if (files.empty())
    throw config::UserError(
        fmt::format("{}: this folder holds no images (PNG, JPEG, TIFF, BMP, PGM, PPM); name another one", folder.string()));
  return files;
}

std::unique_ptr<Source> open_plain(const std::vector<std::string>& names, const SourceOptions& options) {
  const std::string& first = names.at(0);
  const bool alone = names.size() == 1;
  constexpr std::string_view aravis = "aravis", stream = "stream:";
  if (alone && first == aravis) return open_aravis("", options);
  if (alone && first.starts_with("aravis:")) return open_aravis(first.substr(aravis.size() + 1), options);
  if (alone && first.starts_with(stream)) return std::make_unique<StreamSource>(first.substr(stream.size()));
  if (alone && is_one_of(extension_of(first), {".avi", ".mp4", ".mkv", ".mov", ".mpg", ".mpeg", ".webm"}))
    return std::make_unique<VideoSource>(first, options);
  if (alone && std::filesystem::is_directory(first)) return std::make_unique<FilesSource>(images_in(first), options);
  return std::make_unique<FilesSource>(std::vector<std::filesystem::path>(names.begin(), names.end()), options);
}

}  // namespace

const char* to_string(Clock clock) noexcept {
  switch (clock) {
    case Clock::Camera:
      return "camera";
    case Clock::Host:
      return "host";
    case Clock::Rig:
      return "rig";
    case Clock::Rate:
      break;
  }
  return "rate";
}

std::int64_t now_ns() { return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::unique_ptr<Source> open_source(const std::vector<std::string>& names, const SourceOptions& options) {
  std::unique_ptr<Source> source = open_plain(names, options);
  if (source->clock() != Clock::Camera && source->clock() != Clock::Host) return source;
  source = std::make_unique<QueuedSource>(std::move(source), queue_depth);
  if (options.domain) source = std::make_unique<RigTimedSource>(std::move(source), std::make_unique<RigClock>(*options.domain));
  return source;
}

}  // namespace trocar::camera
