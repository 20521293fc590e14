#include "host/camera/queue.hpp"

#include <fmt/format.h>

#include <utility>

namespace trocar::camera {

QueuedSource::QueuedSource(std::unique_ptr<Source> source, std::size_t depth)
    : source_(std::move(source)), depth_(depth), clock_(source_->clock()), what_(source_->what()) {
  thread_ = std::thread([this] { read(); });
}

QueuedSource::~QueuedSource() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  thread_.join();
}

void QueuedSource::read() {
  constexpr std::chrono::milliseconds look_up{100};  // for the end that is asked of us
  optics::Frame frame;
  while (true) {
    Status status = Status::Lost;
    std::exception_ptr error;
    try {
      status = source_->next(frame, look_up);
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(mutex_);
    inner_ = source_->counters();
    what_ = source_->what();
    for (std::string& line : source_->notices()) notices_.push_back(std::move(line));
    if (stop_) return;
    if (status == Status::Timeout && !error) continue;
    if (error || status != Status::Frame) {
      error_ = error;
      end_ = status;
      arrived_.notify_all();
      return;
    }
    if (queue_.size() == depth_) {
      notices_.push_back(fmt::format("frame {} is dropped: the queue of {} is full", queue_.front().number, depth_));
      spare_.push_back(std::move(queue_.front()));
      queue_.pop_front();
      ++dropped_;
    }
    queue_.push_back(std::move(frame));
    frame = {};
    if (!spare_.empty()) {
      frame = std::move(spare_.back());
      spare_.pop_back();
    }
    arrived_.notify_all();
  }
}

Source::Status QueuedSource::next(optics::Frame& frame, std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  arrived_.wait_for(lock, timeout, [this] { return !queue_.empty() || end_ != Status::Frame; });
  if (!queue_.empty()) {
    std::swap(frame, queue_.front());
    if (queue_.front().pixels.capacity() > 0) spare_.push_back(std::move(queue_.front()));
    queue_.pop_front();
    ++taken_;
    return Status::Frame;
  }
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  return end_ == Status::Frame ? Status::Timeout : end_;
}

SourceCounters QueuedSource::counters() const {
  const std::lock_guard lock(mutex_);
  return {taken_, inner_.lost, dropped_};
}

std::string QueuedSource::what() const {
  const std::lock_guard lock(mutex_);
  return what_;
}

std::vector<std::string> QueuedSource::notices() {
  const std::lock_guard lock(mutex_);
  return std::exchange(notices_, {});
}

}  // namespace trocar::camera
