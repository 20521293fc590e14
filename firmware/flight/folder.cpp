#include "firmware/flight/folder.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "common/capture/samples_csv.hpp"

namespace trocar::flight {

namespace {

constexpr std::string_view prefix = "flight_";
constexpr std::chrono::minutes abandoned{1};  // no writer takes so long over a megabyte

}  // namespace

std::filesystem::path Folder::write(const Recording& recording, std::chrono::system_clock::time_point now) const {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  if (error)
    throw capture::CaptureError(
        fmt::format("cannot create the folder {}: {}; choose one that you may write to", folder_.string(), error.message()));
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()).count();
  const std::time_t seconds = static_cast<std::time_t>(ms / 1000);
  const auto file =
      folder_ / fmt::format("{}{:%Y%m%dT%H%M%S}.{:03}Z_{}.csv", prefix, fmt::gmtime(seconds), ms % 1000, to_string(recording.fault));
  capture::write_samples_csv(file, recording.samples);
  tidy();
  return file;
}

// What cannot be removed stays: the next recording tries again.
void Folder::tidy() const noexcept {
  try {
    std::vector<std::filesystem::path> recordings;
    std::error_code ignored;
    const auto now = std::filesystem::file_time_type::clock::now();
    for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with(prefix) || !entry.is_regular_file(ignored)) continue;
      if (name.ends_with(".csv")) recordings.push_back(entry.path());
      if (name.ends_with(".part") && now - entry.last_write_time(ignored) > abandoned) std::filesystem::remove(entry.path(), ignored);
    }
    std::sort(recordings.begin(), recordings.end());  // the names begin with the time
    for (std::size_t i = 0; i + kept_files < recordings.size(); ++i) std::filesystem::remove(recordings[i], ignored);
  } catch (const std::exception&) {  // NOLINT(bugprone-empty-catch): old recordings stay, which harms nobody
  }
}

}  // namespace trocar::flight
