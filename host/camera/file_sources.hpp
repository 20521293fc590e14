// Frames from image files and from videos.
#pragma once

#include <filesystem>
#include <opencv2/videoio.hpp>
#include <string>
#include <utility>
#include <vector>

#include "host/camera/source.hpp"

namespace trocar::camera {

// Number: the file's place in the list. A damaged one is lost, by name.
class FilesSource : public Source {
 public:
  FilesSource(std::vector<std::filesystem::path> files, const SourceOptions& options);
  Status next(optics::Frame& frame, std::chrono::milliseconds timeout) override;
  [[nodiscard]] SourceCounters counters() const override { return counters_; }
  [[nodiscard]] Clock clock() const override { return Clock::Rate; }
  [[nodiscard]] std::string what() const override;
  std::vector<std::string> notices() override { return std::exchange(notices_, {}); }

 private:
  std::vector<std::filesystem::path> files_;
  SourceOptions options_;
  std::size_t at_{};
  int width_px_{}, height_px_{}, channels_{};
  std::string first_{};
  SourceCounters counters_{};
  std::vector<std::string> notices_{};
};

// At the video's own rate, where it has one. Colour; a video that ends early ends the source there.
class VideoSource : public Source {
 public:
  VideoSource(std::filesystem::path file, const SourceOptions& options);  // throws config::UserError
  Status next(optics::Frame& frame, std::chrono::milliseconds timeout) override;
  [[nodiscard]] SourceCounters counters() const override { return counters_; }
  [[nodiscard]] Clock clock() const override { return Clock::Rate; }
  [[nodiscard]] std::string what() const override { return file_.string(); }
  std::vector<std::string> notices() override { return std::exchange(notices_, {}); }

 private:
  std::filesystem::path file_;
  cv::VideoCapture video_{};
  double rate_hz_{}, announced_{};
  SourceCounters counters_{};
  std::vector<std::string> notices_{};
};

// 8 bits; one channel or three (blue, green, red) as OpenCV has them.
[[nodiscard]] bool to_frame(const cv::Mat& image, bool bayer, optics::Frame& frame);

}  // namespace trocar::camera
