#include "host/camera/file_sources.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "common/config/user_error.hpp"
#include "host/camera/image.hpp"

namespace trocar::camera {
namespace {

std::int64_t time_of(std::uint64_t number, double rate_hz) { return std::llround(1e9 * static_cast<double>(number) / rate_hz); }

}  // namespace

bool to_frame(const cv::Mat& image, bool bayer, optics::Frame& frame) {
  if (image.depth() != CV_8U || (image.channels() != 1 && image.channels() != 3)) return false;
  frame.width_px = image.cols;
  frame.height_px = image.rows;
  frame.pixels.resize(image.total() * static_cast<std::size_t>(image.channels()));
  if (image.channels() == 1) {
    frame.format = bayer ? optics::PixelFormat::BayerRG8 : optics::PixelFormat::Mono8;
    image.copyTo(cv::Mat(image.rows, image.cols, CV_8UC1, frame.pixels.data()));
  } else {
    frame.format = optics::PixelFormat::Rgb8;
    cv::Mat rgb(image.rows, image.cols, CV_8UC3, frame.pixels.data());
    cv::cvtColor(image, rgb, cv::COLOR_BGR2RGB);
  }
  return true;
}

FilesSource::FilesSource(std::vector<std::filesystem::path> files, const SourceOptions& options)
    : files_(std::move(files)), options_(options) {}

std::string FilesSource::what() const {
  return files_.size() == 1 ? files_.front().string() : fmt::format("{} images from {}", files_.size(), files_.front().string());
}

Source::Status FilesSource::next(optics::Frame& frame, std::chrono::milliseconds) {
  while (at_ < files_.size()) {
    const std::filesystem::path& file = files_[at_];
    const std::uint64_t number = at_++;
    cv::Mat image;
    try {
      image = read_image(file, Colour::AsStored);
    } catch (const DamagedImage& e) {
      notices_.push_back(fmt::format("{}: frame {} is lost: {}", file.string(), number, e.what()));
      ++counters_.lost;
      continue;
    }
    if (!to_frame(image, options_.bayer, frame))
      throw config::UserError(fmt::format("{}: its pixels are not grey or colour of 8 bits; convert it first", file.string()));
    if (first_.empty()) {
      first_ = file.string();
      width_px_ = image.cols;
      height_px_ = image.rows;
      channels_ = image.channels();
    }
    if (image.cols != width_px_ || image.rows != height_px_ || image.channels() != channels_)
      throw config::UserError(fmt::format("{}: {} x {} px in {} channels, but {} has {} x {} in {}; frames of one camera are all alike",
                                          file.string(), image.cols, image.rows, image.channels(), first_, width_px_, height_px_,
                                          channels_));
    frame.number = number;
    frame.time_ns = time_of(number, options_.rate_hz);
    ++counters_.frames;
    return Status::Frame;
  }
  return Status::End;
}

VideoSource::VideoSource(std::filesystem::path file, const SourceOptions& options) : file_(std::move(file)) {
  if (!std::filesystem::is_regular_file(file_))
    throw config::UserError(fmt::format("{}: there is no such file; check the path", file_.string()));
  // Not by whichever back end comes first: one takes a lone image for a video.
  if (!video_.open(file_.string(), cv::CAP_FFMPEG) && !video_.open(file_.string(), cv::CAP_OPENCV_MJPEG))
    throw config::UserError(fmt::format("{}: no video that can be decoded here; convert it, to MJPEG in AVI for one", file_.string()));
  const double own = video_.get(cv::CAP_PROP_FPS);
  rate_hz_ = std::isfinite(own) && own > 0.0 ? own : options.rate_hz;
  announced_ = video_.get(cv::CAP_PROP_FRAME_COUNT);
}

Source::Status VideoSource::next(optics::Frame& frame, std::chrono::milliseconds) {
  cv::Mat image;
  if (!video_.read(image) || image.empty()) {
    if (const double missing = announced_ - static_cast<double>(counters_.frames); missing >= 1.0 && notices_.empty()) {
      counters_.lost += static_cast<std::uint64_t>(missing);
      notices_.push_back(
          fmt::format("{}: ends after {} of {:.0f} frames: truncated or damaged", file_.string(), counters_.frames, announced_));
      announced_ = 0.0;
    }
    return Status::End;
  }
  if (!to_frame(image, false, frame))
    throw config::UserError(fmt::format("{}: its pixels are not of 8 bits; convert it first", file_.string()));
  frame.number = counters_.frames++;
  frame.time_ns = time_of(frame.number, rate_hz_);
  return Status::Frame;
}

}  // namespace trocar::camera
