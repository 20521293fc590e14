#include "firmware/model_watch/model_watch.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <chrono>
#include <exception>
#include <utility>

namespace trocar::model_watch {

namespace {

constexpr std::chrono::milliseconds period{200};

}  // namespace

ModelWatch::Stamp ModelWatch::stamp_of(const std::filesystem::path& file) {
  struct stat s {};
  if (stat(file.c_str(), &s) != 0) return {};
  return {s.st_dev, s.st_ino, static_cast<std::uint64_t>(s.st_size), s.st_mtim.tv_sec, s.st_mtim.tv_nsec};
}

ModelWatch::ModelWatch(std::filesystem::path file, virtual_needle::VirtualNeedle& needle, Say say)
    : file_(std::move(file)), needle_(needle), say_(std::move(say)) {
  seen_ = taken_ = stamp_of(file_);
  take();
  thread_ = std::thread([this] { run(); });
}

ModelWatch::~ModelWatch() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void ModelWatch::take() {
  images_.emplace_back(file_, image_file::Lock::Yes);
  needle_.offer(&images_.back().image());
}

void ModelWatch::look() {
  const model::Image* const used = needle_.using_image();
  while (images_.size() > 1 && &images_.front().image() != used) {
    bool later = false;
    for (const auto& image : images_) later = later || &image.image() == used;
    if (!later) break;  // none has been taken yet
    images_.pop_front();
  }
  // Whoever writes in place needs more than a moment: only what two looks find alike is read.
  const Stamp now = stamp_of(file_);
  const bool settled = now == std::exchange(seen_, now);
  if (!settled || now == taken_ || now == Stamp{}) return;
  taken_ = now;
  try {
    take();
    say_(fmt::format("model {} taken ({} kB)", file_.string(), images_.back().bytes().size() / 1000));
  } catch (const std::exception& e) {
    say_(fmt::format("{}; the model that runs stays", e.what()));
  }
}

void ModelWatch::run() {
  while (!stop_.load()) {
    std::this_thread::sleep_for(period);
    look();
  }
}

}  // namespace trocar::model_watch
